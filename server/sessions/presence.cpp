#include "server/sessions/presence.h"

#include <utility>

namespace pointwright::server {

std::shared_ptr<const void> Presence::join(std::string name) {
  struct Handle {
    std::shared_ptr<Presence> presence;
    std::list<protocol::Viewer>::iterator viewer;
    Handle(std::shared_ptr<Presence> where, std::list<protocol::Viewer>::iterator who)
        : presence(std::move(where)), viewer(who) {}
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    ~Handle() {
      {
        const std::lock_guard lock(presence->mutex_);
        presence->viewers_.erase(viewer);
        ++presence->version_;
      }
      presence->changed_();
    }
  };
  std::list<protocol::Viewer> one{{.name = std::move(name), .since = std::chrono::system_clock::now()}};
  // Made first: what comes after it cannot fail.
  auto handle = std::make_shared<Handle>(shared_from_this(), one.begin());
  {
    const std::lock_guard lock(mutex_);
    viewers_.splice(viewers_.end(), one);
    ++version_;
  }
  changed_();
  return handle;
}

Presence::Now Presence::now() const {
  const std::lock_guard lock(mutex_);
  return {.version = version_, .viewers = {viewers_.begin(), viewers_.end()}};
}

std::uint64_t Presence::version() const {
  const std::lock_guard lock(mutex_);
  return version_;
}

}  // namespace pointwright::server
