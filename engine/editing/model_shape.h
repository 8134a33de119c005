#pragma once
// Regions given by another model: "zero- and one-regions can also be specified on a different model that can
// be arbitrarily aligned with P" (§4).

#include <cstddef>
#include <memory>
#include <string>

#include "engine/core/cloud.h"
#include "engine/core/result.h"
#include "engine/core/vector.h"
#include "engine/editing/shape_checks.h"

namespace pointwright {

/// All points within `thickness` of a sample of the cloud, once the matrix has moved it.
struct ModelShape {
  std::string source;                  ///< the caller's name of the cloud; nothing here reads it
  std::shared_ptr<const Cloud> cloud;  ///< null until it was found: nothing is painted with it then
  /// Affine, row after row: place = matrix * (sample, 1).
  ShapeMatrix matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  double thickness = 0.0;  ///< model units of the painted surface
};

/// Of everything but the cloud.
/// Errors: kNonFinite, kOutOfRange for numbers beyond 1e12; kInvalidArgument for a last row that is not
///         (0, 0, 0, 1), a singular matrix and a thickness that is not greater than 0. Fields "shape.matrix"
///         and "shape.thickness"
Result<void> validate_model_shape(const ModelShape& shape);

/// Whether the model-space point lies in the shape, in double precision. Cost: O(M) for M samples.
bool model_contains(const ModelShape& shape, const Vec3d& point);

/// Where the matrix moves sample i of the cloud.
Vec3d moved_sample(const ModelShape& shape, std::size_t i);

}  // namespace pointwright
