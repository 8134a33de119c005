#include "engine/editing/resolved_painting.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "engine/editing/ball_cover.h"

namespace pointwright {
namespace {

using Operations = std::vector<PaintOperation>;

bool is_none(const SampleMask& mask) {
  return std::ranges::all_of(mask, [](std::uint8_t entry) { return entry == 0; });
}

// The shape without its filters, where nothing but filters depends on the sampling.
std::optional<PaintOperation> unfiltered(PaintOperation operation) {
  operation.facing.reset();
  if (auto* screen = std::get_if<ScreenShape>(&operation.shape)) screen->visible = false;
  if (depends_on_sampling(operation)) return {};
  return operation;
}

// One surface under one operation.
class Resolver {
 public:
  Resolver(const PaintSurface& surface, bool steal, const ExecutionContext* context)
      : surface_(surface), steal_(steal), context_(context) {}

  // The samples of the mask join or leave.
  [[nodiscard]] Operations each(PaintMode mode, const SampleMask& mask) const {
    return cover_operations(mode, mask, surface_.position, surface_.origin, steal_, context_);
  }

  // Exactly the samples of the mask.
  [[nodiscard]] Operations set(const SampleMask& mask) const {
    Operations operations = each(PaintMode::kAdd, mask);
    if (operations.empty()) return {{.mode = PaintMode::kClear}};
    operations.front().mode = PaintMode::kSet;
    return operations;
  }

  // Samples outside the mask leave.
  [[nodiscard]] Operations keep(SampleMask mask) const {
    Operations operations = each(PaintMode::kIntersect, mask);
    if (operations.empty()) return {{.mode = PaintMode::kClear}};
    if (operations.size() == 1) return operations;
    // An intersection has one shape: the others leave piece by piece.
    for (std::uint8_t& entry : mask) entry ^= 1U;
    return each(PaintMode::kRemove, mask);
  }

 private:
  const PaintSurface& surface_;
  bool steal_;
  const ExecutionContext* context_;
};

}  // namespace

Operations resolved(const PaintOperation& operation, RegionKind kind, const PaintSurface& surface,
                    const Marks& marks, const ExecutionContext* context) {
  if (!depends_on_sampling(operation)) return {operation};
  SampleMask covered = covered_samples(operation, kind, surface, marks, context);
  if (has_shape(operation.mode) && !is_none(covered)) {
    const std::optional<PaintOperation> plain = unfiltered(operation);
    if (plain && covered_samples(*plain, kind, surface, marks, context) == covered) return {*plain};
  }
  const Resolver resolver(surface, operation.steal, context);
  const auto own = static_cast<unsigned>(kind);
  switch (operation.mode) {
    case PaintMode::kAdd:
    case PaintMode::kFlood:
      return resolver.each(PaintMode::kAdd, covered);
    case PaintMode::kRemove:
      return resolver.each(PaintMode::kRemove, covered);
    case PaintMode::kIntersect:
      return resolver.keep(std::move(covered));
    case PaintMode::kSet:
      return resolver.set(covered);
    case PaintMode::kGrow:
      if (is_none(covered)) return {};
      // Members join once more, but for those that stealing would take out of the other region.
      for (std::size_t i = 0; i < marks.size(); ++i) {
        if (operation.steal ? marks[i] == own : (marks[i] & own) != 0) covered[i] = 1;
      }
      return resolver.each(PaintMode::kAdd, covered);
    case PaintMode::kShrink:
      if (is_none(covered)) return {};
      for (std::size_t i = 0; i < marks.size(); ++i)
        covered[i] = (marks[i] & own) != 0 && covered[i] == 0 ? 1 : 0;
      return resolver.keep(std::move(covered));
    case PaintMode::kInvert:
    case PaintMode::kClear:
      break;
  }
  return {operation};
}

std::vector<PaintOperation> cover_operations(PaintMode mode, const SampleMask& mask, const Points& position,
                                             const Vec3d& origin, bool steal,
                                             const ExecutionContext* context) {
  std::vector<PaintOperation> operations;
  for (PointSet& set : ball_cover(position, mask, origin, context)) {
    PaintOperation& operation = operations.emplace_back();
    operation.mode = mode;
    operation.shape.emplace<PointSet>(std::move(set));
    operation.steal = steal;
  }
  return operations;
}

}  // namespace pointwright
