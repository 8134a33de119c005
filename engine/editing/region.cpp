#include "engine/editing/region.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/region_kernels.h"
#include "engine/spatial/coherent_order.h"

namespace pointwright {

// The balls in coherent order under an implicit tree (region_kernels.h says how nodes are laid out).
struct Region::Tree {
  std::vector<Ball> ball;
  std::vector<std::int32_t> id;     // of the ball in a slot
  std::vector<std::uint32_t> slot;  // of the ball with an id
  std::vector<BallNode> node;
  BallTreeView view{};

  void build_nodes();
};

namespace {

BallNode empty_node() {
  constexpr float kMax = std::numeric_limits<float>::max();
  return {kMax, kMax, kMax, 0.0F, -kMax, -kMax, -kMax, 0.0F};
}

void extend(BallNode& node, const Ball& ball) {
  node.min_x = std::min(node.min_x, ball.x);
  node.min_y = std::min(node.min_y, ball.y);
  node.min_z = std::min(node.min_z, ball.z);
  node.max_x = std::max(node.max_x, ball.x);
  node.max_y = std::max(node.max_y, ball.y);
  node.max_z = std::max(node.max_z, ball.z);
  node.max_radius = std::max(node.max_radius, ball.radius);
}

void extend(BallNode& node, const BallNode& child) {
  extend(node, Ball{child.min_x, child.min_y, child.min_z, child.max_radius});
  extend(node, Ball{child.max_x, child.max_y, child.max_z, child.max_radius});
}

// A list of the children of node `index` on a level above the leaves, or of the balls of a leaf.
struct Range {
  std::size_t begin;
  std::size_t end;
};
Range children(std::size_t index, std::size_t fanout, std::size_t count) {
  return {index * fanout, std::min((index + 1) * fanout, count)};
}

// The distance to one ball, and the displacement from its centre: the operations of region_kernels.inc, in
// its order.
struct BallDistance {
  float distance, dx, dy, dz, length;
};
BallDistance distance_to(const Ball& ball, const Vec3f& p) {
  const float dx = p.x() - ball.x;
  const float dy = p.y() - ball.y;
  const float dz = p.z() - ball.z;
  const float length = std::sqrt(dx * dx + dy * dy + dz * dz);
  return {std::max(length - ball.radius, 0.0F), dx, dy, dz, length};
}

float bound_of(const BallNode& node, const Vec3f& p) {
  const float dx = std::max(std::max(node.min_x - p.x(), p.x() - node.max_x), 0.0F);
  const float dy = std::max(std::max(node.min_y - p.y(), p.y() - node.max_y), 0.0F);
  const float dz = std::max(std::max(node.min_z - p.z(), p.z() - node.max_z), 0.0F);
  return std::max(std::sqrt(dx * dx + dy * dy + dz * dz) - node.max_radius, 0.0F);
}

}  // namespace

void Region::Tree::build_nodes() {
  std::size_t count = (ball.size() + kBallsPerLeaf - 1) / kBallsPerLeaf;
  std::size_t total = 0;
  view = {};
  for (std::size_t size = count;; size = (size + kBallTreeFanout - 1) / kBallTreeFanout) {
    POINTWRIGHT_CHECK(view.level_count < kBallTreeMaxLevels, "fewer than 2^29 balls");
    view.level_begin[view.level_count] = static_cast<std::uint32_t>(total);
    view.level_size[view.level_count] = static_cast<std::uint32_t>(size);
    ++view.level_count;
    total += size;
    if (size <= 1) break;
  }
  node.assign(total, empty_node());
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Range balls = children(i, kBallsPerLeaf, ball.size());
      for (std::size_t b = balls.begin; b < balls.end; ++b) extend(node[i], ball[b]);
    }
  });
  for (std::size_t level = 1; level < view.level_count; ++level) {
    for (std::size_t i = 0; i < view.level_size[level]; ++i) {
      const Range nodes = children(i, kBallTreeFanout, view.level_size[level - 1]);
      for (std::size_t c = nodes.begin; c < nodes.end; ++c) {
        extend(node[view.level_begin[level] + i], node[view.level_begin[level - 1] + c]);
      }
    }
  }
  view.ball = ball.data();
  view.id = id.data();
  view.node = node.data();
  view.ball_count = static_cast<std::uint32_t>(ball.size());
}

