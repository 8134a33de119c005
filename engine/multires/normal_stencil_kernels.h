#pragma once
// Arguments of the kernels that carry normals along (engine/multires/normal_stencil.h). Blocks are those of
// the cloud, of kSimdBlock samples; `blocks` lists the ones that have a stencil, whose entries follow each
// other.

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Neighbours of a stencil at most.
inline constexpr std::uint32_t kStencilNeighbors = 8;

/// What the stencils of blocks consist of; row j of the weights belongs to neighbour j.
template <typename Weight, typename Number>
struct StencilOf {
  Weight* weight_u;  ///< [block][j][lane], in the lane's unit
  Weight* weight_v;
  Number* unit_u;  ///< [block][lane], 1 / length; 0 where neighbours span no plane
  Number* unit_v;
  Number* tilt_u;  ///< [block][lane]
  Number* tilt_v;
};
using StencilColumns = StencilOf<const std::int16_t, const float>;

struct BuildStencilArgs {
  const float* position[3];  ///< at rest, padded columns
  const float* normal[3];
  const std::uint32_t* neighbors;  ///< the blocked graph
  std::uint32_t graph_k;           ///< rows of its blocks
  std::uint32_t k;                 ///< those that count, kStencilNeighbors at most
  const std::uint32_t* blocks;
  StencilOf<std::int16_t, float> stencil;
};

struct CarryNormalsArgs {
  /// A sample that stands where it stood keeps its normal; with gains on the detail only where t = 0, or
  /// nowhere where there is no t.
  bool gains;
  const float* t;
  const float* rest_position[3];
  const float* rest_normal[3];
  const float* position[3];
  const float* rest_base_normal[3];  ///< of the next coarser level
  const float* base_normal[3];       ///< the same as it is now
  const std::uint32_t* neighbors;
  std::uint32_t graph_k;
  std::uint32_t k;
  const std::uint32_t* blocks;
  StencilColumns stencil;
  float* normal[3];
};

struct ShapeOperatorArgs {
  const float* normal[3];
  const std::uint32_t* neighbors;
  std::uint32_t graph_k;
  std::uint32_t k;
  const std::uint32_t* blocks;
  StencilColumns stencil;
  float* shape[3];  ///< uu, uv, vv
};

}  // namespace pointwright

/// Weights and tilts of blocks[begin] .. blocks[end - 1].
POINTWRIGHT_DECLARE_KERNEL(void build_stencil(const BuildStencilArgs& args, std::size_t begin,
                                              std::size_t end))
/// Normals of the samples of blocks[begin] .. blocks[end - 1].
POINTWRIGHT_DECLARE_KERNEL(void carry_normals(const CarryNormalsArgs& args, std::size_t begin,
                                              std::size_t end))
/// dn/dp of the samples of blocks[begin] .. blocks[end - 1], in the frames of their normals.
POINTWRIGHT_DECLARE_KERNEL(void shape_operators(const ShapeOperatorArgs& args, std::size_t begin,
                                                std::size_t end))
