#include "server/sessions/drag.h"

#include <mutex>
#include <utility>
#include <vector>

namespace pointwright::server {

// Surfaces that nobody looks at any more, equal to the drag's but for what moves.
struct Drag::Free {
  static constexpr std::size_t kKept = 2;

  std::mutex mutex;
  std::vector<std::unique_ptr<MultiresSurface>> surfaces;

  Free() { surfaces.reserve(kKept); }  // nothing can fail when a frame is dropped
  std::unique_ptr<MultiresSurface> take() {
    const std::lock_guard lock(mutex);
    if (surfaces.empty()) return nullptr;
    auto surface = std::move(surfaces.back());
    surfaces.pop_back();
    return surface;
  }
  void give(std::unique_ptr<MultiresSurface> surface) {
    const std::lock_guard lock(mutex);
    if (surfaces.size() < kKept) surfaces.push_back(std::move(surface));
  }
};

Drag::Drag(const RestModel& rest, SurfaceState state, std::shared_ptr<const ScaleField> field,
           const EditParams& params)
    : origin_(rest.origin),
      state_(std::move(state)),
      field_(std::move(field)),
      plan_(*state_.surface, state_.samples->graph(), params, *field_),
      free_(std::make_shared<Free>()) {}

Drag::~Drag() = default;

bool Drag::serves(const SurfaceState& state, const std::shared_ptr<const ScaleField>& field,
                  const EditParams& params) const {
  return state.surface == state_.surface && field == field_ && plan_.serves(params);
}

std::shared_ptr<const MultiresSurface> Drag::frame(const EditParams& params) {
  auto surface = free_->take();
  if (surface == nullptr) surface = std::make_unique<MultiresSurface>(*state_.surface);
  apply_edit(*state_.surface, plan_, params, *field_, origin_, *surface);
  return {surface.release(), [home = std::weak_ptr<Free>(free_)](MultiresSurface* dropped) {
            std::unique_ptr<MultiresSurface> owned(dropped);
            if (const auto free = home.lock()) free->give(std::move(owned));
          }};
}

}  // namespace pointwright::server
