// kd-tree by nanoflann (Blanco, Rai: "nanoflann: a C++ header-only fork of FLANN", 2014).
#include "engine/spatial/kd_tree.h"

#include <algorithm>
#include <limits>
#include <nanoflann.hpp>

#include "engine/core/check.h"

namespace pointwright {
namespace {

// Packed x y z: one cache line serves the three coordinates of a point that the tree looks at.
struct PackedPoints {
  std::vector<float> xyz;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return xyz.size() / 3; }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const { return xyz[3 * i + axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PackedPoints>,
                                                  PackedPoints, 3, std::uint32_t>;
constexpr std::size_t kLeafSize = 12;

// What to search below so that no point at this squared distance is missed: nanoflann looks at what is nearer
// than the bound only, and adds up the distances to its boxes on the way down, with an error of a rounding a
// level.
float search_bound(float distance_sq) {
  constexpr float kSlack = 1.00001F;
  return distance_sq * kSlack + std::numeric_limits<float>::min();
}

// The nearest points so far, by distance, then index. nanoflann's own set keeps whichever of the points at
// the last distance it meets first.
class NearestSet {
 public:
  using DistanceType = float;

  NearestSet(std::vector<Neighbor>& slots, const std::vector<std::uint32_t>& subset)
      : slots_(slots), subset_(subset) {}

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] bool full() const { return count_ == slots_.size(); }
  // nanoflann calls this and worstDist().
  // NOLINTNEXTLINE(readability-identifier-naming)
  bool addPoint(float distance_sq, std::uint32_t i) {
    const Neighbor candidate{subset_.empty() ? i : subset_[i], distance_sq};
    if (full() && !(candidate < slots_[count_ - 1])) return true;
    std::size_t at = full() ? count_ - 1 : count_++;
    for (; at > 0 && candidate < slots_[at - 1]; --at) slots_[at] = slots_[at - 1];
    slots_[at] = candidate;
    if (full()) bound_ = search_bound(slots_[count_ - 1].distance_sq);
    return true;
  }
  // Ties with the last one must come in, too.
  // NOLINTNEXTLINE(readability-identifier-naming)
  [[nodiscard]] float worstDist() const { return bound_; }

 private:
  std::vector<Neighbor>& slots_;
  const std::vector<std::uint32_t>& subset_;
  std::size_t count_ = 0;
  float bound_ = std::numeric_limits<float>::infinity();
};

// The same for a single one, which some point is known to be no farther than.
class NearestOne {
 public:
  using DistanceType = float;

  explicit NearestOne(const Neighbor& start) : nearest_(start), bound_(search_bound(start.distance_sq)) {}

  [[nodiscard]] std::uint32_t index() const { return nearest_.index; }
  [[nodiscard]] std::size_t size() const { return 1; }
  [[nodiscard]] bool full() const { return true; }
  // NOLINTNEXTLINE(readability-identifier-naming)
  bool addPoint(float distance_sq, std::uint32_t i) {
    const Neighbor candidate{i, distance_sq};
    if (!(candidate < nearest_)) return true;
    nearest_ = candidate;
    bound_ = search_bound(distance_sq);
    return true;
  }
  // NOLINTNEXTLINE(readability-identifier-naming)
  [[nodiscard]] float worstDist() const { return bound_; }

 private:
  Neighbor nearest_;
  float bound_;
};

}  // namespace

struct KdTree::Tree {
  Tree(const Points& points, bool whole, std::vector<std::uint32_t> chosen) : subset(std::move(chosen)) {
    const std::size_t n = whole ? points.size() : subset.size();
    packed.xyz.resize(3 * n);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t from = whole ? i : subset[i];
      packed.xyz[3 * i] = points.x()[from];
      packed.xyz[3 * i + 1] = points.y()[from];
      packed.xyz[3 * i + 2] = points.z()[from];
    }
    if (n > 0)
      index = std::make_unique<Index>(3, packed, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize));
  }
  [[nodiscard]] std::uint32_t original(std::uint32_t i) const { return subset.empty() ? i : subset[i]; }

  PackedPoints packed;
  std::vector<std::uint32_t> subset;  // empty: all points, or none at all
  std::unique_ptr<Index> index;
};

KdTree::KdTree(const Points& points)
    : tree_(std::make_unique<Tree>(points, true, std::vector<std::uint32_t>{})) {}
KdTree::KdTree(const Points& points, std::vector<std::uint32_t> subset)
    : tree_(std::make_unique<Tree>(points, false, std::move(subset))) {}
KdTree::~KdTree() = default;
KdTree::KdTree(KdTree&&) noexcept = default;
KdTree& KdTree::operator=(KdTree&&) noexcept = default;

std::size_t KdTree::size() const {
  return tree_->packed.kdtree_get_point_count();
}

void KdTree::nearest(const Vec3f& query, std::size_t k, std::vector<Neighbor>& found) const {
  found.resize(std::min(k, size()));
  if (found.empty()) return;
  NearestSet nearest(found, tree_->subset);
  tree_->index->findNeighbors(nearest, query.data(), nanoflann::SearchParams());
}

std::uint32_t KdTree::nearest_from(const Vec3f& query, std::uint32_t start) const {
  POINTWRIGHT_CHECK(start < size() && tree_->subset.empty(), "a point of a tree of all points");
  NearestOne nearest({start, tree_->index->distance.evalMetric(query.data(), start, 3)});
  tree_->index->findNeighbors(nearest, query.data(), nanoflann::SearchParams());
  return nearest.index();
}

bool KdTree::within(const Vec3f& query, float radius, std::size_t limit, std::vector<Neighbor>& found) const {
  found.clear();
  if (size() == 0 || !(radius >= 0.0F)) return false;
  std::vector<std::pair<std::uint32_t, float>> hits;
  const float radius_sq = radius * radius;
  tree_->index->radiusSearch(query.data(), search_bound(radius_sq), hits,
                             nanoflann::SearchParams(32, 0.0F, false));
  found.reserve(hits.size());
  for (const auto& [index, distance_sq] : hits) {
    if (distance_sq <= radius_sq) found.push_back({tree_->original(index), distance_sq});
  }
  std::sort(found.begin(), found.end());
  const bool cut = found.size() > limit;
  if (cut) found.resize(limit);
  return cut;
}

}  // namespace pointwright
