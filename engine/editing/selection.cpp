#include "engine/editing/selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/region.h"

namespace pointwright {
namespace {

// The members as balls without extent: exact nearest distances, several times faster than a kd-tree's.
Region region_of(const Points& position, const SampleMask& members) {
  const auto count = static_cast<std::size_t>(std::count(members.begin(), members.end(), std::uint8_t{1}));
  Points centers(count);
  std::size_t next = 0;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i] != 0) centers.set(next++, position[i]);
  }
  return Region(centers, std::vector<float>(count, 0.0F), BallOrder::kCoherent);
}

// A sample and its distance; the nearest of many, ties by index.
struct Nearest {
  double distance_sq = std::numeric_limits<double>::infinity();
  std::size_t sample = 0;

  friend Nearest operator+(const Nearest& a, const Nearest& b) {
    return b.distance_sq < a.distance_sq ? b : a;
  }
};

// Whether normals are at most some angle apart; no angle is found to be greater than 0 between equal normals.
class AngleLimit {
 public:
  explicit AngleLimit(double angle)
      : everything_(angle >= std::numbers::pi),
        obtuse_(angle > 0.5 * std::numbers::pi),
        sin_sq_(std::sin(angle) * std::sin(angle)),
        cos_sq_(std::cos(angle) * std::cos(angle)) {}

  [[nodiscard]] bool holds(const Vec3f& a, const Vec3f& b) const {
    if (everything_) return true;
    const Vec3d u = a.cast<double>();
    const Vec3d v = b.cast<double>();
    const double dot = u.dot(v);
    // |u x v| = |u||v| sin, u . v = |u||v| cos: their ratio orders the angles of each quadrant.
    const double sine = cos_sq_ * u.cross(v).squaredNorm();
    const double cosine = sin_sq_ * dot * dot;
    return obtuse_ ? dot >= 0.0 || sine >= cosine : dot >= 0.0 && sine <= cosine;
  }

 private:
  bool everything_;
  bool obtuse_;
  double sin_sq_;
  double cos_sq_;
};

// How many samples are filled between two looks at the context.
constexpr std::size_t kFillBlock = 4096;

}  // namespace

SampleMask near_members(const Points& position, const SampleMask& members, double distance,
                        const ExecutionContext* context) {
  POINTWRIGHT_CHECK(members.size() == position.size(), "one entry per sample");
  SampleMask near(position.size(), 0);
  const Region region = region_of(position, members);
  if (region.empty()) return near;
  // Nobody needs to know how far it is beyond the distance asked for.
  const auto reach = static_cast<float>(distance);
  const float limit = std::max(std::nextafter(reach, std::numeric_limits<float>::infinity()),
                               std::numeric_limits<float>::min());
  parallel_for(
      position.size(),
      [&](std::size_t begin, std::size_t end) {
        RegionDistances found;
        const std::vector<float> limits(padded_to_block(end - begin), limit);
        region.distances(position, begin, end, found, &limits);
        for (std::size_t i = begin; i < end; ++i)
          near[i] = members[i] == 0 && found.distance[i - begin] <= reach ? 1 : 0;
      },
      kParallelBlock, context);
  return near;
}

SampleMask flood_fill(const PaintSurface& surface, const FloodFill& flood, const SampleMask& blocked,
                      const ExecutionContext* context) {
  const Points& position = surface.position;
  const std::size_t n = position.size();
  SampleMask filled(n, 0);
  const auto distance_sq = [&](std::size_t i) {
    return (surface.origin + position[i].cast<double>() - flood.seed).squaredNorm();
  };
  const auto nearest = parallel_sum<Nearest>(n, {}, [&](std::size_t begin, std::size_t end) {
    Nearest best;
    if (context != nullptr && context->is_cancelled()) return best;
    for (std::size_t i = begin; i < end; ++i)
      best = best + Nearest{.distance_sq = distance_sq(i), .sample = i};
    return best;
  });
  if (!std::isfinite(nearest.distance_sq)) return filled;

  const AngleLimit angle(flood.angle_rad.value_or(std::numbers::pi));
  const double radius_sq =
      flood.radius ? *flood.radius * *flood.radius : std::numeric_limits<double>::infinity();
  std::vector<std::uint32_t> open;
  const auto fill = [&](std::size_t i) {
    if (filled[i] != 0 || (!blocked.empty() && blocked[i] != 0) || distance_sq(i) > radius_sq) return;
    filled[i] = 1;
    open.push_back(static_cast<std::uint32_t>(i));
  };
  fill(nearest.sample);
  for (std::size_t count = 0; !open.empty(); ++count) {
    if (count % kFillBlock == 0 && context != nullptr && context->is_cancelled()) return filled;
    const std::size_t from = open.back();
    open.pop_back();
    const auto spread = [&](std::size_t to) {
      if (!flood.angle_rad || angle.holds(surface.normal[from], surface.normal[to])) fill(to);
    };
    for (std::uint32_t j = 0; j < surface.graph->k; ++j) spread(surface.graph->index(from, j));
    // Lists hold one of several samples that stand in one place: the others are beside it.
    if (from > 0 && position[from - 1] == position[from]) spread(from - 1);
    if (from + 1 < n && position[from + 1] == position[from]) spread(from + 1);
  }
  return filled;
}

}  // namespace pointwright
