#pragma once
// Normals that follow their neighbourhoods: how the normals of finer levels are carried through an edit.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/multires/normal_stencil_kernels.h"
#include "engine/multires/surface.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Of a level at rest: per sample the weights by which its neighbours' offsets regress to the two tangents
/// of the rest plane, and two tilts that put the rest normal back. Carrying a normal is then two weighted
/// sums and a cross product: it follows turns, spins and shear, and has no sign to choose.
class NormalStencil {
 public:
  /// Neighbours that count, the nearest ones of the graph.
  static constexpr std::uint32_t kNeighbors = kStencilNeighbors;

  NormalStencil() = default;
  /// blocks: those of kSimdBlock samples that will be carried, ascending.
  /// Pre:     `graph` is of the same samples and outlives the stencil
  /// Cost:    O(N k), vectorised, parallel; 4 k + 16 bytes a sample of the blocks
  /// Cancels: between blocks; the stencil is then incomplete and must be dropped
  NormalStencil(const Level& rest, const NeighborGraph& graph, std::vector<std::uint32_t> blocks,
                const ExecutionContext* context = nullptr);

  /// All blocks of a cloud of `count` samples.
  static std::vector<std::uint32_t> all_blocks(std::size_t count);

  [[nodiscard]] const std::vector<std::uint32_t>& blocks() const { return blocks_; }
  [[nodiscard]] std::size_t memory() const;

  /// One level as it stands now, above another one.
  struct Moved {
    const Level* rest;
    const Level* rest_base;  ///< the next coarser level
    const Points* base_normal;
    const Points* position;
    Points* normal;            ///< written
    bool gains = false;        ///< the detail below was scaled: neighbours count even where a sample stands
    const float* t = nullptr;  ///< with gains: samples with t = 0 keep their normals all the same
  };
  /// Normals of the samples of blocks()[begin] .. blocks()[end - 1]. A sample that stands where it stood,
  /// with the normal of its base unchanged, keeps its own to the bit (with gains where t = 0 alone); where
  /// the neighbours span no plane, the smallest rotation that the base's normal has made stands in.
  /// Cost:        O(k) a sample, sequential: callers cut the blocks into ranges
  /// Determinism: bitwise equal for any instruction set
  void carry(const Moved& moved, std::size_t begin, std::size_t end) const;

  /// dn/dp of the samples of those blocks, in the frames of their normals, into padded columns of N
  /// (engine/multires/shape_operator.h is the whole of it).
  void shape_operators(const Points& normal, float* uu, float* uv, float* vv, std::size_t begin,
                       std::size_t end) const;

 private:
  [[nodiscard]] StencilColumns columns() const;

  const NeighborGraph* graph_ = nullptr;
  std::uint32_t k_ = 0;
  std::vector<std::uint32_t> blocks_;
  std::vector<std::int16_t> weight_u_, weight_v_;
  std::vector<float> unit_u_, unit_v_, tilt_u_, tilt_v_;
};

}  // namespace pointwright
