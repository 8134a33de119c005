#include "server/store/cloud_store.h"

#include <algorithm>
#include <type_traits>

#include "server/base/sha256.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

template <typename T>
void add_column(std::string& hashes, const T* values, std::size_t count) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (count == 0) {
    hashes += "-";
    return;
  }
  hashes += sha256_hex({reinterpret_cast<const std::byte*>(values), count * sizeof(T)});
}

auto is_cloud(const std::string& id) {
  return [&id](const SharedCloud& cloud) { return cloud->document.id == id; };
}

}  // namespace

std::string cloud_hash(const Cloud& cloud) {
  std::string hashes = "pointwright cloud\n";
  add_column(hashes, cloud.origin.data(), 3);
  for (const Points* points : {&cloud.position, &cloud.normal})
    for (const float* column : {points->x(), points->y(), points->z()})
      add_column(hashes, column, points->size());
  add_column(hashes, cloud.color.data(), cloud.color.size());
  add_column(hashes, cloud.texcoord.data(), cloud.texcoord.size());
  add_column(hashes, cloud.id.data(), cloud.id.size());
  add_column(hashes, cloud.exact_position.data(), cloud.exact_position.size());
  hashes += cloud.color_has_alpha ? "a" : "-";
  hashes += cloud.position_is_double ? "d" : "-";
  for (const ScalarAttribute& scalar : cloud.scalars) {
    add_column(hashes, scalar.name.data(), scalar.name.size());
    hashes += std::to_string(scalar.values.index());
    std::visit([&](const auto& values) { add_column(hashes, values.data(), values.size()); }, scalar.values);
  }
  return sha256_hex(std::as_bytes(std::span(hashes.data(), hashes.size())));
}

CloudStore::CloudStore(const Limits& limits, Archive* archive, CloudLoader load)
    : archive_(archive),
      load_(std::move(load)),
      memory_(limits.max_cloud_bytes),
      places_("clouds", limits.max_clouds) {}

Problem CloudStore::out_of_space(std::uint64_t bytes) const {
  return {.kind = ProblemKind::kOutOfSpace,
          .detail = "the memory for clouds is used up",
          .limit = static_cast<double>(memory_.total()),
          .actual = static_cast<double>(memory_.held() + bytes)};
}

std::shared_ptr<void> CloudStore::room_for(std::uint64_t bytes, const StoredCloud* loading) const {
  std::shared_ptr<void> memory = memory_.hold(bytes);
  if (memory != nullptr || archive_ == nullptr || bytes > memory_.total()) return memory;
  std::vector<SharedCloud> oldest = list();
  std::sort(oldest.begin(), oldest.end(),
            [](const SharedCloud& a, const SharedCloud& b) { return a->asked_.load() < b->asked_.load(); });
  for (const SharedCloud& cloud : oldest) {
    if (cloud.get() == loading) continue;
    const std::unique_lock lock(cloud->mutex_, std::try_to_lock);  // who has it is about to use it
    if (!lock.owns_lock() || cloud->cloud_ == nullptr || cloud->cloud_.use_count() > 1) continue;
    cloud->cloud_.reset();
    cloud->memory_.reset();
    memory = memory_.hold(bytes);
    if (memory != nullptr) break;
  }
  return memory;
}

void CloudStore::restore(std::vector<KeptCloud> clouds) {
  const std::lock_guard lock(mutex_);
  for (KeptCloud& kept : clouds) {
    auto stored = std::make_shared<StoredCloud>();
    stored->document = std::move(kept.document);
    stored->source = kept.source;
    stored->content = std::move(kept.content);
    stored->owner = std::move(kept.owner);
    stored->quota = std::move(kept.quota);
    clouds_.push_back(std::move(stored));
  }
}

Outcome<Done> CloudStore::check_room() const {
  const std::lock_guard lock(mutex_);
  return places_.check(clouds_.size());
}

