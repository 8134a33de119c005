#include "engine/editing/screen_shape.h"

#include <algorithm>
#include <cmath>

#include "engine/editing/segment.h"
#include "engine/editing/shape_checks.h"

namespace pointwright {
namespace {

constexpr std::size_t kMaxBands = 256;

Result<void> check_vertices(const std::vector<Vec2d>& vertices, std::size_t least) {
  constexpr const char* kField = "shape.outline.vertices";
  const std::size_t count = vertices.size();
  if (count < least || count > kMaxOutlineVertices) {
    Error error = count < least
                      ? shape_error(ErrorCode::kInvalidArgument, "the outline has too few vertices", kField)
                      : shape_error(ErrorCode::kTooLarge, "an outline has at most 10,000 vertices", kField);
    error.limit = static_cast<double>(count < least ? least : kMaxOutlineVertices);
    error.actual = static_cast<double>(count);
    return error;
  }
  for (const Vec2d& vertex : vertices) {
    if (auto numbers = check_numbers(vertex.data(), 2, kField); !numbers) return numbers;
  }
  return {};
}

Result<void> validate_outline(const ScreenPolygon& polygon) {
  return check_vertices(polygon.vertices, 3);
}
Result<void> validate_outline(const ScreenEllipse& ellipse) {
  if (auto center = check_numbers(ellipse.center.data(), 2, "shape.outline.center"); !center) return center;
  return check_lengths(ellipse.half_axes.data(), 2, "shape.outline.half_axes");
}
Result<void> validate_outline(const ScreenPolyline& line) {
  if (auto vertices = check_vertices(line.vertices, 1); !vertices) return vertices;
  return check_lengths(&line.width, 1, "shape.outline.width");
}

// An edge of a polygon (closed) or a line (open; one vertex is an edge without length).
struct Edge {
  const Vec2d& from;
  const Vec2d& to;
};

std::size_t edge_count(const ScreenPolygon& polygon) {
  return polygon.vertices.size();
}
std::size_t edge_count(const ScreenPolyline& line) {
  return std::max<std::size_t>(line.vertices.size(), 2) - 1;
}
std::size_t edge_count(const ScreenEllipse&) {
  return 0;
}

Edge edge_of(const ScreenPolygon& polygon, std::size_t i) {
  return {polygon.vertices[i], polygon.vertices[i + 1 < polygon.vertices.size() ? i + 1 : 0]};
}
Edge edge_of(const ScreenPolyline& line, std::size_t i) {
  return {line.vertices[i], line.vertices[std::min(i + 1, line.vertices.size() - 1)]};
}

// Whether the ray from the point to the right crosses the edge; half-open, so that a vertex counts once.
bool crosses(const Edge& edge, const Vec2d& point) {
  if ((edge.from.y() > point.y()) == (edge.to.y() > point.y())) return false;
  const double part = (point.y() - edge.from.y()) / (edge.to.y() - edge.from.y());
  return point.x() < edge.from.x() + part * (edge.to.x() - edge.from.x());
}

bool near(const Edge& edge, const Vec2d& point, double width) {
  return segment_distance_sq(edge.from, edge.to, point) <= 0.25 * width * width;
}

// The outline's answer from the edges that may count: edge_at(0) .. edge_at(count - 1).
template <typename EdgeAt>
bool contains_by(const ScreenPolygon& polygon, const Vec2d& point, std::size_t count, const EdgeAt& edge_at) {
  bool inside = false;
  for (std::size_t i = 0; i < count; ++i) inside ^= crosses(edge_of(polygon, edge_at(i)), point);
  return inside;
}
template <typename EdgeAt>
bool contains_by(const ScreenPolyline& line, const Vec2d& point, std::size_t count, const EdgeAt& edge_at) {
  for (std::size_t i = 0; i < count; ++i) {
    if (near(edge_of(line, edge_at(i)), point, line.width)) return true;
  }
  return false;
}
template <typename EdgeAt>
bool contains_by(const ScreenEllipse& ellipse, const Vec2d& point, std::size_t, const EdgeAt&) {
  return (point - ellipse.center).cwiseQuotient(ellipse.half_axes).squaredNorm() <= 1.0;
}

}  // namespace

Result<void> validate_screen_shape(const ScreenShape& shape) {
  if (auto view = check_numbers(shape.view.data(), shape.view.size(), "shape.view"); !view) return view;
  if (is_singular(shape.view))
    return shape_error(ErrorCode::kInvalidArgument, "the matrix must not be singular", "shape.view");
  return std::visit([](const auto& outline) { return validate_outline(outline); }, shape.outline);
}

std::optional<Vec2d> project(const ScreenShape& shape, const Vec3d& point) {
  const auto clip = [&](std::size_t row) {
    const double* m = shape.view.data() + 4 * row;
    return m[0] * point.x() + m[1] * point.y() + m[2] * point.z() + m[3];
  };
  const double w = clip(3);
  if (!(w > 0.0)) return std::nullopt;
  const Vec2d place(clip(0) / w, clip(1) / w);
  if (!place.allFinite()) return std::nullopt;
  return place;
}

bool outline_contains(const ScreenShape& shape, const Vec2d& point) {
  return std::visit(
      [&](const auto& outline) {
        return contains_by(outline, point, edge_count(outline), [](std::size_t i) { return i; });
      },
      shape.outline);
}

std::size_t outline_vertex_count(const ScreenShape& shape) {
  if (const auto* polygon = std::get_if<ScreenPolygon>(&shape.outline)) return polygon->vertices.size();
  if (const auto* line = std::get_if<ScreenPolyline>(&shape.outline)) return line->vertices.size();
  return 0;
}

BandedOutline::BandedOutline(const ScreenShape& shape) : shape_(&shape) {
  const auto* polygon = std::get_if<ScreenPolygon>(&shape.outline);
  const auto* line = std::get_if<ScreenPolyline>(&shape.outline);
  if (polygon == nullptr && line == nullptr) return;
  const std::vector<Vec2d>& vertices = polygon != nullptr ? polygon->vertices : line->vertices;
  if (vertices.empty()) return;
  low_ = high_ = vertices.front();
  for (const Vec2d& vertex : vertices) {
    low_ = low_.cwiseMin(vertex);
    high_ = high_.cwiseMax(vertex);
  }
  // Half the width, and a little more for what the exact test rounds.
  const double scale = low_.cwiseAbs().maxCoeff() + high_.cwiseAbs().maxCoeff();
  const double reach = line == nullptr ? 0.0 : 0.5 * line->width + (scale + line->width) * 1e-12;
  low_ -= Vec2d::Constant(reach);
  high_ += Vec2d::Constant(reach);
  const std::size_t count = polygon != nullptr ? edge_count(*polygon) : edge_count(*line);
  edges_.resize(std::min(count, kMaxBands));
  const double height = high_.y() - low_.y();
  bands_per_length_ = height > 0.0 ? static_cast<double>(edges_.size()) / height : 0.0;
  if (!std::isfinite(bands_per_length_)) bands_per_length_ = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Edge edge = polygon != nullptr ? edge_of(*polygon, i) : edge_of(*line, i);
    const auto [bottom, top] = std::minmax(edge.from.y(), edge.to.y());
    for (std::size_t band = band_of(bottom - reach); band <= band_of(top + reach); ++band)
      edges_[band].push_back(static_cast<std::uint32_t>(i));
  }
}

// Never decreases with y, rounding included: an edge that reaches y is listed in y's band.
std::size_t BandedOutline::band_of(double y) const {
  const double band = (y - low_.y()) * bands_per_length_;
  return static_cast<std::size_t>(std::clamp(band, 0.0, static_cast<double>(edges_.size() - 1)));
}

bool BandedOutline::contains(const Vec2d& point) const {
  return std::visit(
      [&](const auto& outline) {
        if (edges_.empty()) return contains_by(outline, point, 0, [](std::size_t i) { return i; });
        // A crossing that rounds past the outline's own right end would be the plain test's too: only the
        // height is cut off here.
        if (point.y() < low_.y() || point.y() > high_.y()) return false;
        const std::vector<std::uint32_t>& edges = edges_[band_of(point.y())];
        return contains_by(outline, point, edges.size(),
                           [&](std::size_t i) -> std::size_t { return edges[i]; });
      },
      shape_->outline);
}

}  // namespace pointwright
