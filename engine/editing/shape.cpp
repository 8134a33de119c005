#include "engine/editing/shape.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "engine/editing/segment.h"

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

Result<void> check_radius(double radius, const char* field = "shape.radius") {
  if (!std::isfinite(radius)) {
    return Error{.code = ErrorCode::kNonFinite, .message = "the radius must be finite", .field = field};
  }
  if (radius <= 0.0) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the radius must be greater than 0",
                 .field = field,
                 .limit = 0.0,
                 .actual = radius};
  }
  if (radius > kMaxShapeCoordinate) {
    return Error{.code = ErrorCode::kOutOfRange,
                 .message = "the radius must be at most 1e12",
                 .field = field,
                 .limit = kMaxShapeCoordinate,
                 .actual = radius};
  }
  return {};
}

Result<void> validate_one(const Sphere& sphere) {
  if (auto center = check_point(sphere.center, "shape.center"); !center) return center;
  return check_radius(sphere.radius);
}

// Of strokes and point sets: at least one vertex, not too many, all good.
Result<void> check_vertices(const std::vector<Vec3d>& vertices, const char* field) {
  const auto count = static_cast<double>(vertices.size());
  if (vertices.empty()) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "at least one is needed",
                 .field = field,
                 .limit = 1.0,
                 .actual = count};
  }
  if (vertices.size() > kMaxStrokeVertices) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "at most 100,000 are allowed",
                 .field = field,
                 .limit = static_cast<double>(kMaxStrokeVertices),
                 .actual = count};
  }
  for (const Vec3d& vertex : vertices) {
    if (auto point = check_point(vertex, field); !point) return point;
  }
  return {};
}

Result<void> validate_one(const Stroke& stroke) {
  if (auto vertices = check_vertices(stroke.vertices, "shape.vertices"); !vertices) return vertices;
  return check_radius(stroke.radius);
}

Result<void> validate_one(const PointSet& set) {
  if (auto points = check_vertices(set.points, "shape.points"); !points) return points;
  if (set.radii.size() != 1 && set.radii.size() != set.points.size()) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "there must be one radius for each point",
                 .field = "shape.radii",
                 .limit = static_cast<double>(set.points.size()),
                 .actual = static_cast<double>(set.radii.size())};
  }
  for (const double radius : set.radii) {
    if (auto checked = check_radius(radius, set.radii.size() == 1 ? "shape.radius" : "shape.radii"); !checked)
      return checked;
  }
  return {};
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

Result<void> validate_one(const ScreenShape& shape) {
  return validate_screen_shape(shape);
}

Result<void> validate_one(const ImageShape& shape) {
  return validate_image_shape(shape);
}

Result<void> validate_one(const ModelShape& shape) {
  return validate_model_shape(shape);
}

Result<void> validate_one(const RegionShape&) {
  return {};
}

bool contains_one(const Sphere& sphere, const Vec3d& point) {
  return (point - sphere.center).squaredNorm() <= sphere.radius * sphere.radius;
}

bool contains_one(const Stroke& stroke, const Vec3d& point) {
  const double radius_sq = stroke.radius * stroke.radius;
  const std::size_t segments = std::max<std::size_t>(stroke.vertices.size(), 2) - 1;
  for (std::size_t i = 0; i < segments && !stroke.vertices.empty(); ++i) {
    const Vec3d& next = stroke.vertices[std::min(i + 1, stroke.vertices.size() - 1)];
    if (segment_distance_sq(stroke.vertices[i], next, point) <= radius_sq) return true;
  }
  return false;
}

bool contains_one(const PointSet& set, const Vec3d& point) {
  for (std::size_t i = 0; i < set.points.size(); ++i) {
    const double radius = set.radii.size() == 1 ? set.radii.front() : set.radii[i];
    if ((point - set.points[i]).squaredNorm() <= radius * radius) return true;
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

bool contains_one(const ScreenShape& shape, const Vec3d& point) {
  const std::optional<Vec2d> place = project(shape, point);
  return place && outline_contains(shape, *place);
}

bool contains_one(const ModelShape& shape, const Vec3d& point) {
  return model_contains(shape, point);
}

bool contains_one(const RegionShape&, const Vec3d&) {
  return false;
}

}  // namespace

Result<void> validate(const Shape& shape) {
  return std::visit([](const auto& one) { return validate_one(one); }, shape);
}

bool contains(const Shape& shape, const Vec3d& point, const TexCoord* texcoord) {
  return std::visit(
      [&](const auto& one) {
        if constexpr (std::is_same_v<std::decay_t<decltype(one)>, ImageShape>) {
          return ImageCover(one).covers(point, texcoord);
        } else {
          return contains_one(one, point);
        }
      },
      shape);
}

bool has_its_data(const Shape& shape) {
  if (const auto* image = std::get_if<ImageShape>(&shape)) return image->image != nullptr;
  if (const auto* model = std::get_if<ModelShape>(&shape)) return model->cloud != nullptr;
  if (const auto* region = std::get_if<RegionShape>(&shape)) return region->members != nullptr;
  return true;
}

bool needs_texcoord(const Shape& shape) {
  const auto* image = std::get_if<ImageShape>(&shape);
  return image != nullptr && std::holds_alternative<TextureProjection>(image->projection);
}

bool depends_on_sampling(const Shape& shape) {
  if (const auto* screen = std::get_if<ScreenShape>(&shape)) return screen->visible;
  return std::holds_alternative<ImageShape>(shape) || std::holds_alternative<ModelShape>(shape) ||
         std::holds_alternative<RegionShape>(shape);
}

std::size_t vertex_count(const Shape& shape) {
  if (const auto* stroke = std::get_if<Stroke>(&shape)) return stroke->vertices.size();
  if (const auto* set = std::get_if<PointSet>(&shape)) return set->points.size();
  if (const auto* screen = std::get_if<ScreenShape>(&shape)) return outline_vertex_count(*screen);
  return 0;
}

}  // namespace pointwright
