#pragma once
// Analytic shapes in model space: what a painting operation covers (§4: "drawing of points, lines, circles
// and other primitives").

#include <cstddef>
#include <variant>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vector.h"
#include "engine/editing/screen_shape.h"

namespace pointwright {

/// Limits of what a shape may hold.
inline constexpr double kMaxShapeCoordinate = 1e12;
inline constexpr std::size_t kMaxStrokeVertices = 100'000;
/// Directions with no component as large as this are "zero".
inline constexpr double kMinDirectionLength = 1e-100;

/// All points within `radius` of `center`.
struct Sphere {
  Vec3d center = Vec3d::Zero();
  double radius = 0.0;
};
/// A brush stroke: all points within `radius` of a polyline (one vertex: a sphere; two: a capsule).
struct Stroke {
  std::vector<Vec3d> vertices;  ///< at least 1
  double radius = 0.0;
};
/// A union of balls: all points within the radius of any of the points.
struct PointSet {
  std::vector<Vec3d> points;  ///< at least 1
  std::vector<double> radii;  ///< one for all points, or one for each
};
/// An axis-aligned box, borders included.
struct AxisBox {
  Vec3d min = Vec3d::Zero();
  Vec3d max = Vec3d::Zero();
};
/// The side of a plane that its normal points to, the plane included: (x - point) . normal >= 0.
struct HalfSpace {
  Vec3d point = Vec3d::Zero();
  Vec3d normal = Vec3d::UnitZ();
};
/// All of space.
struct Everything {};

using Shape = std::variant<Sphere, Stroke, AxisBox, HalfSpace, Everything, PointSet, ScreenShape>;

/// Finite members within kMaxShapeCoordinate, radii > 0, min <= max, a normal that is not zero, at least one
/// and at most kMaxStrokeVertices vertices or points.
/// Errors: kInvalidArgument (field "shape.radius" and the like), kNonFinite, kOutOfRange, kTooLarge.
Result<void> validate(const Shape& shape);

/// Whether the model-space point lies in the shape. Cost: O(1), O(vertices) for strokes, point
/// sets and outlines.
bool contains(const Shape& shape, const Vec3d& point);

/// Whether the shape is a choice among samples, not a volume: see PaintOperation's depends_on_sampling().
bool depends_on_sampling(const Shape& shape);

/// Vertices that the shape counts with against the limit of a painting: those of strokes, point sets and
/// outlines.
std::size_t vertex_count(const Shape& shape);

}  // namespace pointwright
