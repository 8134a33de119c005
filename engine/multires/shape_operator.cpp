#include "engine/multires/shape_operator.h"

#include <cmath>

#include "engine/core/parallel.h"

namespace pointwright {

ShapeOperators shape_operators(const Level& level, const NormalStencil& stencil,
                               const ExecutionContext* context) {
  ShapeOperators shape;
  const std::size_t padded = padded_to_block(level.normal.size());
  for (auto* column : {&shape.uu, &shape.uv, &shape.vv}) column->assign(padded, 0.0F);
  parallel_for(
      stencil.blocks().size(),
      [&](std::size_t begin, std::size_t end) {
        stencil.shape_operators(level.normal, shape.uu.data(), shape.uv.data(), shape.vv.data(), begin, end);
      },
      kParallelBlock / kSimdBlock, context);
  return shape;
}

TangentFrame tangent_frame(const Vec3d& n) {
  const double sign = std::copysign(1.0, n.z());
  const double a = -1.0 / (sign + n.z());
  const double b = n.x() * n.y() * a;
  return {.u = {1.0 + sign * n.x() * n.x() * a, sign * b, -sign * n.x()},
          .v = {b, sign + n.y() * n.y() * a, -n.y()}};
}

}  // namespace pointwright
