#include "engine/editing/painting.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/culled_shape.h"
#include "engine/editing/model_cover.h"
#include "engine/editing/selection.h"
#include "engine/editing/visibility.h"

namespace pointwright {
namespace {

std::uint8_t bit_of(RegionKind kind) {
  return static_cast<std::uint8_t>(kind);
}
std::uint8_t other_bit(RegionKind kind) {
  return bit_of(kind == RegionKind::kZero ? RegionKind::kOne : RegionKind::kZero);
}

// Samples that share one culling decision.
constexpr std::size_t kPaintBlock = 128;

Box3d model_box(const PaintSurface& surface, std::size_t begin, std::size_t end) {
  Box3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(surface.position[i]);
  return {surface.origin + box.min.cast<double>(), surface.origin + box.max.cast<double>()};
}

// Which samples an operation's shape covers, block by block.
class ShapeCover {
 public:
  ShapeCover(const PaintOperation& operation, const PaintSurface& surface, const ExecutionContext* context)
      : surface_(surface), facing_(operation.facing), shape_(operation.shape) {
    if (const auto* model = std::get_if<ModelShape>(&operation.shape))
      model_.emplace(*model, surface.position, surface.origin, context);
    if (const auto* region = std::get_if<RegionShape>(&operation.shape)) members_ = region->members.get();
  }

  // Writes covered[0, end - begin). Stops early where cancelled.
  void cover(std::size_t begin, std::size_t end, std::uint8_t* covered,
             const ExecutionContext* context) const {
    if (model_) return cover_by_model(begin, end, covered, context);
    if (members_ != nullptr) {
      for (std::size_t i = begin; i < end; ++i) covered[i - begin] = (*members_)[i] != 0 && faces(i) ? 1 : 0;
      return;
    }
    std::vector<std::uint32_t> of_range;
    std::vector<std::uint32_t> of_block;
    const bool range_reached = shape_.may_cover(model_box(surface_, begin, end), of_range);
    for (std::size_t block = begin; block < end; block += kPaintBlock) {
      if (context != nullptr && context->is_cancelled()) return;
      const std::size_t block_end = std::min(block + kPaintBlock, end);
      if (!range_reached || !shape_.may_cover(model_box(surface_, block, block_end), of_range, of_block))
        continue;
      for (std::size_t i = block; i < block_end; ++i)
        covered[i - begin] = faces(i) && shape_.covers(place(i), texcoord(i), of_block) ? 1 : 0;
    }
  }

 private:
  void cover_by_model(std::size_t begin, std::size_t end, std::uint8_t* covered,
                      const ExecutionContext* context) const {
    RegionDistances scratch;
    for (std::size_t block = begin; block < end; block += kPaintBlock) {
      if (context != nullptr && context->is_cancelled()) return;
      const std::size_t block_end = std::min(block + kPaintBlock, end);
      model_->cover(surface_.position, block, block_end, covered + (block - begin), scratch);
      for (std::size_t i = block; i < block_end; ++i)
        covered[i - begin] = covered[i - begin] != 0 && faces(i) ? 1 : 0;
    }
  }
  [[nodiscard]] bool faces(std::size_t i) const {
    return !facing_ || surface_.normal[i].cast<double>().dot(*facing_) > 0.0;
  }
  [[nodiscard]] Vec3d place(std::size_t i) const {
    return surface_.origin + surface_.position[i].cast<double>();
  }
  [[nodiscard]] const TexCoord* texcoord(std::size_t i) const {
    if (surface_.texcoord == nullptr || surface_.texcoord->empty()) return nullptr;
    return &(*surface_.texcoord)[i];
  }

