#pragma once
// The deformation functions F(p, t) of §4, with the exact Jacobian of p -> F(p, t(p)).

#include <variant>

#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/scale_field.h"

namespace pointwright {

/// Limits of what a deformation may hold.
inline constexpr double kMaxDeformationLength = 1e9;  ///< of a vector, and of the axis' point from zero
inline constexpr double kMaxDeformationAngle = 628.318530718;  ///< 100 turns, radians, either way

/// F_T(p, t) = p + t v.
struct Translation {
  Vec3d vector = Vec3d::Zero();  ///< model units

  friend bool operator==(const Translation&, const Translation&) = default;
};
/// F_R(p, t) = R(axis, t angle) (p - point) + point. Angles of any size; beyond a full turn they wind.
struct Rotation {
  Vec3d point = Vec3d::Zero();  ///< on the axis, model space
  Vec3d axis = Vec3d::UnitZ();  ///< direction, any length but 0
  double angle_rad = 0.0;       ///< at most 100 turns either way

  friend bool operator==(const Rotation&, const Rotation&) = default;
};
using Deformation = std::variant<Translation, Rotation>;

/// Errors: kNonFinite; kInvalidArgument (zero axis, length or angle beyond its limit).
/// Fields: "deformation.vector", "deformation.point", "deformation.axis", "deformation.angle_rad".
Result<void> validate(const Deformation& deformation);

/// F(p, t) of one point in model space, in double precision: the reference that tests compare against.
Vec3d deform_point(const Deformation& deformation, const Vec3d& p, double t);

/// The Jacobian dF/dp + dF/dt grad(t)^T of p -> F(p, t(p)) at one point, in double precision (reference).
Mat3d deformation_jacobian(const Deformation& deformation, const Vec3d& p, double t, const Vec3d& t_gradient);

/// Deforms samples and their normals: position' = F(position, t), normal' = cofactor(J) normal, normalised.
/// Samples with t = 0 keep their bits, and so do samples that F leaves in place (a zero vector, whole turns)
/// with a gradient that does not bend them. Where J folds the surface (the normal vanishes) the normal turns
/// with dF/dp. A position is within 5e-7 of deform_point, relative to its distance from the axis and to its
/// coordinates.
/// Shapes:      positions relative to `origin`; outputs are resized to N; outputs may not alias inputs
/// Pre:         a valid deformation, a field of N samples, finite input. Never gives NaN
/// Cost:        O(N), vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
void deform(const Deformation& deformation, const Vec3d& origin, const ScaleField& field,
            const Points& position, const Points& normal, Points& deformed_position, Points& deformed_normal);

}  // namespace pointwright
