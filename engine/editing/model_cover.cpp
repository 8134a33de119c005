#include "engine/editing/model_cover.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Relative: what leaving far samples out grants to the rounding of distances in float32.
constexpr double kReachSlack = 1e-5;

// The greatest float that is not beyond the thickness: balls never grow by rounding.
float ball_radius(double thickness) {
  const auto nearest = static_cast<float>(thickness);
  if (double{nearest} <= thickness) return nearest;
  return std::nextafter(nearest, 0.0F);
}

// The moved samples near the box, relative to `origin`, in the order of the cloud.
Points samples_near(const ModelShape& shape, const Box3f& box, const Vec3d& origin,
                    const ExecutionContext* context) {
  const std::size_t m = shape.cloud->size();
  const Vec3d low = box.min.cast<double>();
  const Vec3d high = box.max.cast<double>();
  const double reach =
      (shape.thickness + low.cwiseAbs().maxCoeff() + high.cwiseAbs().maxCoeff()) * kReachSlack +
      shape.thickness;
  Points places(m);
  std::vector<std::uint8_t> is_near(m, 0);
  parallel_for(
      m,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          const Vec3d place = moved_sample(shape, i) - origin;
          const bool within =
              (place.array() >= low.array() - reach).all() && (place.array() <= high.array() + reach).all();
          if (!within) continue;
          is_near[i] = 1;
          places.set(i, place.cast<float>());
        }
      },
      kParallelBlock, context);
  if (context != nullptr && context->is_cancelled()) return {};
  Points near(static_cast<std::size_t>(std::count(is_near.begin(), is_near.end(), std::uint8_t{1})));
  std::size_t count = 0;
  for (std::size_t i = 0; i < m; ++i) {
    if (is_near[i] != 0) near.set(count++, places[i]);
  }
  return near;
}

}  // namespace

ModelCover::ModelCover(const ModelShape& shape, const Points& position, const Vec3d& origin,
                       const ExecutionContext* context) {
  if (position.empty()) return;
  const Points near = samples_near(shape, bounds_of(position), origin, context);
  // Affine maps keep neighbours: the cloud's order is coherent after them too.
  region_ = Region(near, std::vector<float>(near.size(), ball_radius(shape.thickness)), BallOrder::kCoherent);
}

void ModelCover::cover(const Points& position, std::size_t begin, std::size_t end, std::uint8_t* covered,
                       RegionDistances& scratch) const {
  std::fill_n(covered, end - begin, std::uint8_t{0});
  if (region_.empty()) return;
  // Only inside or outside counts: the lowest limit ends a query at the first ball that holds the sample.
  const std::vector<float> limits(padded_to_block(end - begin), std::numeric_limits<float>::min());
  region_.distances(position, begin, end, scratch, &limits);
  for (std::size_t i = begin; i < end; ++i) covered[i - begin] = scratch.distance[i - begin] <= 0.0F ? 1 : 0;
}

}  // namespace pointwright
