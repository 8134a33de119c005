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
  std::size_t count = 0;
  std::vector<BallLeaf> leaf;
  std::vector<std::uint32_t> slot;  // leaf * kBallFanout + place of the ball with an id
  std::vector<BallNode> node;
  BallTreeView view{};

  void build_nodes();
};

namespace {

constexpr std::int32_t kNoBall = std::numeric_limits<std::int32_t>::max();

struct Bounds {
  Box3f box;
  float radius = std::numeric_limits<float>::quiet_NaN();

  void extend(const Bounds& other) {
    box.min = box.min.cwiseMin(other.box.min);
    box.max = box.max.cwiseMax(other.box.max);
    radius = std::isnan(radius) ? other.radius : std::max(radius, other.radius);
  }
};

Bounds bounds_of_leaf(const BallLeaf& leaf) {
  Bounds bounds;
  for (std::size_t b = 0; b < kBallFanout && leaf.id[b] != kNoBall; ++b) {
    const Vec3f center(leaf.x[b], leaf.y[b], leaf.z[b]);
    bounds.extend({.box = {.min = center, .max = center}, .radius = leaf.radius[b]});
  }
  return bounds;
}

Bounds bounds_of_node(const BallNode& node) {
  Bounds bounds;
  for (std::size_t c = 0; c < kBallFanout && !std::isnan(node.max_radius[c]); ++c) {
    bounds.extend({.box = {.min = Vec3f(node.min_x[c], node.min_y[c], node.min_z[c]),
                           .max = Vec3f(node.max_x[c], node.max_y[c], node.max_z[c])},
                   .radius = node.max_radius[c]});
  }
  return bounds;
}

void set_child(BallNode& node, std::size_t c, const Bounds& bounds) {
  node.min_x[c] = bounds.box.min.x();
  node.min_y[c] = bounds.box.min.y();
  node.min_z[c] = bounds.box.min.z();
  node.max_x[c] = bounds.box.max.x();
  node.max_y[c] = bounds.box.max.y();
  node.max_z[c] = bounds.box.max.z();
  node.max_radius[c] = bounds.radius;
}

// Nodes over `children` items, sixteen to a node, from the bounds of each; missing children have no bounds.
template <typename ChildBounds>
void fill_nodes(BallNode* nodes, std::size_t children, const ChildBounds& bounds_of_child) {
  const std::size_t count = (children + kBallFanout - 1) / kBallFanout;
  parallel_for(
      count,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin * kBallFanout; i < end * kBallFanout; ++i) {
          set_child(nodes[i / kBallFanout], i % kBallFanout, i < children ? bounds_of_child(i) : Bounds{});
        }
      },
      64);
}

BallLeaf empty_leaf() {
  BallLeaf leaf{};
  std::fill(std::begin(leaf.radius), std::end(leaf.radius), -std::numeric_limits<float>::infinity());
  std::fill(std::begin(leaf.id), std::end(leaf.id), kNoBall);
  return leaf;
}

}  // namespace

void Region::Tree::build_nodes() {
  view = {};
  std::size_t total = 0;
  for (std::size_t children = leaf.size();; children = (children + kBallFanout - 1) / kBallFanout) {
    POINTWRIGHT_CHECK(view.level_count < kBallTreeMaxLevels, "fewer than 2^29 balls");
    view.level_begin[view.level_count++] = static_cast<std::uint32_t>(total);
    total += (children + kBallFanout - 1) / kBallFanout;
    if (children <= kBallFanout) break;
  }
  node.resize(total);
  fill_nodes(node.data(), leaf.size(), [&](std::size_t i) { return bounds_of_leaf(leaf[i]); });
  for (std::size_t level = 1; level < view.level_count; ++level) {
    const BallNode* below = &node[view.level_begin[level - 1]];
    fill_nodes(&node[view.level_begin[level]], view.level_begin[level] - view.level_begin[level - 1],
               [&](std::size_t i) { return bounds_of_node(below[i]); });
  }
  view.leaf = leaf.data();
  view.node = node.data();
  view.leaf_count = static_cast<std::uint32_t>(leaf.size());
}