Outcome<SharedCloud> CloudStore::add(NewCloud cloud, const BlobContent& file,
                                     const Seal<protocol::CloudDocument>& seal) {
  const std::uint64_t bytes = memory_of(cloud.cloud);
  auto stored = std::make_shared<StoredCloud>();
  stored->memory_ = room_for(bytes, nullptr);
  stored->asked_ = ++asking_;
  if (stored->memory_ == nullptr) return out_of_space(bytes);
  stored->document = std::move(cloud.document);
  stored->owner = std::move(cloud.owner);
  stored->quota = std::move(cloud.quota);
  stored->source = cloud.source;
  if (archive_ != nullptr) stored->content = cloud_hash(cloud.cloud);
  stored->cloud_ = std::make_shared<const Cloud>(std::move(cloud.cloud));
  auto entered = places_.enter(mutex_, clouds_, stored, [&]() -> Outcome<Done> {
    if (archive_ == nullptr) return Done{};
    std::optional<KeptAnswer> answer;
    if (seal) answer = seal(stored->document);
    return archive_->add({.document = stored->document,
                          .source = stored->source,
                          .content = stored->content,
                          .owner = stored->owner},
                         file, answer ? &*answer : nullptr);
  });
  if (!entered.ok()) return entered.problem();
  return SharedCloud(stored);
}

SharedCloud CloudStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(clouds_.begin(), clouds_.end(), is_cloud(id));
  return it == clouds_.end() ? nullptr : *it;
}

SharedCloud CloudStore::find(const std::string& sha256, const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(clouds_.begin(), clouds_.end(), [&](const SharedCloud& cloud) {
    return cloud->document.sha256 == sha256 && cloud->document.name == name;
  });
  return it == clouds_.end() ? nullptr : *it;
}

Outcome<std::shared_ptr<const Cloud>> CloudStore::samples_of(const StoredCloud& cloud) const {
  const std::lock_guard lock(cloud.mutex_);
  cloud.asked_ = ++asking_;
  if (cloud.cloud_ != nullptr) return cloud.cloud_;
  POINTWRIGHT_CHECK(archive_ != nullptr && load_, "samples that are not there come from an archive");
  const auto file = archive_->open_file(cloud.document.sha256);
  if (!file.ok()) return file.problem();
  auto loaded = load_({file.value()->file.get(), file.value()->size}, cloud.source);
  if (!loaded.ok()) return loaded.problem();
  if (cloud_hash(loaded.value()) != cloud.content)
    return Problem{.kind = ProblemKind::kDamaged,
                   .detail = "the stored file no longer gives the samples that it gave: they are not served"};
  const std::uint64_t bytes = memory_of(loaded.value());
  auto memory = room_for(bytes, &cloud);
  if (memory == nullptr && bytes > memory_.total()) return out_of_space(bytes);
  if (memory == nullptr)
    return Problem{.kind = ProblemKind::kOverloaded,
                   .detail = "clouds that are in use take the memory for clouds",
                   .limit = static_cast<double>(memory_.total()),
                   .actual = static_cast<double>(memory_.held() + bytes)};
  cloud.memory_ = std::move(memory);
  cloud.cloud_ = std::make_shared<const Cloud>(std::move(loaded.value()));
  return cloud.cloud_;
}

void CloudStore::let_go(const StoredCloud& cloud) const {
  const std::lock_guard lock(cloud.mutex_);
  if (archive_ == nullptr || !load_ || cloud.cloud_.use_count() != 1) return;
  cloud.cloud_.reset();
  cloud.memory_.reset();
}

std::shared_ptr<const void> CloudStore::use(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(clouds_.begin(), clouds_.end(), is_cloud(id));
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
  const auto it = std::find_if(clouds_.begin(), clouds_.end(), is_cloud(id));
  if (it == clouds_.end()) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such cloud"};
  if ((*it)->users > 0)
    return Problem{.kind = ProblemKind::kCloudInUse,
                   .detail = "sessions use this cloud; delete them first",
                   .actual = static_cast<double>((*it)->users)};
  if (archive_ != nullptr)
    if (auto removed = archive_->remove_cloud(id, (*it)->document.sha256); !removed.ok()) return removed;
  clouds_.erase(it);
  return Done{};
}

}  // namespace pointwright::server
