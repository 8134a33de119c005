#pragma once
// The deformation functions F(p, t) of §4, with the exact Jacobian of p -> F(p, t(p)).

#include <cstddef>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/shape_operator.h"

namespace pointwright {

/// Limits of what a deformation may hold.
inline constexpr double kMaxDeformationLength = 1e9;  ///< of a vector, and of the axis' point from zero
inline constexpr double kMaxDeformationAngle = 628.318530718;  ///< 100 turns, radians, either way
inline constexpr double kMaxDeformationFactor = 1e3;           ///< of a scale; the least is its inverse
inline constexpr std::size_t kMaxDeformationSteps = 8;

/// F_T(p, t) = p + t v.
struct Translation {
  Vec3d vector = Vec3d::Zero();  ///< model units

  friend bool operator==(const Translation&, const Translation&) = default;
};
/// F_T(p, t) = p + t distance n, n the unit normal of the edited level at p: embosses or carves.
struct NormalOffset {
  double distance = 0.0;  ///< model units; negative: inwards

  friend bool operator==(const NormalOffset&, const NormalOffset&) = default;
};
/// F_T(p, t) = p + t amount (target - p): toward a point of the user's, all the way with amount 1.
struct TowardPoint {
  Vec3d target = Vec3d::Zero();
  double amount = 0.0;  ///< in [-1000, 1]; negative: away from it

  friend bool operator==(const TowardPoint&, const TowardPoint&) = default;
};
/// F_R(p, t) = R(axis, t angle) (p - point) + point. Angles of any size; beyond a full turn they wind.
struct Rotation {
  Vec3d point = Vec3d::Zero();  ///< on the axis, model space
  Vec3d axis = Vec3d::UnitZ();  ///< direction, any length but 0
  double angle_rad = 0.0;       ///< at most 100 turns either way

  friend bool operator==(const Rotation&, const Rotation&) = default;
};
/// F_S(p, t) = center + (1 + t (factors - 1)) (p - center), for each model axis (beyond the paper).
struct Scaling {
  Vec3d center = Vec3d::Zero();
  Vec3d factors = Vec3d::Ones();  ///< each in [1/1000, 1000]

  friend bool operator==(const Scaling&, const Scaling&) = default;
};
/// Turns every point about the axis by t angle h / length, h its height over `point` along the axis (beyond
/// the paper). The plane through `point` stays.
struct Twist {
  Vec3d point = Vec3d::Zero();
  Vec3d axis = Vec3d::UnitZ();
  double angle_rad = 0.0;  ///< at most 100 turns either way
  double length = 1.0;     ///< model units, > 0: the height over which the surface turns by the angle

  friend bool operator==(const Twist&, const Twist&) = default;
};
using ElementaryDeformation = std::variant<Translation, NormalOffset, TowardPoint, Rotation, Scaling, Twist>;

/// One or several of them, one after the other, all with the t of the sample at rest.
struct Deformation {
  std::vector<ElementaryDeformation> steps;  ///< 1 to kMaxDeformationSteps; a NormalOffset only as the first

  Deformation() : steps{Translation{}} {}
  explicit Deformation(std::vector<ElementaryDeformation> all) : steps(std::move(all)) {}
  template <typename One,
            typename = std::enable_if_t<std::is_constructible_v<ElementaryDeformation, const One&>>>
  // NOLINTNEXTLINE(google-explicit-constructor): one is a composition of one
  Deformation(const One& one) : steps{one} {}

  friend bool operator==(const Deformation&, const Deformation&) = default;
};

/// Whether it moves the one-region as a rigid body: translations and rotations alone.
bool is_rigid(const Deformation& deformation);
/// The rotation that it turns the one-region by. Pre: is_rigid().
Mat3d whole_rotation(const Deformation& deformation);
/// Whether it needs the shape operators of the surface that it moves: a NormalOffset.
bool needs_shape_operators(const Deformation& deformation);

/// Errors: kNonFinite; kInvalidArgument (no or too many steps, zero axis, a number beyond its limit, a
/// NormalOffset after the first step). Fields: "deformation.vector", "deformation.angle_rad" and the like;
/// "deformation.steps[1].axis" in a composition of several.
Result<void> validate(const Deformation& deformation);

/// What F may need to know of the surface at a point.
struct LocalSurface {
  Vec3d normal = Vec3d::UnitZ();
  Mat3d shape_operator = Mat3d::Zero();  ///< dn/dp, symmetric, zero along the normal
};

/// F(p, t) of one point in model space, in double precision: the reference that tests compare against.
Vec3d deform_point(const Deformation& deformation, const Vec3d& p, double t,
                   const LocalSurface& surface = {});

/// The Jacobian dF/dp + dF/dt grad(t)^T of p -> F(p, t(p)) at one point, in double precision (reference).
Mat3d deformation_jacobian(const Deformation& deformation, const Vec3d& p, double t, const Vec3d& t_gradient,
                           const LocalSurface& surface = {});

/// Deforms samples and their normals: position' = F(position, t), normal' = cofactor(J) normal, normalised.
/// Samples with t = 0 keep their bits, and so do samples that F leaves in place (a zero vector, whole turns)
/// with a gradient that does not bend them. Where J folds the surface (the normal vanishes) the normal turns
/// with dF/dp; an offset beyond a focal point counts as one without curvature. A position is within 5e-7 of
/// deform_point, relative to its distance from the axis or centre and to its coordinates; a twist by n turns
/// within n times as much.
/// Shapes:      positions relative to `origin`; outputs are resized to N; outputs may not alias inputs
/// Pre:         a valid deformation, a field of N samples, finite input; N shape operators where it needs
///              them. Never gives NaN
/// Cost:        O(N), vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
void deform(const Deformation& deformation, const Vec3d& origin, const ScaleField& field, const Level& level,
            Level& deformed, const ShapeOperators* shape = nullptr);

}  // namespace pointwright
