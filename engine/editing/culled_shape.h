#pragma once
// Shapes with a cheap answer to "may this box hold a point of the shape?", for tests of many coherent points.

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "engine/editing/shape.h"

namespace pointwright {

/// Axis-aligned box; empty while min > max.
struct Box3d {
  Vec3d min = Vec3d::Constant(std::numeric_limits<double>::infinity());
  Vec3d max = Vec3d::Constant(-std::numeric_limits<double>::infinity());

  void extend(const Vec3d& point) {
    min = min.cwiseMin(point);
    max = max.cwiseMax(point);
  }
  [[nodiscard]] bool is_empty() const { return (min.array() > max.array()).any(); }
};

/// A union of capsules in a hierarchy of bounding boxes, split at the median of the longest axis: the
/// segments of a stroke, or the balls of a point set (capsules without length). It refers to the shape.
class CapsuleTree {
 public:
  /// Cost: O(V log V) for V vertices
  explicit CapsuleTree(const Stroke& stroke);
  explicit CapsuleTree(const PointSet& points);

  /// Fills `found` with the capsules within reach of the box's bounding sphere. Never leaves one out that
  /// holds a point of the box.
  void within_reach(const Box3d& box, std::vector<std::uint32_t>& found) const;
  /// Whether the capsule is within reach of the box's bounding sphere.
  [[nodiscard]] bool reaches(std::uint32_t capsule, const Box3d& box) const;
  /// Whether the capsule holds the point: the shape's own exact test.
  [[nodiscard]] bool contains(std::uint32_t capsule, const Vec3d& point) const;

 private:
  struct Node {
    Box3d box;  // of the axes, wider by the radii
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
    std::uint32_t right = 0;  // second child, the first follows its parent; 0 in a leaf
  };

  void build(std::size_t count);
  void split(std::size_t begin, std::size_t end);
  [[nodiscard]] const Vec3d& first_end(std::size_t capsule) const { return (*vertices_)[capsule]; }
  [[nodiscard]] const Vec3d& second_end(std::size_t capsule) const;
  [[nodiscard]] double radius(std::size_t capsule) const;

  const std::vector<Vec3d>* vertices_;
  const std::vector<double>* radii_ = nullptr;  // of a point set
  double radius_ = 0.0;                         // of a stroke
  std::vector<std::uint32_t> order_;            // capsules, leaf by leaf
  std::vector<Node> nodes_;                     // parents before children
};

/// An analytic shape, culled. For strokes and point sets the answer about a box is the list of their capsules
/// that may reach it: within a small block of samples few of thousands do. It refers to the shape.
class CulledShape {
 public:
  explicit CulledShape(const Shape& shape);

  /// Whether the box may hold a point of the shape; `capsules` are those that may reach it.
  bool may_cover(const Box3d& box, std::vector<std::uint32_t>& capsules) const;
  /// The same for a box inside one whose answer was `from`.
  bool may_cover(const Box3d& box, const std::vector<std::uint32_t>& from,
                 std::vector<std::uint32_t>& capsules) const;
  /// contains(shape, point, texcoord) for a point of the box whose answer was `capsules`.
  [[nodiscard]] bool covers(const Vec3d& point, const TexCoord* texcoord,
                            const std::vector<std::uint32_t>& capsules) const;

 private:
  [[nodiscard]] bool may_cover(const Box3d& box) const;

  const Shape* shape_;
  std::optional<CapsuleTree> tree_;
  std::optional<BandedOutline> outline_;
  std::optional<ImageCover> image_;
};

}  // namespace pointwright
