#pragma once
// Arguments of the kernel that takes Newton steps toward base points (engine/multires/decomposition.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Samples of Q that a plane is fitted to at most: one and its cached neighbours.
inline constexpr std::uint32_t kMaxPlaneCandidates = 25;

/// Padded columns. Places are relative to the sample p that is projected.
struct BasePointKernelArgs {
  const float* base[3];  ///< Q's positions, unit normals and blocked graph, [block][j][lane]
  const float* base_normal[3];
  const std::uint32_t* neighbors;
  std::uint32_t k;                ///< cached neighbours, at most kMaxPlaneCandidates - 1
  std::uint32_t plane_neighbors;  ///< weights vanish at the first candidate beyond this many nearest
  float inverse_sigma_sq;         ///< of the Gaussian weights; 0: compact ones
  bool adaptive;                  ///< damping: adaptive, or what `damping` says

  const float* p[3];
  std::uint32_t* q;  ///< in and out: the sample of Q to walk from, then the nearest that the walk found
  float* r[3];       ///< in and out: the estimate of the base point
  float* normal[3];  ///< in and out: the last plane's unit normal, then the new one's
  float* point[3];   ///< in and out: a point of that plane
  float* damping;    ///< in and out
  float* step;       ///< in and out: length of the last undamped step, then of this one
};

}  // namespace pointwright

/// One Newton step of the samples [begin, end), begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void base_point_step(const BasePointKernelArgs& args, std::size_t begin,
                                                std::size_t end))
