#include "engine/editing/model_shape.h"

namespace pointwright {

Result<void> validate_model_shape(const ModelShape& shape) {
  constexpr const char* kField = "shape.matrix";
  if (auto matrix = check_numbers(shape.matrix.data(), shape.matrix.size(), kField); !matrix) return matrix;
  const ShapeMatrix& m = shape.matrix;
  if (m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0)
    return shape_error(ErrorCode::kInvalidArgument, "the matrix must be affine: its last row is 0, 0, 0, 1",
                       kField);
  ShapeMatrix linear = m;
  linear[3] = linear[7] = linear[11] = 0.0;
  if (is_singular(linear))
    return shape_error(ErrorCode::kInvalidArgument, "the matrix must not be singular", kField);
  return check_lengths(&shape.thickness, 1, "shape.thickness");
}

bool model_contains(const ModelShape& shape, const Vec3d& point) {
  const std::size_t m = shape.cloud->size();
  for (std::size_t i = 0; i < m; ++i) {
    if ((point - moved_sample(shape, i)).squaredNorm() <= shape.thickness * shape.thickness) return true;
  }
  return false;
}

Vec3d moved_sample(const ModelShape& shape, std::size_t i) {
  const ShapeMatrix& m = shape.matrix;
  const Vec3d p = shape.cloud->origin + shape.cloud->position[i].cast<double>();
  return {m[0] * p.x() + m[1] * p.y() + m[2] * p.z() + m[3],
          m[4] * p.x() + m[5] * p.y() + m[6] * p.z() + m[7],
          m[8] * p.x() + m[9] * p.y() + m[10] * p.z() + m[11]};
}

}  // namespace pointwright
