#include "engine/editing/painting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Samples that share one culling decision.
constexpr std::size_t kPaintBlock = 128;
constexpr std::size_t kLeafSegments = 8;
// Of coordinates and distances: what culling leaves to the rounding of the exact test.
constexpr double kSlack = 1e-12;

struct Box3d {
  Vec3d min = Vec3d::Constant(std::numeric_limits<double>::infinity());
  Vec3d max = Vec3d::Constant(-std::numeric_limits<double>::infinity());

  void extend(const Vec3d& point) {
    min = min.cwiseMin(point);
    max = max.cwiseMax(point);
  }
};

Box3d model_box(const Points& position, const Vec3d& origin, std::size_t begin, std::size_t end) {
  Box3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(position[i]);
  return {origin + box.min.cast<double>(), origin + box.max.cast<double>()};
}

bool overlap(const Box3d& a, const Box3d& b) {
  return (a.min.array() <= b.max.array()).all() && (a.max.array() >= b.min.array()).all();
}

// Wider by `reach` and a little more: the exact test rounds too.
Box3d widened(const Box3d& box, double reach) {
  const Vec3d margin =
      (Vec3d::Constant(reach) + (box.min.cwiseAbs() + box.max.cwiseAbs()) * kSlack) * (1.0 + kSlack);
  return {box.min - margin, box.max + margin};
}

// The segments of a stroke in a hierarchy of bounding boxes, split at the median of the longest axis.
class SegmentTree {
 public:
  explicit SegmentTree(const Stroke& stroke) : stroke_(&stroke) {
    std::vector<std::uint32_t> segments(std::max<std::size_t>(stroke.vertices.size(), 2) - 1);
    std::iota(segments.begin(), segments.end(), 0U);
    nodes_.reserve(2 * (segments.size() / (kLeafSegments / 2) + 1));
    order_ = std::move(segments);
    split(0, order_.size());
  }

  // Fills `found` with the segments within the stroke's radius of the box's bounding sphere. Never leaves one
  // out that holds a point of the box.
  void within_reach(const Box3d& box, std::vector<std::uint32_t>& found) const {
    found.clear();
    const Box3d wide = widened(box, stroke_->radius);
    std::array<std::uint32_t, 64> open{};  // the tree is balanced: at most one entry a level
    std::size_t depth = 0;
    open[depth++] = 0;
    while (depth > 0) {
      const std::uint32_t at = open[--depth];
      const Node& node = nodes_[at];
      if (!overlap(wide, widened(node.box, 0.0))) continue;
      if (node.right != 0) {
        open[depth++] = node.right;
        open[depth++] = at + 1;
        continue;
      }
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        if (reaches(order_[i], box)) found.push_back(order_[i]);
      }
    }
  }

  [[nodiscard]] bool reaches(std::uint32_t segment, const Box3d& box) const {
    const Vec3d center = 0.5 * (box.min + box.max);
    const double reach = stroke_->radius + 0.5 * (box.max - box.min).norm();
    const double size = largest(box.min) + largest(box.max) + largest(first_end(segment)) +
                        largest(second_end(segment)) + stroke_->radius;
    return std::sqrt(stroke_segment_distance_sq(*stroke_, segment, center)) <= reach + size * kSlack;
  }

 private:
  struct Node {
    Box3d box;
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
    std::uint32_t right = 0;  // second child, the first follows its parent; 0 in a leaf
  };

  static double largest(const Vec3d& v) { return v.cwiseAbs().maxCoeff(); }

  [[nodiscard]] const Vec3d& first_end(std::size_t segment) const { return stroke_->vertices[segment]; }
  [[nodiscard]] const Vec3d& second_end(std::size_t segment) const {
    return stroke_->vertices[std::min(segment + 1, stroke_->vertices.size() - 1)];
  }

  void split(std::size_t begin, std::size_t end) {
    const std::size_t at = nodes_.size();
    Node node{.begin = static_cast<std::uint32_t>(begin), .end = static_cast<std::uint32_t>(end)};
    Box3d middles;
    for (std::size_t i = begin; i < end; ++i) {
      node.box.extend(first_end(order_[i]));
      node.box.extend(second_end(order_[i]));
      middles.extend(first_end(order_[i]) + second_end(order_[i]));
    }
    nodes_.push_back(node);
    if (end - begin <= kLeafSegments) return;
    Eigen::Index axis = 0;
    (middles.max - middles.min).maxCoeff(&axis);
    const std::size_t half = begin + (end - begin) / 2;
    const auto place = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(place(begin), place(half), place(end), [&](std::uint32_t a, std::uint32_t b) {
      return first_end(a)[axis] + second_end(a)[axis] < first_end(b)[axis] + second_end(b)[axis];
    });
    split(begin, half);
    nodes_[at].right = static_cast<std::uint32_t>(nodes_.size());
    split(half, end);
  }

  const Stroke* stroke_;
  std::vector<std::uint32_t> order_;  // segments, leaf by leaf
  std::vector<Node> nodes_;           // parents before children
};

