#include "engine/editing/painted_field.h"

#include <algorithm>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/scale_field_range.h"

namespace pointwright {
namespace {

// Samples of a window: as many as region queries look at together.
constexpr std::size_t kWindow = 128;
static_assert(kParallelBlock % kWindow == 0 && kWindow % kSimdBlock == 0);
// Far more than distances of single precision are wrong by, relative to what they are made of.
constexpr float kRounding = 1e-5F;

bool has(const Marks& marks, std::size_t i, RegionKind kind) {
  return (marks[i] & static_cast<std::uint8_t>(kind)) != 0;
}

// Balls of one painting that the other has not, or has with another radius; around each the larger of both.
// The balls of a region are in the order of their samples.
Region changed_balls(const Points& position, const Marks& before, const Region& balls_before,
                     const Marks& now, const Region& balls_now, RegionKind kind, float& largest) {
  std::vector<std::uint32_t> sample;
  std::vector<float> radii;
  for (std::size_t i = 0, b = 0, a = 0; i < before.size(); ++i) {
    const bool was = has(before, i, kind);
    const bool is = has(now, i, kind);
    if (!was && !is) continue;
    const float radius_before = was ? balls_before.radius(b++) : -1.0F;
    const float radius_now = is ? balls_now.radius(a++) : -1.0F;
    if (radius_before == radius_now) continue;
    sample.push_back(static_cast<std::uint32_t>(i));
    radii.push_back(std::max(radius_before, radius_now));
    largest = std::max(largest, radii.back());
  }
  Points centers(sample.size());
  for (std::size_t m = 0; m < sample.size(); ++m) centers.set(m, position[sample[m]]);
  return Region(centers, radii, BallOrder::kCoherent);
}

// Adds the windows with a point that a ball comes as near to as the window's reach, or nearer.
void add_reached(const Points& middle, const std::vector<float>& half, const std::vector<float>& reach,
                 const Region& balls, float largest_radius, std::vector<std::uint8_t>& reached) {
  if (balls.empty()) return;
  parallel_for(middle.size(), [&](std::size_t begin, std::size_t end) {
    RegionDistances distances;
    balls.distances(middle, begin, end, distances);
    for (std::size_t w = begin; w < end; ++w) {
      const float distance = distances.distance[w - begin];
      const float slack = kRounding * (distance + half[w] + reach[w] + largest_radius);
      if (!(distance - half[w] - slack > reach[w])) reached[w] = 1;
    }
  });
}

float greatest(const std::vector<float>& distance, std::size_t begin, std::size_t end) {
  return *std::max_element(distance.begin() + static_cast<std::ptrdiff_t>(begin),
                           distance.begin() + static_cast<std::ptrdiff_t>(end));
}

void copy_range(const ScaleField& from, std::size_t begin, std::size_t end, ScaleField& to) {
  std::copy(from.t.data() + begin, from.t.data() + end, to.t.data() + begin);
  std::copy(from.gradient.x() + begin, from.gradient.x() + end, to.gradient.x() + begin);
  std::copy(from.gradient.y() + begin, from.gradient.y() + end, to.gradient.y() + begin);
  std::copy(from.gradient.z() + begin, from.gradient.z() + end, to.gradient.z() + begin);
}

}  // namespace

PaintedField::Windows PaintedField::windows_of(const Points& position) {
  const std::size_t count = (position.size() + kWindow - 1) / kWindow;
  Windows windows{.middle = Points(count),
                  .half = std::vector<float>(count),
                  .zero_reach = std::vector<float>(count),
                  .one_reach = std::vector<float>(count)};
  parallel_for(position.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t first = begin; first < end; first += kWindow) {
      Box3f box;
      for (std::size_t i = first; i < std::min(end, first + kWindow); ++i) box.extend(position[i]);
      // Halves first: the sum of two large coordinates must not overflow.
      const Vec3f middle = 0.5F * box.min + 0.5F * box.max;
      windows.middle.set(first / kWindow, middle);
      // From the middle as it was rounded: every sample of the window is as near.
      windows.half[first / kWindow] = (box.max - middle).cwiseMax(middle - box.min).norm();
    }
  });
  return windows;
}

std::vector<std::uint8_t> PaintedField::reached_windows(const Points& position,
                                                        const PaintedField& now) const {
  std::vector<std::uint8_t> reached(windows_.half.size(), 0);
  float largest = 0.0F;
  const Region zero = changed_balls(position, marks_, regions_.zero, now.marks_, now.regions_.zero,
                                    RegionKind::kZero, largest);
  const Region one =
      changed_balls(position, marks_, regions_.one, now.marks_, now.regions_.one, RegionKind::kOne, largest);
  add_reached(windows_.middle, windows_.half, windows_.zero_reach, zero, largest, reached);
  add_reached(windows_.middle, windows_.half, windows_.one_reach, one, largest, reached);
  return reached;
}

void PaintedField::fill(const Points& position, const std::vector<std::uint8_t>& fresh,
                        const ScaleField* before, const ExecutionContext* context) {
  const std::size_t n = position.size();
  auto field = std::make_shared<ScaleField>(unfilled_scale_field(n));
  parallel_for(
      n,
      [&](std::size_t begin, std::size_t end) {
        DistancePair distances;
        for (std::size_t first = begin; first < end;) {
          // As many windows in a row as share their fate.
          const bool is_fresh = fresh[first / kWindow] != 0;
          std::size_t last = std::min(end, first + kWindow);
          while (last < end && (fresh[last / kWindow] != 0) == is_fresh) last = std::min(end, last + kWindow);
          if (is_fresh) {
            compute_scale_range(position, regions_, blend_, first, last, distances, *field);
            for (std::size_t i = first; i < last; i += kWindow) {
              const std::size_t until = std::min(last, i + kWindow) - first;
              windows_.zero_reach[i / kWindow] = greatest(distances.zero.distance, i - first, until);
              windows_.one_reach[i / kWindow] = greatest(distances.one.distance, i - first, until);
            }
          } else {
            copy_range(*before, first, last, *field);
          }
          first = last;
        }
      },
      kParallelBlock, context);
  clear_padding(*field);
  field_ = std::move(field);
  computed_ = 0;
  for (std::size_t w = 0; w < fresh.size(); ++w)
    computed_ += fresh[w] != 0 ? std::min(kWindow, n - w * kWindow) : 0;
}

Result<PaintedField> PaintedField::make(const Points& position, const std::vector<float>& spacing,
                                        const Marks& marks, const Vec3d& origin, Blend blend,
                                        const ExecutionContext* context) {
  auto regions = regions_from_marks(position, spacing, marks, origin);
  if (!regions) return regions.error();
  PaintedField made(marks, std::move(regions).value(), blend);
  made.windows_ = windows_of(position);
  made.fill(position, std::vector<std::uint8_t>(made.windows_.half.size(), 1), nullptr, context);
  return made;
}

Result<PaintedField> PaintedField::repainted(const Points& position, const std::vector<float>& spacing,
                                             const Marks& marks, const Vec3d& origin,
                                             const ExecutionContext* context) const {
  POINTWRIGHT_CHECK(marks.size() == marks_.size(), "marks of the same samples");
  auto regions = regions_from_marks(position, spacing, marks, origin);
  if (!regions) return regions.error();
  PaintedField made(marks, std::move(regions).value(), blend_);
  made.windows_ = windows_;
  made.fill(position, reached_windows(position, made), field_.get(), context);
  return made;
}

}  // namespace pointwright
