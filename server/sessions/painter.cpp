#include "server/sessions/painter.h"

#include <utility>

#include "engine/editing/resolved_painting.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

PaintSurface paint_surface(const RestModel& rest, const SurfaceState& state) {
  const Level& finest = state.surface->finest();
  return {.position = finest.position,
          .normal = finest.normal,
          .origin = rest.cloud->origin,
          .graph = rest.graph.get(),
          .texcoord = &rest.cloud->texcoord};
}

Painter::Painter(const SessionParams& params, const PaintSurface& surface, RegionKind kind,
                 const Painting& before)
    : params_(params), surface_(surface), kind_(kind), vertices_(before.vertices) {
  if (before.operations != nullptr) operations_ = *before.operations;
}

Outcome<Done> Painter::paint(const PaintOperation& operation, Marks& marks, const ExecutionContext& context) {
  std::vector<PaintOperation> recorded = resolved(operation, kind_, surface_, marks, &context);
  if (context.is_cancelled()) return Done{};
  const std::size_t count = operations_.size() + recorded.size();
  if (count > params_.max_operations)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the region has as many operations as a painting may have",
                   .limit = static_cast<double>(params_.max_operations),
                   .actual = static_cast<double>(count)};
  std::size_t vertices = vertices_;
  for (const PaintOperation& each : recorded) vertices += vertex_count(each.shape);
  if (vertices > params_.max_painting_vertices)
    return Problem{.kind = ProblemKind::kTooManySamples,
                   .detail = "the shapes of the region have more vertices than a painting may have",
                   .limit = static_cast<double>(params_.max_painting_vertices),
                   .actual = static_cast<double>(vertices)};
  vertices_ = vertices;
  for (PaintOperation& each : recorded) {
    pointwright::paint(each, kind_, surface_, marks, &context);
    operations_.push_back(std::make_shared<const PaintOperation>(std::move(each)));
  }
  return Done{};
}

Painting Painter::finish(const Marks& marks) const {
  return {.samples = count_marked(marks, kind_),
          .vertices = vertices_,
          .operations = std::make_shared<const OperationList>(operations_)};
}

}  // namespace pointwright::server
