#include "server/sessions/drag.h"

#include <utility>

namespace pointwright::server {
namespace {

constexpr std::size_t kKeptSurfaces = 2;

}  // namespace

Drag::Drag(const RestModel& rest, SurfaceState state, std::shared_ptr<const ScaleField> field,
           const EditParams& params)
    : origin_(rest.origin),
      state_(std::move(state)),
      field_(std::move(field)),
      plan_(*state_.surface, state_.samples->graph(), params, *field_),
      free_(kKeptSurfaces) {}

bool Drag::serves(const SurfaceState& state, const std::shared_ptr<const ScaleField>& field,
                  const EditParams& params) const {
  return state.surface == state_.surface && field == field_ && plan_.serves(params);
}

std::shared_ptr<const MultiresSurface> Drag::frame(const EditParams& params) {
  auto surface = free_.take();
  if (surface == nullptr) surface = std::make_unique<MultiresSurface>(*state_.surface);
  apply_edit(*state_.surface, plan_, params, *field_, origin_, *surface);
  return free_.share(std::move(surface));
}

}  // namespace pointwright::server