// A shape with a cheap, never optimistic answer to "may this box hold a point of the shape?". For strokes the
// answer is the list of segments that may: within a small block of samples few of thousands do.
class CulledShape {
 public:
  explicit CulledShape(const Shape& shape) : shape_(&shape), stroke_(std::get_if<Stroke>(&shape)) {
    if (stroke_ != nullptr) tree_.emplace(*stroke_);
  }

  // Whether the box may hold a point of the shape; `segments` are those of a stroke that may reach it.
  bool may_cover(const Box3d& box, std::vector<std::uint32_t>& segments) const {
    if (!tree_) return may_cover(box);
    tree_->within_reach(box, segments);
    return !segments.empty();
  }
  // The same for a box inside one whose answer was `from`.
  bool may_cover(const Box3d& box, const std::vector<std::uint32_t>& from,
                 std::vector<std::uint32_t>& segments) const {
    if (!tree_) return may_cover(box);
    segments.clear();
    std::ranges::copy_if(from, std::back_inserter(segments),
                         [&](std::uint32_t i) { return tree_->reaches(i, box); });
    return !segments.empty();
  }

  [[nodiscard]] bool covers(const Vec3d& point, const std::vector<std::uint32_t>& segments) const {
    if (stroke_ == nullptr) return contains(*shape_, point);
    return std::any_of(segments.begin(), segments.end(),
                       [&](std::uint32_t i) { return stroke_segment_contains(*stroke_, i, point); });
  }

 private:
  [[nodiscard]] bool may_cover(const Box3d& box) const {
    if (const auto* sphere = std::get_if<Sphere>(shape_)) {
      return overlap(box, widened({sphere->center, sphere->center}, sphere->radius));
    }
    if (const auto* axis_box = std::get_if<AxisBox>(shape_)) {
      return overlap(box, {axis_box->min, axis_box->max});
    }
    return true;
  }

  const Shape* shape_;
  const Stroke* stroke_;
  std::optional<SegmentTree> tree_;
};

// The mark of one sample after the operation.
std::uint8_t painted(std::uint8_t mark, bool covered, PaintMode mode, std::uint8_t own, std::uint8_t other,
                     bool steal) {
  const auto joined = static_cast<std::uint8_t>((mark | own) & (steal ? ~other : 0xff));
  const auto left = static_cast<std::uint8_t>(mark & ~own);
  switch (mode) {
    case PaintMode::kAdd:
      return covered ? joined : mark;
    case PaintMode::kRemove:
      return covered ? left : mark;
    case PaintMode::kIntersect:
      return covered ? mark : left;
    case PaintMode::kSet:
      return covered ? joined : left;
  }
  return mark;
}

}  // namespace

Result<void> validate(const PaintOperation& operation) {
  if (auto shape = validate(operation.shape); !shape) return shape;
  if (!operation.facing) return {};
  if (!operation.facing->allFinite()) {
    return Error{.code = ErrorCode::kNonFinite, .message = "the direction must be finite", .field = "facing"};
  }
  if (operation.facing->cwiseAbs().maxCoeff() < kMinDirectionLength) {
    return Error{
        .code = ErrorCode::kInvalidArgument, .message = "the direction must not be zero", .field = "facing"};
  }
  return {};
}

std::size_t paint(const PaintOperation& operation, RegionKind kind, const Points& position,
                  const Points& normal, const Vec3d& origin, Marks& marks, const ExecutionContext* context) {
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(marks.size() == n, "one mark per sample");
  POINTWRIGHT_CHECK(!operation.facing || normal.size() == n, "one normal per sample");
  const auto own = static_cast<std::uint8_t>(kind);
  const auto other =
      static_cast<std::uint8_t>(kind == RegionKind::kZero ? RegionKind::kOne : RegionKind::kZero);
  const CulledShape shape(operation.shape);

  return parallel_sum<std::size_t>(n, 0, [&](std::size_t begin, std::size_t end) {
    std::size_t changed = 0;
    if (context != nullptr && context->is_cancelled()) return changed;
    std::vector<std::uint32_t> of_range;
    std::vector<std::uint32_t> of_block;
    const bool range_reached = shape.may_cover(model_box(position, origin, begin, end), of_range);
    bool reached = false;
    for (std::size_t i = begin; i < end; ++i) {
      if ((i - begin) % kPaintBlock == 0) {
        if (context != nullptr && context->is_cancelled()) return changed;
        const Box3d box = model_box(position, origin, i, std::min(i + kPaintBlock, end));
        reached = range_reached && shape.may_cover(box, of_range, of_block);
      }
      bool covered = reached && (!operation.facing || normal[i].cast<double>().dot(*operation.facing) > 0.0);
      covered = covered && shape.covers(origin + position[i].cast<double>(), of_block);
      const std::uint8_t mark = painted(marks[i], covered, operation.mode, own, other, operation.steal);
      changed += mark != marks[i] ? 1 : 0;
      marks[i] = mark;
    }
    return changed;
  });
}

std::size_t count_marked(const Marks& marks, RegionKind kind) {
  const auto bit = static_cast<std::uint8_t>(kind);
  return static_cast<std::size_t>(
      std::count_if(marks.begin(), marks.end(), [bit](std::uint8_t mark) { return (mark & bit) != 0; }));
}

}  // namespace pointwright
