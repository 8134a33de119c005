#include "engine/editing/deformation_map.h"

#include <cmath>
#include <numbers>

#include "engine/core/check.h"

namespace pointwright {
namespace {

static_assert(kDeformMapSteps == kMaxDeformationSteps);

void assign(float (&to)[3], const Vec3d& from) {
  for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(from[c]);
}

// The leading 12 bits of v, as a float.
float leading_bits(double v) {
  int exponent = 0;
  const double fraction = std::frexp(v, &exponent);
  return static_cast<float>(std::ldexp(std::trunc(std::ldexp(fraction, 12)), exponent - 12));
}

void assign_rate(DeformStep& step, double radians) {
  const double quarters = radians / (std::numbers::pi / 2.0);
  step.rate = static_cast<float>(radians);
  step.quarter_turns = static_cast<float>(quarters);
  step.quarter_high = leading_bits(quarters);
  step.quarter_middle = leading_bits(quarters - double{step.quarter_high});
  step.quarter_low = static_cast<float>(quarters - double{step.quarter_high} - double{step.quarter_middle});
}

DeformStep scale_step(const Vec3d& center, const Vec3d& factors, const Vec3d& origin) {
  DeformStep step{.kind = DeformKind::kScale};
  assign(step.vector, factors - Vec3d::Ones());
  assign(step.center, center - origin);
  return step;
}

DeformStep to_step(const Translation& translation, const Vec3d&) {
  DeformStep step{.kind = DeformKind::kTranslate};
  assign(step.vector, translation.vector);
  return step;
}

DeformStep to_step(const NormalOffset& offset, const Vec3d&) {
  DeformStep step{.kind = DeformKind::kAlongNormal};
  assign(step.vector, Vec3d(offset.distance, 0.0, 0.0));
  return step;
}

DeformStep to_step(const TowardPoint& toward, const Vec3d& origin) {
  return scale_step(toward.target, Vec3d::Constant(1.0 - toward.amount), origin);
}

DeformStep to_step(const Scaling& scaling, const Vec3d& origin) {
  return scale_step(scaling.center, scaling.factors, origin);
}

DeformStep to_step(const Rotation& rotation, const Vec3d& origin) {
  DeformStep step{.kind = DeformKind::kTurn};
  const Vec3d axis = rotation.axis.stableNormalized();
  const Vec3d point = rotation.point - origin;
  assign(step.axis, axis);
  assign(step.center, point - axis * axis.dot(point));
  assign_rate(step, rotation.angle_rad);
  return step;
}

DeformStep to_step(const Twist& twist, const Vec3d& origin) {
  DeformStep step{.kind = DeformKind::kTwist};
  assign(step.axis, twist.axis.stableNormalized());
  assign(step.center, twist.point - origin);
  assign_rate(step, twist.angle_rad / twist.length);
  return step;
}

}  // namespace

DeformMap to_deform_map(const Deformation& deformation, const Vec3d& origin) {
  POINTWRIGHT_CHECK(deformation.steps.size() <= kDeformMapSteps, "a valid deformation");
  DeformMap map{};
  for (const ElementaryDeformation& one : deformation.steps) {
    map.step[map.step_count++] = std::visit([&](const auto& each) { return to_step(each, origin); }, one);
  }
  return map;
}

DeformArgs deform_args(const DeformMap& map, const std::vector<std::uint32_t>& blocks,
                       const ScaleField& field, const Level& level, Level& deformed,
                       const ShapeOperators* shape) {
  const std::size_t n = level.position.size();
  POINTWRIGHT_CHECK(level.normal.size() == n, "one normal per sample");
  POINTWRIGHT_CHECK(deformed.position.size() == n && deformed.normal.size() == n, "room for the result");
  POINTWRIGHT_CHECK(field.size() == n && field.t.size() >= padded_to_block(n), "a field of the same samples");
  const bool offsets = map.step_count > 0 && map.step[0].kind == DeformKind::kAlongNormal;
  const std::size_t reached = blocks.empty() ? 0 : (std::size_t{blocks.back()} + 1) * kSimdBlock;
  POINTWRIGHT_CHECK(!offsets || blocks.empty() || (shape != nullptr && shape->size() >= reached),
                    "shape operators of the samples that move");
  const Points& p = level.position;
  const Points& m = level.normal;
  const Points& g = field.gradient;
  DeformArgs args{.map = &map,
                  .blocks = blocks.data(),
                  .t = field.t.data(),
                  .gradient = {g.x(), g.y(), g.z()},
                  .shape = {nullptr, nullptr, nullptr},
                  .position = {p.x(), p.y(), p.z()},
                  .normal = {m.x(), m.y(), m.z()},
                  .deformed_position = {deformed.position.x(), deformed.position.y(), deformed.position.z()},
                  .deformed_normal = {deformed.normal.x(), deformed.normal.y(), deformed.normal.z()}};
  if (offsets && shape != nullptr) {
    args.shape[0] = shape->uu.data();
    args.shape[1] = shape->uv.data();
    args.shape[2] = shape->vv.data();
  }
  return args;
}

}  // namespace pointwright