Region::Region(const Points& centers, const std::vector<float>& radii, BallOrder order) {
  const std::size_t m = centers.size();
  POINTWRIGHT_CHECK(radii.size() == m, "one radius per centre");
  POINTWRIGHT_CHECK(m < (std::size_t{1} << 29), "fewer than 2^29 balls");
  if (m == 0) return;
  const auto tree = std::make_shared<Tree>();
  std::vector<std::uint32_t> sorted;
  if (order == BallOrder::kAny) sorted = coherent_order(centers);
  tree->count = m;
  tree->leaf.assign((m + kBallFanout - 1) / kBallFanout, empty_leaf());
  tree->slot.resize(m);
  parallel_for(m, [&](std::size_t begin, std::size_t end) {
    for (std::size_t slot = begin; slot < end; ++slot) {
      const std::size_t i = sorted.empty() ? slot : sorted[slot];
      BallLeaf& leaf = tree->leaf[slot / kBallFanout];
      const std::size_t b = slot % kBallFanout;
      leaf.x[b] = centers.x()[i];
      leaf.y[b] = centers.y()[i];
      leaf.z[b] = centers.z()[i];
      leaf.radius[b] = radii[i];
      leaf.id[b] = static_cast<std::int32_t>(i);
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
  parallel_for(tree->count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      tree->leaf[tree->slot[i] / kBallFanout].radius[tree->slot[i] % kBallFanout] = radii[i];
    }
  });
  tree->build_nodes();
  result.tree_ = tree;
  return result;
}

std::size_t Region::size() const {
  return tree_ == nullptr ? 0 : tree_->count;
}

Vec3f Region::center(std::size_t i) const {
  const BallLeaf& leaf = tree_->leaf[tree_->slot[i] / kBallFanout];
  const std::size_t b = tree_->slot[i] % kBallFanout;
  return {leaf.x[b], leaf.y[b], leaf.z[b]};
}

float Region::radius(std::size_t i) const {
  return tree_->leaf[tree_->slot[i] / kBallFanout].radius[tree_->slot[i] % kBallFanout];
}

RegionDistance Region::distance(const Vec3f& p, std::uint32_t& hint) const {
  POINTWRIGHT_CHECK(!empty(), "a region without balls has no distance");
  std::array<float, 4> result{};
  POINTWRIGHT_KERNEL(query_ball)(tree_->view, p.data(), hint, result.data());
  return {result[0], Vec3f(result[1], result[2], result[3])};
}

void Region::distances(const Points& points, std::size_t begin, std::size_t end, RegionDistances& result,
                       const std::vector<float>* limits) const {
  POINTWRIGHT_CHECK(!empty(), "a region without balls has no distance");
  POINTWRIGHT_CHECK(begin % kSimdBlock == 0 && end <= points.size(), "a range that starts with a SIMD block");
  const std::size_t count = end - begin;
  POINTWRIGHT_CHECK(limits == nullptr || limits->size() >= padded_to_block(count), "one limit per point");
  result.distance.resize(padded_to_block(count));
  result.gradient.resize(count);
  const BallQueries queries{.x = points.x() + begin,
                            .y = points.y() + begin,
                            .z = points.z() + begin,
                            .limit = limits == nullptr ? nullptr : limits->data(),
                            .distance = result.distance.data(),
                            .gradient_x = result.gradient.x(),
                            .gradient_y = result.gradient.y(),
                            .gradient_z = result.gradient.z()};
  POINTWRIGHT_KERNEL(query_balls)(tree_->view, queries, padded_to_block(count));
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

// A ball's radius is at most this part of the distance to the nearest sample of the other region.
constexpr float kGapParts = 3.0F;

// Of every painted sample, the distance to the nearest sample of the other region, or the first distance that
// no longer bounds its radius.
std::vector<float> distances_to_other(const Painted& painted, const std::vector<float>& spacing,
                                      const Region& other) {
  std::vector<float> result(painted.sample.size());
  parallel_for(result.size(), [&](std::size_t begin, std::size_t end) {
    RegionDistances block;
    std::vector<float> limits(padded_to_block(end - begin), 0.0F);
    for (std::size_t m = begin; m < end; ++m)
      limits[m - begin] = kGapParts * spacing[painted.sample[m]] * 1.0001F;
    // Two samples at one place are found at any limit above 0.
    for (float& limit : limits) limit = std::max(limit, std::numeric_limits<float>::min());
    other.distances(painted.position, begin, end, block, &limits);
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
    radii[m] = std::min(spacing[painted.sample[m]], distance_to_other[m] / kGapParts);
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
  const std::vector<float> zero_to_one = distances_to_other(zero, spacing, one_points);
  const auto meeting = std::find(zero_to_one.begin(), zero_to_one.end(), 0.0F);
  if (meeting != zero_to_one.end()) {
    const auto m = static_cast<std::size_t>(meeting - zero_to_one.begin());
    return intersection_error(model_place(zero.sample[m]),
                              "samples of the zero- and the one-region coincide");
  }
  const std::vector<float> one_to_zero = distances_to_other(one, spacing, zero_points);
  return RegionPair{.zero = zero_points.with_radii(ball_radii(zero, spacing, zero_to_one)),
                    .one = one_points.with_radii(ball_radii(one, spacing, one_to_zero))};
}

}  // namespace pointwright
