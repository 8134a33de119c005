#include "server/sessions/painter.h"

#include <algorithm>
#include <utility>

#include "engine/editing/resolved_painting.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

PaintSurface paint_surface(const SurfaceState& state) {
  const Level& finest = state.surface->finest();
  return {.position = finest.position,
          .normal = finest.normal,
          .origin = state.samples->cloud().origin,
          .graph = &state.samples->graph(),
          .texcoord = &state.samples->cloud().texcoord};
}

Painter::Painter(const SessionParams& params, const PaintSurface& surface, const Painting& zero,
                 const Painting& one)
    : params_(params), surface_(surface), zero_(recording_of(zero)), one_(recording_of(one)) {}

Painter::Recording Painter::recording_of(const Painting& painting) {
  if (painting.operations == nullptr) return {};
  return {.operations = *painting.operations, .vertices = painting.vertices};
}

Outcome<Done> Painter::record(Recording& recording, std::vector<PaintOperation> operations) const {
  const std::size_t count = recording.operations.size() + operations.size();
  if (count > params_.max_operations)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the region has as many operations as a painting may have",
                   .limit = static_cast<double>(params_.max_operations),
                   .actual = static_cast<double>(count)};
  std::size_t vertices = recording.vertices;
  for (const PaintOperation& operation : operations) vertices += vertex_count(operation.shape);
  if (vertices > params_.max_painting_vertices)
    return Problem{.kind = ProblemKind::kTooManySamples,
                   .detail = "the shapes of the region have more vertices than a painting may have",
                   .limit = static_cast<double>(params_.max_painting_vertices),
                   .actual = static_cast<double>(vertices)};
  recording.vertices = vertices;
  for (PaintOperation& operation : operations)
    recording.operations.push_back(std::make_shared<const PaintOperation>(std::move(operation)));
  return Done{};
}

Outcome<Done> Painter::paint(RegionKind kind, const PaintOperation& operation, Marks& marks,
                             const ExecutionContext& context) {
  std::vector<PaintOperation> recorded = resolved(operation, kind, surface_, marks, &context);
  if (context.is_cancelled()) return Done{};
  SampleMask stolen;
  const auto other = kind == RegionKind::kZero ? RegionKind::kOne : RegionKind::kZero;
  const auto others = static_cast<unsigned>(other);
  if (operation.steal) {
    stolen.resize(marks.size());
    std::ranges::transform(marks, stolen.begin(), [&](std::uint8_t mark) { return mark & others; });
  }
  for (PaintOperation& each : recorded) {
    pointwright::paint(each, kind, surface_, marks, &context);
    each.steal = false;
  }
  if (auto fits = record(kind == RegionKind::kZero ? zero_ : one_, std::move(recorded)); !fits.ok())
    return fits;
  for (std::size_t i = 0; i < stolen.size(); ++i)
    stolen[i] = stolen[i] != 0 && (marks[i] & others) == 0 ? 1 : 0;
  if (std::ranges::find(stolen, 1) == stolen.end()) return Done{};
  return record(
      other == RegionKind::kZero ? zero_ : one_,
      cover_operations(PaintMode::kRemove, stolen, surface_.position, surface_.origin, false, &context));
}

Painting Painter::finish(RegionKind kind, const Marks& marks) const {
  const Recording& recording = kind == RegionKind::kZero ? zero_ : one_;
  return {.samples = count_marked(marks, kind),
          .vertices = recording.vertices,
          .operations = std::make_shared<const OperationList>(recording.operations)};
}

}  // namespace pointwright::server
