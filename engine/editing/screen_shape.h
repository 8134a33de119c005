#pragma once
// Shapes drawn on a screen: what a camera projects into an outline (lasso, rectangle, ellipse, line).

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vector.h"

namespace pointwright {

using Vec2d = Eigen::Vector2d;

/// Vertices of one outline.
inline constexpr std::size_t kMaxOutlineVertices = 10'000;

/// Even-odd: a point is inside where a ray from it crosses the closed outline an odd number of times.
struct ScreenPolygon {
  std::vector<Vec2d> vertices;  ///< at least 3
};
/// Axis-aligned, border included.
struct ScreenEllipse {
  Vec2d center = Vec2d::Zero();
  Vec2d half_axes = Vec2d::Zero();
};
/// All points within half the width of the line.
struct ScreenPolyline {
  std::vector<Vec2d> vertices;  ///< at least 1
  double width = 0.0;
};

/// All points that the view projects into the outline, on every depth, or `visible` samples alone. Outlines
/// are in normalised device coordinates; points behind the eye (clip-space w <= 0) are outside.
struct ScreenShape {
  /// Model to clip space, row after row: clip = view * (x, y, z, 1).
  std::array<double, 16> view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::variant<ScreenPolygon, ScreenEllipse, ScreenPolyline> outline;
  /// Only samples that the view does not hide behind others: see visible_samples(). A choice among samples;
  /// contains() knows of none and answers for the whole volume.
  bool visible = false;
};

/// Errors: kNonFinite, kOutOfRange for members beyond 1e12; kInvalidArgument for a singular view, too few
/// vertices, lengths that are not greater than 0; kTooLarge. Fields "shape.view",
/// "shape.outline.vertices" and the like.
Result<void> validate_screen_shape(const ScreenShape& shape);

/// Where the view shows the model-space point, in normalised device coordinates; nothing behind the eye.
std::optional<Vec2d> project(const ScreenShape& shape, const Vec3d& point);

/// Whether the point lies in the outline. Cost: O(vertices).
bool outline_contains(const ScreenShape& shape, const Vec2d& point);

std::size_t outline_vertex_count(const ScreenShape& shape);

/// The same answers as outline_contains(), by horizontal bands that know the edges which pass through them.
/// It refers to the shape.
class BandedOutline {
 public:
  /// Cost: O(V B) at most for V edges in B <= 256 bands
  explicit BandedOutline(const ScreenShape& shape);

  /// Cost: O(edges in the point's band): a few for a lasso, V where every edge spans the whole height
  [[nodiscard]] bool contains(const Vec2d& point) const;

 private:
  [[nodiscard]] std::size_t band_of(double y) const;

  const ScreenShape* shape_;
  Vec2d low_ = Vec2d::Zero();  // of all that the outline may contain
  Vec2d high_ = Vec2d::Zero();
  double bands_per_length_ = 0.0;
  std::vector<std::vector<std::uint32_t>> edges_;  // by band
};

}  // namespace pointwright
