#pragma once
// The Newton iterations of many samples together, over the cached graph of Q (§3.4).

#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/points.h"
#include "engine/core/vector.h"
#include "engine/multires/base_surface.h"
#include "engine/multires/decomposition.h"

namespace pointwright {

struct Plane {
  Vec3d point;
  Vec3d normal;
};

/// What one sample's iteration came to. Its base point is the projection of p onto the plane.
struct BasePoint {
  Plane plane;
  double residual = 0.0;  ///< length of the last step, model units
  std::uint32_t iterations = 0;
  bool converged = false;
};

/// Walks over Q for blocks of samples; one for each thread, which owns the working state.
class BasePointWalk {
 public:
  /// Pre: `base` outlives the walk and has samples.
  BasePointWalk(const BaseSurface& base, const DecomposeParams& params, float tolerance);

  /// Newton steps for the samples [begin, begin + start.size()), the first from sample start[i] of Q, each
  /// until it moves less than the tolerance or walk_limit is reached.
  /// Cost: O(iterations k) a sample; 64 bytes of state for a sample of the block
  void run(const Points& position, std::size_t begin, std::span<const std::uint32_t> start,
           std::span<BasePoint> found);

 private:
  void keep(std::size_t from, std::size_t to);

  const BaseSurface& base_;
  const DecomposeParams& params_;
  float tolerance_;
  std::vector<std::uint32_t> sample_;  // of each active one, in the block
  std::vector<std::uint32_t> q_;
  Points p_, r_, normal_, point_;
  std::vector<float> damping_, step_;
};

}  // namespace pointwright
