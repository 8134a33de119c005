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

/// Distances of many points; columns padded to whole SIMD blocks with finite values.
struct RegionDistances {
  std::vector<float> distance;
  Points gradient;
};

/// The order in which a region's balls are given.
enum class BallOrder {
  kAny,
  kCoherent,  ///< neighbours in space are neighbours in the list: nothing is sorted; a wrong claim costs time
};

/// A union of balls with exact distance queries. Immutable once built; queries are thread-safe.
class Region {
 public:
  Region() = default;
  /// Shapes: M < 2^29 finite centres (relative to the cloud's origin) and M finite radii >= 0
  /// Cost:   O(M log M), O(M) for coherent balls
  Region(const Points& centers, const std::vector<float>& radii, BallOrder order = BallOrder::kAny);

  /// The same centres with other radii, one for each ball in the caller's order. Cost: O(M).
  [[nodiscard]] Region with_radii(const std::vector<float>& radii) const;

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] Vec3f center(std::size_t i) const;
  [[nodiscard]] float radius(std::size_t i) const;

  /// Eq. (11): the least of max(0, |p - c_i| - r_i), exactly, and its gradient. Ties go to the lower ball
  /// index. `hint` speeds up coherent queries: pass the same variable (starting at 0) along a coherent order;
  /// it never changes the result.
  /// Pre:  not empty, p finite
  /// Cost: O(log M) typical
  [[nodiscard]] RegionDistance distance(const Vec3f& p, std::uint32_t& hint) const;

  /// The same for points[begin, end), several times faster: result i - begin is that of point i, bitwise that
  /// of distance(). `limits`, where given, holds a limit >= 0 for each (padded to whole SIMD blocks): a point
  /// at least that far gets the limit as its distance and, where farther, no gradient. Low limits are cheap.
  /// Pre:  not empty, finite points (padding included), begin a multiple of kSimdBlock
  /// Cost: O(log M) for each 128 coherent points that lie far from the balls, and for each dozen nearby;
  ///       sequential: callers cut coherent points into blocks
  void distances(const Points& points, std::size_t begin, std::size_t end, RegionDistances& result,
                 const std::vector<float>* limits = nullptr) const;

 private:
  struct Tree;
  std::shared_ptr<const Tree> tree_;
};

/// The zero- and the one-region of one edit.
struct RegionPair {
  Region zero;
  Region one;
};

/// Balls around the painted samples, standing where the samples stand on the edited level. A ball's radius is
/// the sample's local spacing, but at most a third of the distance to the nearest sample of the other region:
/// neighbouring balls of the two regions never touch, and a third is left for t to pass from 0 to 1.
/// Shapes:      N positions (coherent order is fast, any order is right), N spacings >= 0, N marks
/// Errors:      kEmptyRegion (field "zero" or "one"); kRegionsIntersect with the place, where a sample is in
///              both or two samples of different regions coincide
/// Cost:        O(N + M log M), parallel
/// Determinism: bitwise equal for any thread count
Result<RegionPair> regions_from_marks(const Points& level_position, const std::vector<float>& spacing,
                                      const Marks& marks, const Vec3d& origin);

}  // namespace pointwright
