#pragma once
// A region as a volume, independent of any sampling: the union of balls around painted samples (§4, Eq. 11).

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/painting.h"

namespace pointwright {

/// The distance of a point to a region, and where it comes from.
struct RegionDistance {
  float distance = 0.0F;           ///< d_j of Eq. (11): 0 inside
  Vec3f gradient = Vec3f::Zero();  ///< of the distance; 0 inside
};

/// A union of balls with exact distance queries. Immutable once built; queries are thread-safe.
class Region {
 public:
  Region() = default;
  /// Shapes: M centres (relative to the cloud's origin) and M radii >= 0. Cost: O(M log M).
  Region(const Points& centers, const std::vector<float>& radii);

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] Vec3f center(std::size_t i) const;
  [[nodiscard]] float radius(std::size_t i) const;

  /// Eq. (11): the least of max(0, |p - c_i| - r_i), exactly, and its gradient. Ties go to the lower ball index.
  /// `hint` speeds up coherent queries: pass the same variable (starting at 0) along a coherent order; it never
  /// changes the result. Pre: not empty. Cost: O(log M) typical.
  [[nodiscard]] RegionDistance distance(const Vec3f& p, std::uint32_t& hint) const;

 private:
  struct Tree;
  std::shared_ptr<const Tree> tree_;
};

/// The zero- and the one-region of one edit.
struct RegionPair {
  Region zero;
  Region one;
};

/// Balls around the painted samples, standing where the samples stand on the edited level. A ball's radius is the
/// sample's local spacing, but at most half the distance to the nearest sample of the other region, so neighbouring
/// balls of the two regions never overlap.
/// Errors: kEmptyRegion (field "zero" or "one"); kRegionsIntersect with the place, where a sample is in both or two
///         samples of different regions coincide
/// Cost:   O(N + M log M)
Result<RegionPair> regions_from_marks(const Points& level_position, const std::vector<float>& spacing,
                                      const Marks& marks, const Vec3d& origin);

}  // namespace pointwright