Region::Region(const Points& centers, const std::vector<float>& radii, BallOrder order) {
  const std::size_t m = centers.size();
  POINTWRIGHT_CHECK(radii.size() == m, "one radius per centre");
  POINTWRIGHT_CHECK(m < (std::size_t{1} << 29), "fewer than 2^29 balls");
  if (m == 0) return;
  const auto tree = std::make_shared<Tree>();
  std::vector<std::uint32_t> sorted;
  if (order == BallOrder::kAny) {
    sorted = coherent_order(centers);
  } else {
    sorted.resize(m);
    std::iota(sorted.begin(), sorted.end(), 0U);
  }
  tree->ball.resize(m);
  tree->id.resize(m);
  tree->slot.resize(m);
  parallel_for(m, [&](std::size_t begin, std::size_t end) {
    for (std::size_t slot = begin; slot < end; ++slot) {
      const std::uint32_t i = sorted[slot];
      tree->ball[slot] = {centers.x()[i], centers.y()[i], centers.z()[i], radii[i]};
      tree->id[slot] = static_cast<std::int32_t>(i);
      tree->slot[i] = static_cast<std::uint32_t>(slot);
    }
  });
  tree->build_nodes();
  tree_ = tree;
}

Region Region::with_radii(const std::vector<float>& radii) const {
  POINTWRIGHT_CHECK(radii.size() == size(), "one radius per ball");
  Region result;
  if (empty()) return result;
  const auto tree = std::make_shared<Tree>(*tree_);
  for (std::size_t slot = 0; slot < tree->ball.size(); ++slot) {
    tree->ball[slot].radius = radii[static_cast<std::size_t>(tree->id[slot])];
  }
  tree->build_nodes();
  result.tree_ = tree;
  return result;
}

std::size_t Region::size() const {
  return tree_ == nullptr ? 0 : tree_->ball.size();
}

Vec3f Region::center(std::size_t i) const {
  const Ball& ball = tree_->ball[tree_->slot[i]];
  return {ball.x, ball.y, ball.z};
}

float Region::radius(std::size_t i) const {
  return tree_->ball[tree_->slot[i]].radius;
}

RegionDistance Region::distance(const Vec3f& p, std::uint32_t& hint) const {
  POINTWRIGHT_CHECK(!empty(), "a region without balls has no distance");
  const BallTreeView& tree = tree_->view;
  float best = std::numeric_limits<float>::infinity();
  std::int32_t best_id = std::numeric_limits<std::int32_t>::max();
  std::size_t best_slot = 0;
  const auto visit_leaf = [&](std::size_t leaf) {
    const Range balls = children(leaf, kBallsPerLeaf, tree.ball_count);
    for (std::size_t slot = balls.begin; slot < balls.end; ++slot) {
      const float d = distance_to(tree.ball[slot], p).distance;
      if (d < best || (d == best && tree.id[slot] < best_id)) {
        best = d;
        best_id = tree.id[slot];
        best_slot = slot;
      }
    }
  };
  struct Visit {
    std::uint32_t level;
    std::uint32_t index;
    float bound;
  };
  std::array<Visit, std::size_t{kBallTreeMaxLevels} * kBallTreeFanout> stack;
  std::size_t depth = 0;
  stack[depth++] = {tree.level_count - 1, 0, 0.0F};
  visit_leaf(hint < tree.level_size[0] ? hint : 0);
  while (depth > 0 && best > 0.0F) {
    const Visit visit = stack[--depth];
    if (visit.bound > best) continue;
    if (visit.level == 0) {
      visit_leaf(visit.index);
      continue;
    }
    const std::uint32_t level = visit.level - 1;
    const Range nodes = children(visit.index, kBallTreeFanout, tree.level_size[level]);
    const std::size_t bottom = depth;
    for (std::size_t child = nodes.begin; child < nodes.end; ++child) {
      const float bound = bound_of(tree.node[tree.level_begin[level] + child], p);
      if (bound > best) continue;
      std::size_t place = depth++;  // the nearest child last: it is visited first
      for (; place > bottom && stack[place - 1].bound < bound; --place) stack[place] = stack[place - 1];
      stack[place] = {level, static_cast<std::uint32_t>(child), bound};
    }
  }
  hint = static_cast<std::uint32_t>(best_slot / kBallsPerLeaf);
  if (best <= 0.0F) return {};
  const BallDistance found = distance_to(tree.ball[best_slot], p);
  return {best, Vec3f(found.dx / found.length, found.dy / found.length, found.dz / found.length)};
}

