#include <utility>

#include "engine/simplification/simplification.h"
#include "engine/smoothing/smoothing_hierarchy.h"

namespace pointwright {

Coarsener contracting_coarsener(const ExecutionContext* context) {
  return [context](const Points& position, const Points& normal,
                   const NeighborGraph& graph) -> Result<Coarsening> {
    // An octave in spacing. The length term keeps the samples even: pure quadrics leave few on flats.
    const SimplifyParams params{
        .target = KeepRatio{0.25}, .order = ContractionOrder::kBatched, .length_weight = 0.05F};
    auto simplified = simplify(position, normal, graph, params, context);
    if (!simplified) return simplified.error();
    Simplification& result = simplified.value();
    return Coarsening{.position = std::move(result.position),
                      .normal = std::move(result.normal),
                      .parent = std::move(result.parent)};
  };
}

}  // namespace pointwright
