#pragma once
// Analytic shapes in model space: what a painting operation covers (§4: "drawing of points, lines, circles
// and other primitives").

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vector.h"
#include "engine/editing/image_shape.h"
#include "engine/editing/model_shape.h"
#include "engine/editing/screen_shape.h"
#include "engine/editing/shape_checks.h"

namespace pointwright {

/// Limits of what a shape may hold.
inline constexpr double kMaxShapeCoordinate = 1e12;
inline constexpr std::size_t kMaxStrokeVertices = 100'000;

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

/// The samples of a region of the surface that is painted, as they are when it is painted.
struct RegionShape {
  std::string source;  ///< the caller's name of the region; nothing here reads it
  /// One entry for each sample of the surface, 0 or 1; null until it was found: nothing is painted with it
  /// then.
  std::shared_ptr<const std::vector<std::uint8_t>> members;
};

using Shape = std::variant<Sphere, Stroke, AxisBox, HalfSpace, Everything, PointSet, ScreenShape, ImageShape,
                           ModelShape, RegionShape>;

/// Finite members within kMaxShapeCoordinate, radii > 0, min <= max, a normal that is not zero, at least one
/// and at most kMaxStrokeVertices vertices or points.
/// Errors: kInvalidArgument (field "shape.radius" and the like), kNonFinite, kOutOfRange, kTooLarge.
Result<void> validate(const Shape& shape);

/// Whether the shape holds a sample at a place of model space. Images that are mapped by texture coordinates
/// hold none without one, regions none: they are of samples, not of places.
/// Pre:  an image or a model was found
/// Cost: O(1), O(vertices) for strokes, point sets and outlines, O(samples) for models
bool contains(const Shape& shape, const Vec3d& point, const TexCoord* texcoord = nullptr);

/// Whether the image, the model or the region that the shape names is there; true for all other shapes.
bool has_its_data(const Shape& shape);
/// Whether the shape reads the texture coordinates of samples.
bool needs_texcoord(const Shape& shape);

/// Whether the shape is no volume that its members alone describe: a choice among samples, or a name of data
/// that may be gone tomorrow. See PaintOperation's depends_on_sampling().
bool depends_on_sampling(const Shape& shape);

/// Vertices that the shape counts with against the limit of a painting: those of strokes, point sets and
/// outlines.
std::size_t vertex_count(const Shape& shape);

}  // namespace pointwright
