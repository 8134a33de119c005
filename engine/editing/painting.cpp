#include "engine/editing/painting.h"

#include <algorithm>

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Samples that share one culling decision.
constexpr std::size_t kPaintBlock = 128;

struct Box3d {
  Vec3d min;
  Vec3d max;
};

Box3d model_box(const Points& position, const Vec3d& origin, std::size_t begin, std::size_t end) {
  Box3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(position[i]);
  return {origin + box.min.cast<double>(), origin + box.max.cast<double>()};
}

bool overlap(const Box3d& a, const Vec3d& min, const Vec3d& max) {
  return (a.min.array() <= max.array()).all() && (a.max.array() >= min.array()).all();
}

// A shape with a cheap, never optimistic answer to "may this box hold a point of the shape?". For strokes the
// answer is the list of segments that may: within a small block of samples few of thousands do.
class CulledShape {
 public:
  explicit CulledShape(const Shape& shape) : shape_(&shape), stroke_(std::get_if<Stroke>(&shape)) {
    if (stroke_ == nullptr) return;
    all_segments_.resize(std::max<std::size_t>(stroke_->vertices.size(), 2) - 1);
    for (std::size_t i = 0; i < all_segments_.size(); ++i) all_segments_[i] = i;
  }

  [[nodiscard]] const std::vector<std::size_t>& all_segments() const { return all_segments_; }

  // Whether the box may hold a point of the shape; of `from`, keeps the segments that may reach it.
  bool may_cover(const Box3d& box, const std::vector<std::size_t>& from,
                 std::vector<std::size_t>& kept) const {
    kept.clear();
    if (stroke_ != nullptr) {
      for (const std::size_t i : from) {
        const Vec3d& a = stroke_->vertices[i];
        const Vec3d& b = stroke_->vertices[std::min(i + 1, stroke_->vertices.size() - 1)];
        if (reaches(box, a.cwiseMin(b), a.cwiseMax(b), stroke_->radius)) kept.push_back(i);
      }
      return !kept.empty();
    }
    if (const auto* sphere = std::get_if<Sphere>(shape_)) {
      return reaches(box, sphere->center, sphere->center, sphere->radius);
    }
    if (const auto* axis_box = std::get_if<AxisBox>(shape_))
      return overlap(box, axis_box->min, axis_box->max);
    return true;
  }

  [[nodiscard]] bool covers(const Vec3d& point, const std::vector<std::size_t>& segments) const {
    if (stroke_ == nullptr) return contains(*shape_, point);
    return std::any_of(segments.begin(), segments.end(),
                       [&](std::size_t i) { return stroke_segment_contains(*stroke_, i, point); });
  }

 private:
  static bool reaches(const Box3d& box, const Vec3d& min, const Vec3d& max, double radius) {
    // A little wider than the radius: the exact test rounds too.
    const Vec3d margin = Vec3d::Constant(radius) + (min.cwiseAbs() + max.cwiseAbs()) * 1e-12;
    return overlap(box, min - margin * (1.0 + 1e-12), max + margin * (1.0 + 1e-12));
  }

  const Shape* shape_;
  const Stroke* stroke_;
  std::vector<std::size_t> all_segments_;
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
                  const Points& normal, const Vec3d& origin, Marks& marks) {
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(marks.size() == n, "one mark per sample");
  POINTWRIGHT_CHECK(!operation.facing || normal.size() == n, "one normal per sample");
  const auto own = static_cast<std::uint8_t>(kind);
  const auto other =
      static_cast<std::uint8_t>(kind == RegionKind::kZero ? RegionKind::kOne : RegionKind::kZero);
  const CulledShape shape(operation.shape);

  const auto paint_block = [&](std::size_t begin, std::size_t end, bool reached,
                               const std::vector<std::size_t>& segments) {
    std::size_t changed = 0;
    for (std::size_t i = begin; i < end; ++i) {
      bool covered = reached && (!operation.facing || normal[i].cast<double>().dot(*operation.facing) > 0.0);
      covered = covered && shape.covers(origin + position[i].cast<double>(), segments);
      const std::uint8_t mark = painted(marks[i], covered, operation.mode, own, other, operation.steal);
      changed += mark != marks[i] ? 1 : 0;
      marks[i] = mark;
    }
    return changed;
  };
  return parallel_sum<std::size_t>(n, 0, [&](std::size_t begin, std::size_t end) {
    std::vector<std::size_t> of_range;
    std::vector<std::size_t> of_block;
    const bool range_reached =
        shape.may_cover(model_box(position, origin, begin, end), shape.all_segments(), of_range);
    std::size_t changed = 0;
    for (std::size_t i = begin; i < end; i += kPaintBlock) {
      const std::size_t block_end = std::min(i + kPaintBlock, end);
      const bool reached =
          range_reached && shape.may_cover(model_box(position, origin, i, block_end), of_range, of_block);
      changed += paint_block(i, block_end, reached, of_block);
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
