#include "engine/editing/ball_cover.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/region.h"

namespace pointwright {
namespace {

// Distances come from float differences of float places: 4 roundings of 2^-24 at most, and some room.
constexpr double kDistanceError = 4e-6;
// Below it the squares of floats lose their digits.
constexpr float kLeastDistance = 1e-16F;
// Balls between two looks at the context.
constexpr std::size_t kBallBlock = 1024;

struct Split {
  Points member;  // positions, in the order of the samples
  Points other;
};

Split split(const Points& position, const SampleMask& members) {
  const auto count = static_cast<std::size_t>(std::ranges::count_if(members, [](auto m) { return m != 0; }));
  Split parts{.member = Points(count), .other = Points(position.size() - count)};
  std::size_t m = 0;
  std::size_t o = 0;
  for (std::size_t i = 0; i < position.size(); ++i) {
    if (members[i] != 0)
      parts.member.set(m++, position[i]);
    else
      parts.other.set(o++, position[i]);
  }
  return parts;
}

Region point_region(const Points& points) {
  return Region(points, std::vector<float>(points.size(), 0.0F), BallOrder::kCoherent);
}

// How far two samples' places, rounded to doubles beside the origin, may differ from their float distance.
double place_error(const Box3f& box, const Vec3d& origin) {
  const Vec3f size = box.min.cwiseAbs().cwiseMax(box.max.cwiseAbs());
  const double largest = (origin.cwiseAbs() + size.cast<double>()).maxCoeff();
  return 4.0 * std::numeric_limits<double>::epsilon() * largest;
}

// One radius a member. Balls of these radii hold no other sample, but for those at the very place of a member.
std::vector<float> free_radii(const Split& parts, double error, const ExecutionContext* context) {
  const std::size_t count = parts.member.size();
  std::vector<float> radius(count, 0.0F);
  const Region others = point_region(parts.other);
  const Region own = point_region(parts.member);
  parallel_for(
      count,
      [&](std::size_t begin, std::size_t end) {
        RegionDistances to_other;
        others.distances(parts.member, begin, end, to_other);
        // Back from the other sample: the border runs halfway between it and the member nearest to it.
        Points nearest(end - begin);
        for (std::size_t i = 0; i < end - begin; ++i)
          nearest.set(i, parts.member[begin + i] - to_other.distance[i] * to_other.gradient[i]);
        RegionDistances back;
        own.distances(nearest, 0, end - begin, back);
        for (std::size_t i = 0; i < end - begin; ++i) {
          const double distance = to_other.distance[i];
          const double free = distance * (1.0 - kDistanceError) - error;
          if (to_other.distance[i] < kLeastDistance || free <= 0.0) continue;
          const double gap = std::min(to_other.distance[i], back.distance[i]);
          radius[begin + i] = static_cast<float>(std::min(free, distance - 0.5 * gap));
        }
      },
      kParallelBlock, context);
  return radius;
}

// Boxes around every 16 members, around every 16 of those, and so on up to one: what a ball covers is found
// from the top, and boxes that are done with are not opened again.
class OpenMembers {
 public:
  OpenMembers(const Points& member, const Vec3d& origin, double error)
      : member_(member), origin_(origin), error_(error), covered_(member.size(), 0) {
    std::size_t count = member.size();
    do {
      const std::size_t below = count;
      count = (count + kFanout - 1) / kFanout;
      const std::vector<Node>* children = levels_.empty() ? nullptr : &levels_.back();
      std::vector<Node> level(count);
      for (std::size_t i = 0; i < below; ++i) {
        Box3f& box = level[i / kFanout].box;
        box.extend(children == nullptr ? member[i] : (*children)[i].box.min);
        box.extend(children == nullptr ? member[i] : (*children)[i].box.max);
      }
      levels_.push_back(std::move(level));
    } while (count > 1);
  }

  [[nodiscard]] bool is_covered(std::size_t i) const { return covered_[i] != 0; }
  [[nodiscard]] Vec3d place(std::size_t i) const { return origin_ + member_[i].cast<double>(); }

  void cover(std::size_t center, double radius) {
    const Ball ball{.offset = member_[center].cast<double>(), .place = place(center), .radius = radius};
    cover(ball, levels_.size() - 1, 0);
  }

