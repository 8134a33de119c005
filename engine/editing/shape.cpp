#include "engine/editing/shape.h"

#include <algorithm>
#include <cmath>

namespace pointwright {
namespace {

Result<void> check_point(const Vec3d& point, const char* field) {
  if (!point.allFinite()) {
    return Error{.code = ErrorCode::kNonFinite, .message = "the coordinates must be finite", .field = field};
  }
  const double largest = point.cwiseAbs().maxCoeff();
  if (largest > kMaxShapeCoordinate) {
    return Error{.code = ErrorCode::kOutOfRange,
                 .message = "the coordinates must lie within 1e12 of zero",
                 .field = field,
                 .limit = kMaxShapeCoordinate,
                 .actual = largest};
  }
  return {};
}

Result<void> check_radius(double radius) {
  if (!std::isfinite(radius)) {
    return Error{
        .code = ErrorCode::kNonFinite, .message = "the radius must be finite", .field = "shape.radius"};
  }
  if (radius <= 0.0) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the radius must be greater than 0",
                 .field = "shape.radius",
                 .limit = 0.0,
                 .actual = radius};
  }
  if (radius > kMaxShapeCoordinate) {
    return Error{.code = ErrorCode::kOutOfRange,
                 .message = "the radius must be at most 1e12",
                 .field = "shape.radius",
                 .limit = kMaxShapeCoordinate,
                 .actual = radius};
  }
  return {};
}

Result<void> validate_one(const Sphere& sphere) {
  if (auto center = check_point(sphere.center, "shape.center"); !center) return center;
  return check_radius(sphere.radius);
}

Result<void> validate_one(const Stroke& stroke) {
  const auto count = static_cast<double>(stroke.vertices.size());
  if (stroke.vertices.empty()) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "a stroke needs at least one vertex",
                 .field = "shape.vertices",
                 .limit = 1.0,
                 .actual = count};
  }
  if (stroke.vertices.size() > kMaxStrokeVertices) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "a stroke has at most 100,000 vertices",
                 .field = "shape.vertices",
                 .limit = static_cast<double>(kMaxStrokeVertices),
                 .actual = count};
  }
  for (const Vec3d& vertex : stroke.vertices) {
    if (auto point = check_point(vertex, "shape.vertices"); !point) return point;
  }
  return check_radius(stroke.radius);
}

Result<void> validate_one(const AxisBox& box) {
  if (auto corner = check_point(box.min, "shape.min"); !corner) return corner;
  if (auto corner = check_point(box.max, "shape.max"); !corner) return corner;
  if ((box.min.array() > box.max.array()).any()) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the box's minimum must not exceed its maximum on any axis",
                 .field = "shape.min"};
  }
  return {};
}

Result<void> validate_one(const HalfSpace& half_space) {
  if (auto point = check_point(half_space.point, "shape.point"); !point) return point;
  if (auto normal = check_point(half_space.normal, "shape.normal"); !normal) return normal;
  if (half_space.normal.cwiseAbs().maxCoeff() < kMinDirectionLength) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the normal must not be zero",
                 .field = "shape.normal"};
  }
  return {};
}

Result<void> validate_one(const Everything&) {
  return {};
}

bool contains_one(const Sphere& sphere, const Vec3d& point) {
  return (point - sphere.center).squaredNorm() <= sphere.radius * sphere.radius;
}

bool contains_one(const Stroke& stroke, const Vec3d& point) {
  const std::size_t segments = std::max<std::size_t>(stroke.vertices.size(), 2) - 1;
  for (std::size_t i = 0; i < segments && !stroke.vertices.empty(); ++i) {
    if (stroke_segment_contains(stroke, i, point)) return true;
  }
  return false;
}

bool contains_one(const AxisBox& box, const Vec3d& point) {
  return (point.array() >= box.min.array()).all() && (point.array() <= box.max.array()).all();
}

bool contains_one(const HalfSpace& half_space, const Vec3d& point) {
  return (point - half_space.point).dot(half_space.normal) >= 0.0;
}

bool contains_one(const Everything&, const Vec3d&) {
  return true;
}

}  // namespace

Result<void> validate(const Shape& shape) {
  return std::visit([](const auto& one) { return validate_one(one); }, shape);
}

bool contains(const Shape& shape, const Vec3d& point) {
  return std::visit([&](const auto& one) { return contains_one(one, point); }, shape);
}

double stroke_segment_distance_sq(const Stroke& stroke, std::size_t segment, const Vec3d& point) {
  const Vec3d& a = stroke.vertices[segment];
  const Vec3d& b = stroke.vertices[std::min(segment + 1, stroke.vertices.size() - 1)];
  const Vec3d along = b - a;
  const Vec3d to_point = point - a;
  const double length_sq = along.squaredNorm();
  // A segment without length is the ball around its vertex.
  const double s = length_sq > 0.0 ? std::clamp(to_point.dot(along) / length_sq, 0.0, 1.0) : 0.0;
  return (to_point - s * along).squaredNorm();
}

bool stroke_segment_contains(const Stroke& stroke, std::size_t segment, const Vec3d& point) {
  return stroke_segment_distance_sq(stroke, segment, point) <= stroke.radius * stroke.radius;
}

}  // namespace pointwright
