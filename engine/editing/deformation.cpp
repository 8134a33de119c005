#include "engine/editing/deformation.h"

#include <array>
#include <cmath>
#include <numbers>

#include "engine/core/check.h"
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
  return Error{.code = ErrorCode::kInvalidArgument,
               .message = message,
               .field = field,
               .limit = kMaxDeformationLength,
               .actual = length};
}

Result<void> validate_one(const Translation& translation) {
  return check_length(translation.vector, "deformation.vector", "the translation must be at most 1e9 long");
}

Result<void> validate_one(const Rotation& rotation) {
  auto point =
      check_length(rotation.point, "deformation.point", "the axis' point must lie within 1e9 of zero");
  if (!point) return point;
  if (!rotation.axis.allFinite()) return non_finite("deformation.axis");
  if (rotation.axis.cwiseAbs().maxCoeff() < kMinDirectionLength) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the rotation axis must not be zero",
                 .field = "deformation.axis"};
  }
  if (!std::isfinite(rotation.angle_rad)) return non_finite("deformation.angle_rad");
  if (std::abs(rotation.angle_rad) > kMaxDeformationAngle) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the angle must be at most 100 turns either way",
                 .field = "deformation.angle_rad",
                 .limit = kMaxDeformationAngle,
                 .actual = rotation.angle_rad};
  }
  return {};
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

// The leading 12 bits of v, as a float.
float leading_bits(double v) {
  int exponent = 0;
  const double fraction = std::frexp(v, &exponent);
  return static_cast<float>(std::ldexp(std::trunc(std::ldexp(fraction, 12)), exponent - 12));
}

}  // namespace

Result<void> validate(const Deformation& deformation) {
  return std::visit([](const auto& one) { return validate_one(one); }, deformation);
}

Vec3d deform_point(const Deformation& deformation, const Vec3d& p, double t) {
  if (const auto* translation = std::get_if<Translation>(&deformation)) return p + t * translation->vector;
  const auto& rotation = std::get<Rotation>(deformation);
  return rotation_matrix(rotation.axis, t * rotation.angle_rad) * (p - rotation.point) + rotation.point;
}

Mat3d deformation_jacobian(const Deformation& deformation, const Vec3d& p, double t,
                           const Vec3d& t_gradient) {
  if (const auto* translation = std::get_if<Translation>(&deformation)) {
    return Mat3d::Identity() + translation->vector * t_gradient.transpose();
  }
  const auto& rotation = std::get<Rotation>(deformation);
  const Mat3d R = rotation_matrix(rotation.axis, t * rotation.angle_rad);
  const Vec3d turned = R * (p - rotation.point);
  const Vec3d velocity =
      rotation.angle_rad * (cross_matrix(rotation.axis.stableNormalized()) * turned);  // dF/dt
  return R + velocity * t_gradient.transpose();
}

DeformMap to_deform_map(const Deformation& deformation, const Vec3d& origin) {
  DeformMap map{};
  const auto assign = [](float* to, const Vec3d& from) {
    for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(from[c]);
  };
  if (const auto* translation = std::get_if<Translation>(&deformation)) {
    assign(map.vector, translation->vector);
    return map;
  }
  const auto& rotation = std::get<Rotation>(deformation);
  const Vec3d axis = rotation.axis.stableNormalized();
  const Vec3d point = rotation.point - origin;
  map.rotates = true;
  assign(map.axis, axis);
  assign(map.center, point - axis * axis.dot(point));
  const double quarters = rotation.angle_rad / (std::numbers::pi / 2.0);
  map.angle = static_cast<float>(rotation.angle_rad);
  map.quarter_turns = static_cast<float>(quarters);
  map.quarter_high = leading_bits(quarters);
  map.quarter_middle = leading_bits(quarters - double{map.quarter_high});
  map.quarter_low = static_cast<float>(quarters - double{map.quarter_high} - double{map.quarter_middle});
  return map;
}

void deform(const Deformation& deformation, const Vec3d& origin, const ScaleField& field,
            const Points& position, const Points& normal, Points& deformed_position,
            Points& deformed_normal) {
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(normal.size() == n, "one normal per sample");
  POINTWRIGHT_CHECK(field.size() == n && field.t.size() >= padded_to_block(n), "a field of the same samples");
  deformed_position.resize(n);
  deformed_normal.resize(n);
  const DeformMap map = to_deform_map(deformation, origin);
  const auto kernel = POINTWRIGHT_KERNEL(deform_levels);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    const LevelColumns level{
        .position = {position.x() + begin, position.y() + begin, position.z() + begin},
        .normal = {normal.x() + begin, normal.y() + begin, normal.z() + begin},
        .detail = nullptr,
        .deformed_position = {deformed_position.x() + begin, deformed_position.y() + begin,
                              deformed_position.z() + begin},
        .deformed_normal = {deformed_normal.x() + begin, deformed_normal.y() + begin,
                            deformed_normal.z() + begin}};
    kernel(DeformJob{.map = &map,
                     .t = field.t.data() + begin,
                     .gradient = {field.gradient.x() + begin, field.gradient.y() + begin,
                                  field.gradient.z() + begin},
                     .level = &level,
                     .level_count = 1},
           padded_to_block(end - begin));
  });
}

}  // namespace pointwright