  const PaintSurface& surface_;
  const std::optional<Vec3d>& facing_;
  CulledShape shape_;
  std::optional<ModelCover> model_;
  const SampleMask* members_ = nullptr;
};

// What becomes of a sample, whether the operation covers it or not.
enum class Change { kStays, kJoins, kLeaves, kSwaps };
struct Changes {
  Change covered = Change::kStays;
  Change uncovered = Change::kStays;
};

Changes changes_of(PaintMode mode) {
  switch (mode) {
    case PaintMode::kAdd:
    case PaintMode::kGrow:
    case PaintMode::kFlood:
      return {.covered = Change::kJoins};
    case PaintMode::kRemove:
    case PaintMode::kShrink:
      return {.covered = Change::kLeaves};
    case PaintMode::kIntersect:
      return {.uncovered = Change::kLeaves};
    case PaintMode::kSet:
      return {.covered = Change::kJoins, .uncovered = Change::kLeaves};
    case PaintMode::kInvert:
      return {.covered = Change::kSwaps, .uncovered = Change::kSwaps};
    case PaintMode::kClear:
      return {.covered = Change::kLeaves, .uncovered = Change::kLeaves};
  }
  return {};
}

std::uint8_t changed_mark(std::uint8_t mark, Change change, std::uint8_t own, std::uint8_t other,
                          bool steal) {
  if (change == Change::kSwaps) change = (mark & own) != 0 ? Change::kLeaves : Change::kJoins;
  switch (change) {
    case Change::kJoins:
      return static_cast<std::uint8_t>((mark | own) & (steal ? ~other : 0xff));
    case Change::kLeaves:
      return static_cast<std::uint8_t>(mark & ~own);
    case Change::kStays:
    case Change::kSwaps:
      break;
  }
  return mark;
}

SampleMask marked(const Marks& marks, std::uint8_t bit) {
  SampleMask mask(marks.size());
  std::ranges::transform(marks, mask.begin(), [bit](std::uint8_t mark) { return (mark & bit) != 0 ? 1 : 0; });
  return mask;
}

// The samples that growing takes in, or that shrinking gives up.
SampleMask at_border(const PaintOperation& operation, std::uint8_t own, const Points& position,
                     const Marks& marks, const ExecutionContext* context) {
  SampleMask side = marked(marks, own);
  if (operation.mode == PaintMode::kShrink) {
    for (std::uint8_t& member : side) member ^= 1U;
  }
  return near_members(position, side, operation.distance, context);
}

Error distance_error(ErrorCode code, const char* message, double limit, double actual) {
  Error error{.code = code, .message = message, .field = "distance"};
  if (code != ErrorCode::kNonFinite) {
    error.limit = limit;
    error.actual = actual;
  }
  return error;
}

Result<void> check_distance(double distance) {
  if (!std::isfinite(distance))
    return distance_error(ErrorCode::kNonFinite, "the distance must be finite", 0.0, 0.0);
  if (distance <= 0.0) {
    return distance_error(ErrorCode::kInvalidArgument, "the distance must be greater than 0", 0.0, distance);
  }
  if (distance > kMaxShapeCoordinate) {
    return distance_error(ErrorCode::kOutOfRange, "the distance must be at most 1e12", kMaxShapeCoordinate,
                          distance);
  }
  return {};
}

Result<void> check_flood(const FloodFill& flood) {
  if (auto seed = validate(Sphere{.center = flood.seed, .radius = flood.radius.value_or(1.0)}); !seed) {
    Error error = seed.error();
    error.field = error.field == "shape.radius" ? "radius" : "seed";
    return error;
  }
  if (!flood.angle_rad) return {};
  if (!std::isfinite(*flood.angle_rad))
    return Error{.code = ErrorCode::kNonFinite, .message = "the angle must be finite", .field = "angle"};
  if (*flood.angle_rad < 0.0 || *flood.angle_rad > std::numbers::pi) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the angle must lie between 0 and 180 degrees",
                 .field = "angle",
                 .limit = *flood.angle_rad < 0.0 ? 0.0 : std::numbers::pi,
                 .actual = *flood.angle_rad};
  }
  return {};
}

Result<void> check_facing(const PaintOperation& operation) {
  const auto refused = [](ErrorCode code, const char* message) {
    return Error{.code = code, .message = message, .field = "facing"};
  };
  if (!operation.facing) return {};
  if (!has_shape(operation.mode))
    return refused(ErrorCode::kInvalidArgument, "only modes with a shape have a direction");
  if (!operation.facing->allFinite()) return refused(ErrorCode::kNonFinite, "the direction must be finite");
  if (operation.facing->cwiseAbs().maxCoeff() < kMinDirectionLength)
    return refused(ErrorCode::kInvalidArgument, "the direction must not be zero");
  return {};
}

}  // namespace