 private:
  static constexpr std::size_t kFanout = 16;
  struct Node {
    Box3f box;
    bool done = false;  // no open member below
  };
  struct Ball {
    Vec3d offset;  // from the origin
    Vec3d place;
    double radius;
  };

  void cover(const Ball& ball, std::size_t level, std::size_t at) {
    Node& node = levels_[level][at];
    if (node.done) return;
    const Vec3d low = node.box.min.cast<double>() - ball.offset;
    const Vec3d high = node.box.max.cast<double>() - ball.offset;
    // The boxes are those of the unrounded places.
    const double reach = ball.radius * (1.0 + kSlack) + error_;
    if (low.cwiseMax(-high).cwiseMax(0.0).squaredNorm() > reach * reach) return;
    const double inner = ball.radius * (1.0 - kSlack) - error_;
    if (inner > 0.0 && low.cwiseAbs().cwiseMax(high.cwiseAbs()).squaredNorm() <= inner * inner) {
      close(level, at);
      return;
    }
    node.done = true;
    const std::size_t end =
        std::min((at + 1) * kFanout, level == 0 ? member_.size() : levels_[level - 1].size());
    for (std::size_t i = at * kFanout; i < end; ++i) {
      if (level > 0) {
        cover(ball, level - 1, i);
        node.done = node.done && levels_[level - 1][i].done;
      } else {
        // The test of the shape itself.
        if ((place(i) - ball.place).squaredNorm() <= ball.radius * ball.radius) covered_[i] = 1;
        node.done = node.done && covered_[i] != 0;
      }
    }
  }

  void close(std::size_t level, std::size_t at) {
    levels_[level][at].done = true;
    std::size_t span = kFanout;
    for (std::size_t l = 0; l < level; ++l) span *= kFanout;
    const std::size_t end = std::min((at + 1) * span, member_.size());
    std::fill(covered_.begin() + static_cast<std::ptrdiff_t>(at * span),
              covered_.begin() + static_cast<std::ptrdiff_t>(end), std::uint8_t{1});
  }

  static constexpr double kSlack = 1e-12;
  const Points& member_;
  const Vec3d& origin_;
  double error_;
  std::vector<std::uint8_t> covered_;
  std::vector<std::vector<Node>> levels_;
};

// Members by descending radius, ties by index.
std::vector<std::uint32_t> by_radius(const std::vector<float>& radius) {
  std::vector<std::uint64_t> keys(radius.size());
  std::vector<std::uint32_t> order(radius.size());
  for (std::size_t i = 0; i < radius.size(); ++i) {
    keys[i] = ~std::bit_cast<std::uint32_t>(radius[i]) & 0xffffffffU;  // no radius is negative
    order[i] = static_cast<std::uint32_t>(i);
  }
  sort_by_key(keys, order);
  return order;
}

}  // namespace

std::vector<PointSet> ball_cover(const Points& position, const SampleMask& members, const Vec3d& origin,
                                 const ExecutionContext* context) {
  POINTWRIGHT_CHECK(members.size() == position.size(), "one entry per sample");
  const Split parts = split(position, members);
  std::vector<PointSet> cover;
  if (parts.member.empty()) return cover;
  const Box3f box = bounds_of(position);
  const double error = place_error(box, origin);
  std::vector<float> radius;
  if (parts.other.empty()) {
    const double across = 1.0001 * static_cast<double>(box.diagonal()) + error;
    radius.assign(parts.member.size(), static_cast<float>(across));
  } else {
    radius = free_radii(parts, error, context);
  }
  OpenMembers open(parts.member, origin, error);
  std::size_t balls = 0;
  for (const std::uint32_t i : by_radius(radius)) {
    if (open.is_covered(i)) continue;
    if (balls % kBallBlock == 0 && context != nullptr && context->is_cancelled()) return cover;
    if (balls++ % kMaxStrokeVertices == 0) cover.emplace_back();
    const double r = std::max(static_cast<double>(radius[i]), kLeastBallRadius);
    cover.back().points.push_back(open.place(i));
    cover.back().radii.push_back(r);
    open.cover(i, r);
  }
  return cover;
}

}  // namespace pointwright
