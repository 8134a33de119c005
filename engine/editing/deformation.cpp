#include "engine/editing/deformation.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"
#include "engine/editing/shape.h"

namespace pointwright {
namespace {

Error non_finite(const char* field) {
  return Error{.code = ErrorCode::kNonFinite, .message = "the number must be finite", .field = field};
}

Result<void> check_length(const Vec3d& v, const char* field, const char* message) {
  if (!v.allFinite()) return non_finite(field);
  const double length = v.stableNorm();
  if (length <= kMaxDeformationLength) return {};
  return out_of_range(message, field, kMaxDeformationLength, length);
}

Result<void> check_point(const Vec3d& point, const char* field) {
  return check_length(point, field, "the point must lie within 1e9 of zero");
}

Result<void> check_axis(const Vec3d& axis) {
  if (!axis.allFinite()) return non_finite("axis");
  if (axis.cwiseAbs().maxCoeff() >= kMinDirectionLength) return {};
  return Error{.code = ErrorCode::kInvalidArgument, .message = "the axis must not be zero", .field = "axis"};
}

Result<void> check_angle(double angle_rad) {
  if (!std::isfinite(angle_rad)) return non_finite("angle_rad");
  if (std::abs(angle_rad) <= kMaxDeformationAngle) return {};
  return out_of_range("the angle must be at most 100 turns either way", "angle_rad", kMaxDeformationAngle,
                      angle_rad);
}

Result<void> validate_one(const Translation& translation) {
  return check_length(translation.vector, "vector", "the translation must be at most 1e9 long");
}

Result<void> validate_one(const NormalOffset& offset) {
  if (!std::isfinite(offset.distance)) return non_finite("distance");
  if (std::abs(offset.distance) <= kMaxDeformationLength) return {};
  return out_of_range("the distance must be at most 1e9 either way", "distance", kMaxDeformationLength,
                      offset.distance);
}

Result<void> validate_one(const TowardPoint& toward) {
  if (auto point = check_point(toward.target, "target"); !point) return point;
  if (!std::isfinite(toward.amount)) return non_finite("amount");
  if (toward.amount >= -kMaxDeformationFactor && toward.amount <= 1.0) return {};
  return out_of_range("the amount must lie between -1000 and 1", "amount",
                      toward.amount < 0.0 ? -kMaxDeformationFactor : 1.0, toward.amount);
}

Result<void> validate_one(const Rotation& rotation) {
  if (auto point = check_point(rotation.point, "point"); !point) return point;
  if (auto axis = check_axis(rotation.axis); !axis) return axis;
  return check_angle(rotation.angle_rad);
}

Result<void> validate_one(const Scaling& scaling) {
  if (auto center = check_point(scaling.center, "center"); !center) return center;
  if (!scaling.factors.allFinite()) return non_finite("factors");
  constexpr double kLeast = 1.0 / kMaxDeformationFactor;
  const double least = scaling.factors.minCoeff();
  const double greatest = scaling.factors.maxCoeff();
  if (least >= kLeast && greatest <= kMaxDeformationFactor) return {};
  const bool small = least < kLeast;
  return out_of_range("the factors must lie between 0.001 and 1000", "factors",
                      small ? kLeast : kMaxDeformationFactor, small ? least : greatest);
}

Result<void> validate_one(const Twist& twist) {
  if (auto point = check_point(twist.point, "point"); !point) return point;
  if (auto axis = check_axis(twist.axis); !axis) return axis;
  if (auto angle = check_angle(twist.angle_rad); !angle) return angle;
  if (!std::isfinite(twist.length)) return non_finite("length");
  constexpr double kLeastLength = 1.0 / kMaxDeformationLength;
  if (twist.length >= kLeastLength && twist.length <= kMaxDeformationLength) return {};
  return out_of_range("the length must lie between 1e-9 and 1e9", "length",
                      twist.length < kLeastLength ? kLeastLength : kMaxDeformationLength, twist.length);
}

Mat3d cross_matrix(const Vec3d& a) {
  Mat3d K;
  K << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return K;
}

// Rodrigues: R = I + sin K + (1 - cos) K^2.
Mat3d rotation_matrix(const Vec3d& axis, double angle) {
  const Mat3d K = cross_matrix(axis.stableNormalized());
  return Mat3d::Identity() + std::sin(angle) * K + (1.0 - std::cos(angle)) * K * K;
}

// An elementary deformation at q: where q goes, dF/dq and dF/dt.
struct LocalDeformation {
  Vec3d image;
  Mat3d jacobian;
  Vec3d velocity;
};

LocalDeformation scaled(const Vec3d& center, const Vec3d& factors, const Vec3d& q, double t) {
  const Vec3d velocity = (factors - Vec3d::Ones()).cwiseProduct(q - center);
  const Vec3d scale = Vec3d::Ones() + t * (factors - Vec3d::Ones());
  return {q + t * velocity, scale.asDiagonal(), velocity};
}

LocalDeformation local_at(const Translation& translation, const Vec3d& q, double t, const LocalSurface&) {
  return {q + t * translation.vector, Mat3d::Identity(), translation.vector};
}

LocalDeformation local_at(const NormalOffset& offset, const Vec3d& q, double t, const LocalSurface& surface) {
  const Vec3d velocity = offset.distance * surface.normal;
  return {q + t * velocity, Mat3d::Identity() + t * offset.distance * surface.shape_operator, velocity};
}

LocalDeformation local_at(const TowardPoint& toward, const Vec3d& q, double t, const LocalSurface&) {
  return scaled(toward.target, Vec3d::Constant(1.0 - toward.amount), q, t);
}

LocalDeformation local_at(const Rotation& rotation, const Vec3d& q, double t, const LocalSurface&) {
  const Mat3d R = rotation_matrix(rotation.axis, t * rotation.angle_rad);
  const Vec3d turned = R * (q - rotation.point);
  return {turned + rotation.point, R,
          rotation.angle_rad * (cross_matrix(rotation.axis.stableNormalized()) * turned)};
}

LocalDeformation local_at(const Scaling& scaling, const Vec3d& q, double t, const LocalSurface&) {
  return scaled(scaling.center, scaling.factors, q, t);
}

LocalDeformation local_at(const Twist& twist, const Vec3d& q, double t, const LocalSurface&) {
  const Vec3d axis = twist.axis.stableNormalized();
  const double rate = twist.angle_rad / twist.length;
  const double height = axis.dot(q - twist.point);
  const Mat3d R = rotation_matrix(axis, t * rate * height);
  const Vec3d turned = R * (q - twist.point);
  const Vec3d round_axis = rate * axis.cross(turned);  // of an angle of 1 per unit of height
  return {turned + twist.point, R + t * round_axis * axis.transpose(), height * round_axis};
}

LocalDeformation local_of(const ElementaryDeformation& one, const Vec3d& q, double t,
                          const LocalSurface& surface) {
  return std::visit([&](const auto& each) { return local_at(each, q, t, surface); }, one);
}

}  // namespace

bool is_rigid(const Deformation& deformation) {
  return std::all_of(deformation.steps.begin(), deformation.steps.end(), [](const auto& one) {
    return std::holds_alternative<Translation>(one) || std::holds_alternative<Rotation>(one);
  });
}

Mat3d whole_rotation(const Deformation& deformation) {
  Mat3d all = Mat3d::Identity();
  for (const ElementaryDeformation& one : deformation.steps) {
    if (const auto* rotation = std::get_if<Rotation>(&one))
      all = rotation_matrix(rotation->axis, rotation->angle_rad) * all;
  }
  // Whole turns come home to the bit.
  constexpr double kRounding = 1e-12;
  if ((all - Mat3d::Identity()).cwiseAbs().maxCoeff() < kRounding) all.setIdentity();
  return all;
}

bool needs_shape_operators(const Deformation& deformation) {
  return std::any_of(deformation.steps.begin(), deformation.steps.end(),
                     [](const auto& one) { return std::holds_alternative<NormalOffset>(one); });
}

Result<void> validate(const Deformation& deformation) {
  const std::size_t count = deformation.steps.size();
  if (count == 0 || count > kMaxDeformationSteps) {
    return out_of_range("a deformation has 1 to 8 steps", "deformation.steps",
                        count == 0 ? 1.0 : static_cast<double>(kMaxDeformationSteps),
                        static_cast<double>(count));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const ElementaryDeformation& one = deformation.steps[i];
    const std::string step = count == 1 ? "deformation" : "deformation.steps[" + std::to_string(i) + "]";
    if (i > 0 && std::holds_alternative<NormalOffset>(one)) {
      return Error{.code = ErrorCode::kInvalidArgument,
                   .message = "a step along the normal must be the first one",
                   .field = step + ".type"};
    }
    auto valid = std::visit([](const auto& each) { return validate_one(each); }, one);
    if (!valid) {
      Error error = valid.error();
      error.field = step + "." + error.field;
      return error;
    }
  }
  return {};
}

Vec3d deform_point(const Deformation& deformation, const Vec3d& p, double t, const LocalSurface& surface) {
  Vec3d q = p;
  for (const ElementaryDeformation& one : deformation.steps) q = local_of(one, q, t, surface).image;
  return q;
}

Mat3d deformation_jacobian(const Deformation& deformation, const Vec3d& p, double t, const Vec3d& t_gradient,
                           const LocalSurface& surface) {
  LocalDeformation all{p, Mat3d::Identity(), Vec3d::Zero()};
  for (const ElementaryDeformation& one : deformation.steps) {
    const LocalDeformation step = local_of(one, all.image, t, surface);
    all = {step.image, step.jacobian * all.jacobian, step.jacobian * all.velocity + step.velocity};
  }
  return all.jacobian + all.velocity * t_gradient.transpose();
}

void deform(const Deformation& deformation, const Vec3d& origin, const ScaleField& field, const Level& level,
            Level& deformed, const ShapeOperators* shape) {
  const std::size_t n = level.position.size();
  deformed.position.resize(n);
  deformed.normal.resize(n);
  const DeformMap map = to_deform_map(deformation, origin);
  const std::vector<std::uint32_t> blocks = NormalStencil::all_blocks(n);
  const DeformArgs args = deform_args(map, blocks, field, level, deformed, shape);
  const auto kernel = POINTWRIGHT_KERNEL(deform_samples);
  parallel_for(
      blocks.size(), [&](std::size_t begin, std::size_t end) { kernel(args, begin, end); },
      kParallelBlock / kSimdBlock);
}

}  // namespace pointwright
