#pragma once
// Deforming the edited level and carrying the finer ones along, in one pass over the samples
// (engine/editing/deformation.h, engine/editing/edit.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// A deformation in single precision, relative to the cloud's origin.
struct DeformMap {
  bool rotates;     ///< F_R, else F_T
  float vector[3];  ///< F_T: v
  float axis[3];    ///< F_R: unit direction
  float center[3];  ///< F_R: the axis' point nearest to the origin
  float angle;      ///< F_R: alpha in radians
  float
      quarter_turns;  ///< F_R: alpha / (pi / 2), and the same as a sum of three: two of 12 bits and the rest
  float quarter_high, quarter_middle, quarter_low;
};

/// The columns of one level, from the first sample of a call.
struct LevelColumns {
  const float* position[3];
  const float* normal[3];
  const float* detail;  ///< d along the next coarser level's normals; null for the edited level
  float* deformed_position[3];
  float* deformed_normal[3];
};

struct DeformJob {
  const DeformMap* map;
  const float* t;
  const float* gradient[3];
  const LevelColumns* level;  ///< the edited one first, then the finer ones
  std::size_t level_count;
};

}  // namespace pointwright

/// Samples [0, count) of the columns, count a multiple of 16.
POINTWRIGHT_DECLARE_KERNEL(void deform_levels(const DeformJob& job, std::size_t count))
