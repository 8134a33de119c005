#pragma once
// The surface at rest around a sample: what inserted samples stand on, and what their scalars come from.

#include <array>
#include <cstdint>
#include <vector>

#include "engine/core/points.h"
#include "engine/multires/surface.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Neighbours of a patch at most. With those of the graph alone (10 by default) relaxation misses some
/// neighbours of inserted samples.
inline constexpr std::uint32_t kRingSize = 16;

/// A quadratic jet through the sample, over its tangent plane: z = jx x + jy y + jxx x² + jxy x y + jyy y².
struct RestPatch {
  Vec3f center, u, v, normal;                   ///< the frame
  std::array<float, 5> jet{};                   ///< jx, jy, jxx, jxy, jyy
  std::uint32_t ring_size = 0;                  ///< neighbours
  std::array<std::uint32_t, kRingSize> ring{};  ///< nearest first, on the sample's side

  [[nodiscard]] Vec3f point(float x, float y) const {
    const float z = jet[0] * x + jet[1] * y + jet[2] * x * x + jet[3] * x * y + jet[4] * y * y;
    return center + x * u + y * v + z * normal;
  }
  /// The tangents d/dx and d/dy there.
  [[nodiscard]] Vec3f tangent_x(float x, float y) const {
    return u + (jet[0] + 2.0F * jet[2] * x + jet[3] * y) * normal;
  }
  [[nodiscard]] Vec3f tangent_y(float x, float y) const {
    return v + (jet[1] + jet[3] * x + 2.0F * jet[4] * y) * normal;
  }
};

/// The patch of sample i on a level. The jet is fitted to the ten nearest of its ring; where they do not
/// determine one (fewer than five, on a curve) it is the tangent plane.
/// Pre:  the graph of the same samples
/// Cost: O(k²)
RestPatch rest_patch(const Level& level, const NeighborGraph& graph, std::uint32_t i);

/// Patches of some samples of one level at rest, made when they are first asked for and kept: the frames of a
/// drag share them. Not thread-safe.
class RestPatches {
 public:
  /// The level and the graph must outlive the patches.
  RestPatches(const Level& level, const NeighborGraph& graph) : level_(&level), graph_(&graph) {}

  /// Makes those of `samples` that are missing, in parallel.
  void require(const std::vector<std::uint32_t>& samples);
  /// Pre: required before
  [[nodiscard]] const RestPatch& of(std::uint32_t sample) const { return patches_[number_[sample]]; }

 private:
  const Level* level_;
  const NeighborGraph* graph_;
  std::vector<std::uint32_t> number_;  // by sample; empty before the first one
  std::vector<RestPatch> patches_;
};

}  // namespace pointwright
