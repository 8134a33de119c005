#pragma once
// Nearest-neighbour search. nanoflann stays behind this header.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

/// A neighbour found by a search.
struct Neighbor {
  std::uint32_t index = 0;
  float distance_sq = 0.0F;

  friend bool operator<(const Neighbor& a, const Neighbor& b) {
    return a.distance_sq != b.distance_sq ? a.distance_sq < b.distance_sq : a.index < b.index;
  }
};

/// A static kd-tree over a copy of the points. Queries are thread-safe.
/// Pre:  finite coordinates within 1e9 (beyond 1e19 float squares overflow and searches go wrong)
/// Cost: O(N log N) to build, about 20 bytes a point
class KdTree {
 public:
  explicit KdTree(const Points& points);
  /// Over a subset: indices in the answers are those of `points`, not of the subset.
  KdTree(const Points& points, std::vector<std::uint32_t> subset);
  ~KdTree();
  KdTree(KdTree&&) noexcept;
  KdTree& operator=(KdTree&&) noexcept;

  [[nodiscard]] std::size_t size() const;

  /// The k nearest points, by distance, then index; fewer where the tree holds fewer. `found` holds the
  /// answer.
  void nearest(const Vec3f& query, std::size_t k, std::vector<Neighbor>& found) const;

  /// The nearest one alone; the sooner, the nearer the point number `start` is to it.
  /// Pre: a tree of all points, not of a subset
  [[nodiscard]] std::uint32_t nearest_from(const Vec3f& query, std::uint32_t start) const;

  /// All points within `radius` (a distance, not its square), by distance, then index, but at most `limit` of
  /// them, the nearest; returns whether that limit cut the answer.
  bool within(const Vec3f& query, float radius, std::size_t limit, std::vector<Neighbor>& found) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace pointwright
