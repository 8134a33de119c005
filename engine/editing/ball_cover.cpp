#include "engine/editing/ball_cover.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/region.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {
namespace {

// Distances come from float differences of float places: 4 roundings of 2^-24 at most, and some room.
constexpr double kDistanceError = 4e-6;
// Below it the squares of floats lose their digits.
constexpr float kLeastDistance = 1e-16F;
// What stands nearer to a member than this many others do is the member's own part of the surface.
constexpr std::uint32_t kOwnNeighbors = 6;
// Balls between two looks at the context.
constexpr std::size_t kBallBlock = 1024;

// How far two samples' places, rounded to doubles beside the origin, may differ from their float distance.
double place_error(const Box3f& box, const Vec3d& origin) {
  const Vec3f size = box.min.cwiseAbs().cwiseMax(box.max.cwiseAbs());
  const double largest = (origin.cwiseAbs() + size.cast<double>()).maxCoeff();
  return 4.0 * std::numeric_limits<double>::epsilon() * largest;
}

// The members, and the other samples as near to them as a ball may reach.
struct Split {
  Points member;  // positions, in the order of the samples
  Points other;
  float reach = 0.0F;  // a ball of this radius around any member holds all and what they stand for
  double error = 0.0;  // place_error()
};

Points chosen(const Points& position, const std::vector<std::uint32_t>& samples) {
  Points points(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) points.set(i, position[samples[i]]);
  return points;
}

Split split(const Points& position, const SampleMask& members, const Vec3d& origin) {
  std::vector<std::uint32_t> member;
  Box3f box;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i] == 0) continue;
    member.push_back(static_cast<std::uint32_t>(i));
    box.extend(position[i]);
  }
  Split parts{.member = chosen(position, member), .other = {}};
  if (member.empty()) return parts;
  parts.error = place_error(box, origin);
  parts.reach = static_cast<float>(2.0001 * static_cast<double>(box.diagonal()) + parts.error);
  const Vec3f margin = Vec3f::Constant(1.0001F * parts.reach);
  const Vec3f low = box.min - margin;
  const Vec3f high = box.max + margin;
  std::vector<std::uint32_t> other;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i] != 0) continue;
    const Vec3f p = position[i];
    if ((p.array() >= low.array()).all() && (p.array() <= high.array()).all())
      other.push_back(static_cast<std::uint32_t>(i));
  }
  parts.other = chosen(position, other);
  return parts;
}

Region point_region(const Points& points) {
  return Region(points, std::vector<float>(points.size(), 0.0F), BallOrder::kCoherent);
}

// One radius a member. Balls of these radii hold no other sample, but for those at a member's very place.
std::vector<float> free_radii(const Split& parts, const ExecutionContext* context) {
  const std::size_t count = parts.member.size();
  std::vector<float> radius(count, parts.reach);
  if (parts.other.empty()) return radius;
  const Region others = point_region(parts.other);
  const Region own = point_region(parts.member);
  const auto of_block = [&](std::size_t begin, std::size_t end) {
    const std::size_t size = end - begin;
    RegionDistances to_other;
    others.distances(parts.member, begin, end, to_other);
    // Back from the other sample: the border runs halfway between it and the member nearest to it.
    Points nearest(size);
    for (std::size_t i = 0; i < size; ++i)
      nearest.set(i, parts.member[begin + i] - to_other.distance[i] * to_other.gradient[i]);
    RegionDistances back;
    own.distances(nearest, 0, size, back);
    for (std::size_t i = 0; i < size; ++i) {
      const double distance = to_other.distance[i];
      const double free = distance * (1.0 - kDistanceError) - parts.error;
      const double halfway = distance - 0.5 * std::min<double>(distance, back.distance[i]);
      const bool none = to_other.distance[i] < kLeastDistance || free <= 0.0;
      radius[begin + i] = none ? 0.0F : std::min(parts.reach, static_cast<float>(std::min(free, halfway)));
    }
  };
  parallel_for(count, of_block, kParallelBlock, context);
  return radius;
}

// How far around a member a ball has to reach for the member to count as covered: as far as its own part of
// the surface, or as its own ball would. Without it samples of a finer scan fall between the large balls.
std::vector<float> own_reach(const Split& parts, const std::vector<float>& radius,
                             const ExecutionContext* context) {
  std::vector<float> reach(radius.size(), 0.0F);
  const NeighborGraph graph = build_neighbor_graph(parts.member, kOwnNeighbors, context);
  if (graph.k == 0) return reach;
  parallel_for(
      reach.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t farthest = graph.index(i, graph.k - 1);
          reach[i] = std::min(radius[i], (parts.member[farthest] - parts.member[i]).norm());
        }
      },
      kParallelBlock, context);
  return reach;
}

// Boxes around every 16 members, around every 16 of those, and so on up to one: what a ball covers is found
// from the top, and boxes that are done with are not opened again.
class OpenMembers {
 public:
  OpenMembers(const Points& member, const std::vector<float>& own_reach, const Vec3d& origin, double error)
      : member_(member), own_reach_(own_reach), origin_(origin), error_(error), covered_(member.size(), 0) {
    std::size_t count = member.size();
    do {
      const std::size_t below = count;
      count = (count + kFanout - 1) / kFanout;
      const std::vector<Node>* children = levels_.empty() ? nullptr : &levels_.back();
      std::vector<Node> level(count);
      for (std::size_t i = 0; i < below; ++i) {
        Node& node = level[i / kFanout];
        node.box.extend(children == nullptr ? member[i] : (*children)[i].box.min);
        node.box.extend(children == nullptr ? member[i] : (*children)[i].box.max);
        node.own_reach =
            std::max(node.own_reach, children == nullptr ? own_reach[i] : (*children)[i].own_reach);
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
    float own_reach = 0.0F;  // the largest below
    bool done = false;       // no open member below
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
    const double inner = ball.radius * (1.0 - kSlack) - error_ - static_cast<double>(node.own_reach);
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
        if (holds(ball, i)) covered_[i] = 1;
        node.done = node.done && covered_[i] != 0;
      }
    }
  }

  [[nodiscard]] bool holds(const Ball& ball, std::size_t i) const {
    const double distance_sq = (place(i) - ball.place).squaredNorm();
    // The test of the shape itself first: it rounds in its own way.
    return distance_sq <= ball.radius * ball.radius &&
           std::sqrt(distance_sq) <= ball.radius - static_cast<double>(own_reach_[i]);
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
  const std::vector<float>& own_reach_;
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
  const Split parts = split(position, members, origin);
  std::vector<PointSet> cover;
  if (parts.member.empty()) return cover;
  const std::vector<float> radius = free_radii(parts, context);
  const std::vector<float> reach = own_reach(parts, radius, context);
  OpenMembers open(parts.member, reach, origin, parts.error);
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
