#include "engine/editing/partial_edit.h"

#include <utility>
#include <variant>

#include "engine/core/check.h"

namespace pointwright {
namespace {

void scale(Translation& translation, double s) {
  translation.vector *= s;
}
void scale(NormalOffset& offset, double s) {
  offset.distance *= s;
}
void scale(TowardPoint& toward, double s) {
  toward.amount *= s;
}
void scale(Rotation& rotation, double s) {
  rotation.angle_rad *= s;
}
void scale(Scaling& scaling, double s) {
  scaling.factors = Vec3d::Ones() + s * (scaling.factors - Vec3d::Ones());
}
void scale(Twist& twist, double s) {
  twist.angle_rad *= s;
}

}  // namespace

Deformation scaled(const Deformation& deformation, double s) {
  POINTWRIGHT_CHECK(s >= 0.0 && s <= 1.0, "a part of the deformation");
  Deformation part = deformation;
  if (s == 1.0) return part;  // 1 + (f - 1) rounds
  for (ElementaryDeformation& step : part.steps) std::visit([s](auto& each) { scale(each, s); }, step);
  return part;
}

EditParams scaled(const EditParams& edit, double s) {
  EditParams part = edit;
  part.deformation = scaled(edit.deformation, s);
  if (s == 1.0) return part;
  for (float& gain : part.gains) gain = static_cast<float>(1.0 + s * (double{gain} - 1.0));
  return part;
}

}  // namespace pointwright
