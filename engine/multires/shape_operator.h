#pragma once
// How a level's normals turn from sample to sample.

#include <cstddef>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/multires/normal_stencil.h"

namespace pointwright {

/// dn/dp of N samples in the frame (u, v) that tangent_frame() gives for their normals: curvatures 1/R of a
/// sphere whose normals point outwards are positive. Symmetric: three columns, padded to whole SIMD blocks.
struct ShapeOperators {
  std::vector<float> uu, uv, vv;  ///< 1 / model unit

  [[nodiscard]] std::size_t size() const { return uu.size(); }
};

/// Regressed from the normals of the stencil's neighbours; 0 where they span no plane and outside of the
/// stencil's blocks.
/// Accuracy:    first order in the spacing
/// Cost:        O(N k), vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
ShapeOperators shape_operators(const Level& level, const NormalStencil& stencil,
                               const ExecutionContext* context = nullptr);

/// u and v of a unit normal, u x v = n (Duff et al., "Building an orthonormal basis, revisited", 2017).
struct TangentFrame {
  Vec3d u;
  Vec3d v;
};
TangentFrame tangent_frame(const Vec3d& normal);

}  // namespace pointwright
