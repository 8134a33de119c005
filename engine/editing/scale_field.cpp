#include "engine/editing/scale_field.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/scale_field_kernels.h"
#include "engine/editing/scale_field_range.h"

namespace pointwright {

float blend_value(Blend blend, float x) {
  const float s = 1.0F - x;
  switch (blend) {
    case Blend::kQuartic:
      return s * (1.0F + x) * s * (1.0F + x);
    case Blend::kCubic:
      return s * s * (1.0F + 2.0F * x);
    case Blend::kQuintic:
      return s * s * s * (1.0F + 3.0F * x + 6.0F * x * x);
    case Blend::kCosine:
      return 0.5F * (1.0F + std::cos(std::numbers::pi_v<float> * x));
  }
  POINTWRIGHT_CHECK(false, "a known blend");
}

float blend_slope(Blend blend, float x) {
  const float s = 1.0F - x;
  switch (blend) {
    case Blend::kQuartic:
      return -4.0F * x * s * (1.0F + x);
    case Blend::kCubic:
      return -6.0F * x * s;
    case Blend::kQuintic:
      return -30.0F * x * x * s * s;
    case Blend::kCosine:
      return -0.5F * std::numbers::pi_v<float> * std::sin(std::numbers::pi_v<float> * x);
  }
  POINTWRIGHT_CHECK(false, "a known blend");
}

namespace {

DistanceColumns columns_of(const RegionDistances& distances) {
  return {.distance = distances.distance.data(),
          .gradient_x = distances.gradient.x(),
          .gradient_y = distances.gradient.y(),
          .gradient_z = distances.gradient.z()};
}

// Below this a limited query only finds out whether a point is inside a region.
constexpr float kInsideOnly = std::numeric_limits<float>::min();
constexpr float kNoLimit = std::numeric_limits<float>::infinity();

// d_0 and d_1 of a block. Inside a region t does not depend on the distance to the other one, which is
// usually the costly one to find: it is limited there.
void region_distances(const RegionPair& regions, const Points& position, std::size_t begin, std::size_t end,
                      RegionDistances& zero, RegionDistances& one) {
  const std::size_t count = padded_to_block(end - begin);
  std::vector<float> limits(count, kInsideOnly);
  regions.one.distances(position, begin, end, one, &limits);
  for (std::size_t i = 0; i < count; ++i) limits[i] = one.distance[i] <= 0.0F ? kInsideOnly : kNoLimit;
  regions.zero.distances(position, begin, end, zero, &limits);
  for (std::size_t i = 0; i < count; ++i) {
    const bool inside = one.distance[i] <= 0.0F || zero.distance[i] <= 0.0F;
    limits[i] = inside ? one.distance[i] : kNoLimit;
  }
  regions.one.distances(position, begin, end, one, &limits);
}

void (*blend_kernel(Blend blend))(const ScaleBlend&, std::size_t) {
  switch (blend) {
    case Blend::kQuartic:
      return POINTWRIGHT_KERNEL(blend_quartic);
    case Blend::kCubic:
      return POINTWRIGHT_KERNEL(blend_cubic);
    case Blend::kQuintic:
      return POINTWRIGHT_KERNEL(blend_quintic);
    case Blend::kCosine:
      return POINTWRIGHT_KERNEL(blend_cosine);
  }
  POINTWRIGHT_CHECK(false, "a known blend");
}

}  // namespace

void compute_scale_range(const Points& position, const RegionPair& regions, Blend blend, std::size_t begin,
                         std::size_t end, DistancePair& distances, ScaleField& field) {
  region_distances(regions, position, begin, end, distances.zero, distances.one);
  blend_kernel(blend)(ScaleBlend{.zero = columns_of(distances.zero),
                                 .one = columns_of(distances.one),
                                 .t = field.t.data() + begin,
                                 .gradient_x = field.gradient.x() + begin,
                                 .gradient_y = field.gradient.y() + begin,
                                 .gradient_z = field.gradient.z() + begin},
                      padded_to_block(end - begin));
}

ScaleField unfilled_scale_field(std::size_t n) {
  return {.t = std::vector<float>(padded_to_block(n)), .gradient = Points(n)};
}

void clear_padding(ScaleField& field) {
  for (std::size_t i = field.size(); i < field.t.size(); ++i) {
    field.t[i] = 0.0F;
    for (float* column : {field.gradient.x(), field.gradient.y(), field.gradient.z()}) column[i] = 0.0F;
  }
}

ScaleField compute_scale_field(const Points& position, const RegionPair& regions, Blend blend,
                               const ExecutionContext* context) {
  POINTWRIGHT_CHECK(!regions.zero.empty() && !regions.one.empty(), "both regions hold a ball");
  ScaleField field = unfilled_scale_field(position.size());
  parallel_for(
      position.size(),
      [&](std::size_t begin, std::size_t end) {
        DistancePair distances;
        compute_scale_range(position, regions, blend, begin, end, distances, field);
      },
      kParallelBlock, context);
  clear_padding(field);
  return field;
}

}  // namespace pointwright
