#pragma once
// The deformation functions F(p, t) of §4, with the exact Jacobian of p -> F(p, t(p)).

#include <variant>

#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/scale_field.h"

namespace pointwright {

/// F_T(p, t) = p + t v.
struct Translation {
  Vec3d vector = Vec3d::Zero();  ///< model units
};
/// F_R(p, t) = R(axis, t angle) (p - point) + point. Angles of any size; beyond a full turn they wind.
struct Rotation {
  Vec3d point = Vec3d::Zero();  ///< on the axis, model space
  Vec3d axis = Vec3d::UnitZ();  ///< direction, any length but 0
  double angle_rad = 0.0;       ///< at most 100 turns either way
};
using Deformation = std::variant<Translation, Rotation>;

/// Errors: kNonFinite, kInvalidArgument (zero axis, angle or length beyond its limit), with the field.
Result<void> validate(const Deformation& deformation);

/// F(p, t) of one point in model space, in double precision: the reference that tests compare against.
Vec3d deform_point(const Deformation& deformation, const Vec3d& p, double t);

/// The Jacobian dF/dp + dF/dt grad(t)^T of p -> F(p, t(p)) at one point, in double precision (reference).
Mat3d deformation_jacobian(const Deformation& deformation, const Vec3d& p, double t, const Vec3d& t_gradient);

/// Deforms all samples and their normals: position' = F(position, t), normal' = cofactor(J) normal, normalised.
/// Samples with t = 0 keep their bits. Where J folds the surface (the normal vanishes) the normal turns with dF/dp.
/// Shapes:      positions relative to `origin`; outputs are resized to N; outputs may not alias inputs
/// Cost:        O(N), vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
void deform(const Deformation& deformation, const Vec3d& origin, const ScaleField& field, const Points& position,
            const Points& normal, Points& deformed_position, Points& deformed_normal);

}  // namespace pointwright
