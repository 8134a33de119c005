#pragma once
// Deforming a level, and putting the detail of the next finer one over it (engine/editing/deformation.h,
// engine/editing/edit.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Elementary deformations of a composition at most: kMaxDeformationSteps.
inline constexpr std::size_t kDeformMapSteps = 8;

enum class DeformKind : std::int32_t { kTranslate, kAlongNormal, kScale, kTurn, kTwist };

/// An elementary deformation in single precision, relative to the cloud's origin.
struct DeformStep {
  DeformKind kind;
  float vector[3];  ///< kTranslate: v; kScale: factors - 1; kAlongNormal: the distance, first
  float axis[3];    ///< kTurn, kTwist: unit direction
  float center[3];  ///< kScale; kTurn: the axis' point nearest to the origin; kTwist: the point that stays
  float rate;       ///< kTurn: alpha in radians; kTwist: radians per model unit
  /// The rate in quarter turns, and the same as a sum of three: two of 12 bits and the rest.
  float quarter_turns;
  float quarter_high, quarter_middle, quarter_low;
};

/// One after the other.
struct DeformMap {
  DeformStep step[kDeformMapSteps];
  std::size_t step_count;
};

/// Columns of all samples; `blocks` lists those of kSimdBlock samples that are worked on.
struct DeformArgs {
  const DeformMap* map;
  const std::uint32_t* blocks;
  const float* t;
  const float* gradient[3];
  const float* shape[3];  ///< uu, uv, vv of the shape operators; null where no step goes along the normal
  const float* position[3];
  const float* normal[3];
  float* deformed_position[3];
  float* deformed_normal[3];
};

/// Two tangent vectors of each sample, and where the Jacobian takes them (Eq. 13). Columns of all samples, as
/// in DeformArgs, whose normals are read and not written.
struct CellArgs {
  DeformArgs deform;
  const float* cell_u[3];
  const float* cell_v[3];
  float* mapped_u[3];
  float* mapped_v[3];
};

/// A level that has moved, and the next finer one.
struct RaiseArgs {
  const std::uint32_t* blocks;
  const float* t;
  float gain;  ///< of the band between, where t = 1
  const float* rest_base_position[3];
  const float* rest_base_normal[3];
  const float* base_position[3];
  const float* base_normal[3];
  const float* rest_position[3];
  const float* rest_detail;  ///< N entries, not padded
  float* position[3];
  float* detail;
  /// The block that the detail columns end within, and padded columns of it alone; its results go there.
  std::uint32_t last_block;
  const float* last_rest_detail;
  float* last_detail;
};

/// A rotation of the normals of those samples that move as one rigid body: t = 1 without a gradient.
struct TurnArgs {
  const std::uint32_t* blocks;
  const std::uint8_t* any_whole;  ///< by entry, whether a sample of the block is one; null: of all blocks
  const float* t;
  const float* gradient[3];
  float rotation[9];  ///< by rows
  bool is_identity;   ///< normals keep their bits
  const float* rest_normal[3];
  float* normal[3];
};

}  // namespace pointwright

/// Positions and normals of the samples of blocks[begin] .. blocks[end - 1].
POINTWRIGHT_DECLARE_KERNEL(void deform_samples(const DeformArgs& args, std::size_t begin, std::size_t end))
/// Positions, J u and J v of the samples of blocks[begin] .. blocks[end - 1]; where t = 0 all stay as they
/// are. Of an offset along the normal J is that of the offset surface, folded or not.
POINTWRIGHT_DECLARE_KERNEL(void deform_cells(const CellArgs& args, std::size_t begin, std::size_t end))
/// Eq. (5) as a difference: p' = p + (r' - r) + d (g n' - n), g = 1 + t (gain - 1), and d' = g d.
POINTWRIGHT_DECLARE_KERNEL(void raise_level(const RaiseArgs& args, std::size_t begin, std::size_t end))
/// Normals of the samples of blocks[begin] .. blocks[end - 1] that move rigidly; the others are left alone.
POINTWRIGHT_DECLARE_KERNEL(void turn_normals(const TurnArgs& args, std::size_t begin, std::size_t end))
