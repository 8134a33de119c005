#include "server/store/cloud_store.h"

#include <algorithm>

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

CloudStore::CloudStore(const Limits& limits)
    : max_clouds_(limits.max_clouds), memory_(limits.max_cloud_bytes) {}

Outcome<Done> CloudStore::check_room_locked() const {
  if (clouds_.size() < max_clouds_) return Done{};
  return Problem{.kind = ProblemKind::kTooMany,
                 .detail = "the server holds as many clouds as it may",
                 .limit = static_cast<double>(max_clouds_),
                 .actual = static_cast<double>(clouds_.size())};
}

Outcome<Done> CloudStore::check_room() const {
  const std::lock_guard lock(mutex_);
  return check_room_locked();
}

Outcome<SharedCloud> CloudStore::add(protocol::CloudDocument document, Cloud cloud) {
  const std::uint64_t bytes = memory_of(cloud);
  auto stored = std::make_shared<StoredCloud>();
  stored->memory = memory_.hold(bytes);
  if (stored->memory == nullptr)
    return Problem{.kind = ProblemKind::kOutOfSpace,
                   .detail = "the memory for clouds is used up",
                   .limit = static_cast<double>(memory_.total()),
                   .actual = static_cast<double>(memory_.held() + bytes)};
  stored->document = std::move(document);
  stored->cloud = std::make_shared<const Cloud>(std::move(cloud));
  const std::lock_guard lock(mutex_);
  if (auto room = check_room_locked(); !room.ok()) return room.problem();
  clouds_.push_back(stored);
  return SharedCloud(stored);
}

SharedCloud CloudStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it =
      std::find_if(clouds_.begin(), clouds_.end(), [&](const auto& c) { return c->document.id == id; });
  return it == clouds_.end() ? nullptr : *it;
}

std::shared_ptr<const void> CloudStore::use(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it =
      std::find_if(clouds_.begin(), clouds_.end(), [&](const auto& c) { return c->document.id == id; });
  if (it == clouds_.end()) return nullptr;
  ++(*it)->users;
  return {it->get(), [cloud = *it](const void*) { --cloud->users; }};
}

std::vector<SharedCloud> CloudStore::list() const {
  const std::lock_guard lock(mutex_);
  return clouds_;
}

Outcome<Done> CloudStore::remove(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto it =
      std::find_if(clouds_.begin(), clouds_.end(), [&](const auto& c) { return c->document.id == id; });
  if (it == clouds_.end()) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such cloud"};
  if ((*it)->users > 0)
    return Problem{.kind = ProblemKind::kCloudInUse,
                   .detail = "sessions use this cloud; delete them first",
                   .actual = static_cast<double>((*it)->users)};
  clouds_.erase(it);
  return Done{};
}

}  // namespace pointwright::server