bool has_shape(PaintMode mode) {
  return mode == PaintMode::kAdd || mode == PaintMode::kRemove || mode == PaintMode::kIntersect ||
         mode == PaintMode::kSet;
}

bool has_distance(PaintMode mode) {
  return mode == PaintMode::kGrow || mode == PaintMode::kShrink;
}

Result<void> validate(const PaintOperation& operation) {
  if (has_shape(operation.mode)) {
    if (auto shape = validate(operation.shape); !shape) return shape;
  }
  if (has_distance(operation.mode)) {
    if (auto distance = check_distance(operation.distance); !distance) return distance;
  }
  if (operation.mode == PaintMode::kFlood) {
    if (auto flood = check_flood(operation.flood); !flood) return flood;
  }
  return check_facing(operation);
}

bool depends_on_sampling(const PaintOperation& operation) {
  if (has_shape(operation.mode)) return operation.facing || depends_on_sampling(operation.shape);
  return has_distance(operation.mode) || operation.mode == PaintMode::kFlood;
}

SampleMask covered_samples(const PaintOperation& operation, RegionKind kind, const PaintSurface& surface,
                           const Marks& marks, const ExecutionContext* context) {
  const std::size_t n = surface.position.size();
  POINTWRIGHT_CHECK(marks.size() == n, "one mark per sample");
  if (has_distance(operation.mode))
    return at_border(operation, bit_of(kind), surface.position, marks, context);
  if (operation.mode == PaintMode::kFlood) {
    POINTWRIGHT_CHECK(surface.graph != nullptr && surface.graph->count == n, "the graph of the samples");
    SampleMask blocked;
    if (operation.flood.stop_at_other) blocked = marked(marks, other_bit(kind));
    return flood_fill(surface, operation.flood, blocked, context);
  }
  SampleMask covered(n, 0);
  if (!has_shape(operation.mode)) return covered;
  POINTWRIGHT_CHECK(!operation.facing || surface.normal.size() == n, "one normal per sample");
  POINTWRIGHT_CHECK(has_its_data(operation.shape), "the image or model of the shape");
  POINTWRIGHT_CHECK(
      !needs_texcoord(operation.shape) || (surface.texcoord != nullptr && surface.texcoord->size() == n),
      "one texture coordinate per sample");
  const ShapeCover shape(operation, surface, context);
  parallel_for(
      n,
      [&](std::size_t begin, std::size_t end) { shape.cover(begin, end, covered.data() + begin, context); },
      kParallelBlock, context);
  const auto* screen = std::get_if<ScreenShape>(&operation.shape);
  if (screen != nullptr && screen->visible && std::ranges::find(covered, 1) != covered.end()) {
    const SampleMask visible = visible_samples(*screen, surface, context);
    std::ranges::transform(covered, visible, covered.begin(),
                           [](std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(a & b); });
  }
  return covered;
}

std::size_t paint(const PaintOperation& operation, RegionKind kind, const PaintSurface& surface, Marks& marks,
                  const ExecutionContext* context) {
  const SampleMask covered = covered_samples(operation, kind, surface, marks, context);
  const Changes changes = changes_of(operation.mode);
  return parallel_sum<std::size_t>(marks.size(), 0, [&](std::size_t begin, std::size_t end) {
    std::size_t changed = 0;
    if (context != nullptr && context->is_cancelled()) return changed;
    for (std::size_t i = begin; i < end; ++i) {
      const Change change = covered[i] != 0 ? changes.covered : changes.uncovered;
      const std::uint8_t mark =
          changed_mark(marks[i], change, bit_of(kind), other_bit(kind), operation.steal);
      changed += mark != marks[i] ? 1 : 0;
      marks[i] = mark;
    }
    return changed;
  });
}

std::size_t count_marked(const Marks& marks, RegionKind kind) {
  return static_cast<std::size_t>(std::count_if(
      marks.begin(), marks.end(), [bit = bit_of(kind)](std::uint8_t mark) { return (mark & bit) != 0; }));
}

}  // namespace pointwright