void Region::distances(const Points& points, std::size_t begin, std::size_t end,
                       RegionDistances& result) const {
  POINTWRIGHT_CHECK(!empty(), "a region without balls has no distance");
  POINTWRIGHT_CHECK(begin % kSimdBlock == 0 && end <= points.size(), "a range that starts with a SIMD block");
  const std::size_t count = end - begin;
  result.distance.resize(padded_to_block(count));
  result.gradient.resize(count);
  const BallQueries queries{.x = points.x() + begin,
                            .y = points.y() + begin,
                            .z = points.z() + begin,
                            .distance = result.distance.data(),
                            .gradient_x = result.gradient.x(),
                            .gradient_y = result.gradient.y(),
                            .gradient_z = result.gradient.z()};
  POINTWRIGHT_KERNEL(query_balls)(tree_->view, queries, 0, padded_to_block(count));
}

namespace {

// The samples painted with one region.
struct Painted {
  std::vector<std::uint32_t> sample;
  Points position;
};

Painted collect(const Points& position, const Marks& marks, RegionKind kind) {
  Painted painted;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if ((marks[i] & static_cast<std::uint8_t>(kind)) != 0)
      painted.sample.push_back(static_cast<std::uint32_t>(i));
  }
  painted.position.resize(painted.sample.size());
  for (std::size_t m = 0; m < painted.sample.size(); ++m)
    painted.position.set(m, position[painted.sample[m]]);
  return painted;
}

Error intersection_error(const Vec3d& place, const char* how) {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), "%s at (%.9g, %.9g, %.9g)", how, place.x(), place.y(), place.z());
  return Error{.code = ErrorCode::kRegionsIntersect, .message = text.data(), .field = "regions"};
}

// Of every painted sample, the distance to the nearest sample of the other region.
std::vector<float> distances_to_other(const Points& position, const Region& other) {
  std::vector<float> result(position.size());
  parallel_for(position.size(), [&](std::size_t begin, std::size_t end) {
    RegionDistances block;
    other.distances(position, begin, end, block);
    std::copy_n(block.distance.begin(), end - begin, result.begin() + static_cast<std::ptrdiff_t>(begin));
  });
  return result;
}

Region point_set(const Painted& painted) {
  return Region(painted.position, std::vector<float>(painted.sample.size(), 0.0F), BallOrder::kCoherent);
}

std::vector<float> ball_radii(const Painted& painted, const std::vector<float>& spacing,
                              const std::vector<float>& distance_to_other) {
  std::vector<float> radii(painted.sample.size());
  for (std::size_t m = 0; m < radii.size(); ++m) {
    radii[m] = std::min(spacing[painted.sample[m]], distance_to_other[m] / 3.0F);
  }
  return radii;
}

}  // namespace

Result<RegionPair> regions_from_marks(const Points& level_position, const std::vector<float>& spacing,
                                      const Marks& marks, const Vec3d& origin) {
  POINTWRIGHT_CHECK(marks.size() == level_position.size(), "one mark per sample");
  POINTWRIGHT_CHECK(spacing.size() >= marks.size(), "one spacing per sample");
  constexpr auto kBoth =
      static_cast<std::uint8_t>(static_cast<int>(RegionKind::kZero) | static_cast<int>(RegionKind::kOne));
  const auto model_place = [&](std::size_t i) -> Vec3d { return origin + level_position[i].cast<double>(); };
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if ((marks[i] & kBoth) == kBoth) {
      return intersection_error(model_place(i), "a sample is painted with both the zero- and the one-region");
    }
  }
  const Painted zero = collect(level_position, marks, RegionKind::kZero);
  const Painted one = collect(level_position, marks, RegionKind::kOne);
  const auto empty_error = [](const char* field, const char* message) {
    return Error{.code = ErrorCode::kEmptyRegion, .message = message, .field = field};
  };
  if (zero.sample.empty()) return empty_error("zero", "no sample is painted with the zero-region");
  if (one.sample.empty()) return empty_error("one", "no sample is painted with the one-region");

  const Region zero_points = point_set(zero);
  const Region one_points = point_set(one);
  const std::vector<float> zero_to_one = distances_to_other(zero.position, one_points);
  const auto meeting = std::find(zero_to_one.begin(), zero_to_one.end(), 0.0F);
  if (meeting != zero_to_one.end()) {
    const auto m = static_cast<std::size_t>(meeting - zero_to_one.begin());
    return intersection_error(model_place(zero.sample[m]),
                              "samples of the zero- and the one-region coincide");
  }
  const std::vector<float> one_to_zero = distances_to_other(one.position, zero_points);
  return RegionPair{.zero = zero_points.with_radii(ball_radii(zero, spacing, zero_to_one)),
                    .one = one_points.with_radii(ball_radii(one, spacing, one_to_zero))};
}

}  // namespace pointwright
