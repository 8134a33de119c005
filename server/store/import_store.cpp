#include "server/store/import_store.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/base/displaced.h"
#include "server/base/random_id.h"

namespace pointwright::server {

using protocol::ImportDocument;
using protocol::ImportState;
using protocol::Problem;
using protocol::ProblemKind;

namespace {

bool has_ended(const ImportDocument& import) {
  return import.state == ImportState::kSuccessful || import.state == ImportState::kFailed;
}

}  // namespace

ImportStore::ImportStore(const Limits& limits, std::function<void(const std::string&)> report_failure)
    : max_imports_(limits.max_imports),
      token_imports_(limits.token_imports),
      pool_(static_cast<std::size_t>(limits.max_decoders), 1, std::move(report_failure)) {}

ImportStore::~ImportStore() {
  cancel_all();
}

ImportDocument ImportStore::seen(const Entry& entry) {
  ImportDocument document = entry.document;
  if (document.state == ImportState::kRunning) document.progress = entry.context.progress();
  return document;
}

std::shared_ptr<ImportStore::Entry> ImportStore::find_locked(const std::string& id) const {
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const auto& entry) { return entry->document.id == id; });
  return found == entries_.end() ? nullptr : *found;
}

Outcome<ImportDocument> ImportStore::start(NewImport import, Work work) {
  const auto entry = std::make_shared<Entry>();
  entry->document = {.id = random_id(),
                     .name = std::move(import.name),
                     .bytes = import.bytes,
                     .created = std::chrono::system_clock::now(),
                     .progress = {.phase = "waiting", .fraction = 0.0}};
  entry->owner = std::move(import.owner);
  entry->key = std::move(import.key);
  entry->work = std::move(work);
  ImportDocument begun = entry->document;
  {
    const std::lock_guard lock(mutex_);
    const auto under_way = std::count_if(entries_.begin(), entries_.end(), [&](const auto& each) {
      return each->owner == entry->owner && !has_ended(each->document);
    });
    if (!entry->owner.empty() && static_cast<std::uint64_t>(under_way) >= token_imports_)
      return Problem{
          .kind = ProblemKind::kTooMany,
          .detail = "as many imports of the token are under way as may be (token_imports)",
          .limit = static_cast<double>(token_imports_),
          .actual = static_cast<double>(under_way + 1),
          .retry_after = token_imports_ > 0 ? std::optional(protocol::kPassingSeconds) : std::nullopt};
    if (entries_.size() >= max_imports_) {
      const auto ended = displaced(
          entries_, [](const Entry& each) { return each.owner; },
          [](const Entry& each) { return has_ended(each.document); },
          [](const Entry& each) { return each.ended; });
      if (ended == nullptr)
        return Problem{.kind = ProblemKind::kTooMany,
                       .detail = "as many imports are under way as may be (max_imports)",
                       .limit = static_cast<double>(max_imports_),
                       .actual = static_cast<double>(entries_.size() + 1),
                       .retry_after = protocol::kPassingSeconds};
      std::erase(entries_, ended);
    }
    entries_.push_back(entry);
  }
  pool_.post([this, entry] { run(entry); });
  return begun;
}

void ImportStore::run(const std::shared_ptr<Entry>& entry) {
  Work work;
  {
    const std::lock_guard lock(mutex_);
    work = std::move(entry->work);
    entry->work = nullptr;
    if (entry->context.is_cancelled()) return;  // what it held goes with the work
    entry->document.state = ImportState::kRunning;
  }
  const auto settle = [&](const Outcome<SharedCloud>& cloud) {
    work = nullptr;  // the file and its memory are free before anybody learns of the end
    const std::lock_guard lock(mutex_);
    ImportDocument& document = entry->document;
    document.state = cloud.ok() ? ImportState::kSuccessful : ImportState::kFailed;
    document.progress = entry->context.progress();
    entry->ended = std::chrono::steady_clock::now();
    if (cloud.ok()) {
      document.cloud = cloud.value()->document;
      document.progress = {.phase = "ready", .fraction = 1.0};
    } else {
      document.problem = cloud.problem();
      document.problem->instance = "/v1/imports/" + document.id;
      document.problem->request_id = current_request_id();
    }
  };
  try {
    settle(work(entry->context));
  } catch (const std::bad_alloc&) {
    settle(Problem{.kind = ProblemKind::kOutOfSpace, .detail = "the server has no memory for this cloud"});
    throw;
  } catch (...) {
    // Nobody must wait for it for ever. The pool reports it.
    settle(Problem{.kind = ProblemKind::kInternalError, .detail = "the import failed; the log says why"});
    throw;
  }
}

std::optional<ImportDocument> ImportStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry = find_locked(id);
  if (entry == nullptr) return std::nullopt;
  return seen(*entry);
}

std::optional<ImportDocument> ImportStore::find_key(const std::string& owner, const std::string& key) const {
  const std::lock_guard lock(mutex_);
  for (const auto& entry : entries_)
    if (!key.empty() && entry->key == key && entry->owner == owner) return seen(*entry);
  return std::nullopt;
}

bool ImportStore::has_begun(const std::string& owner, const std::string& idempotency_key) const {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(entries_, [&](const auto& entry) {
    return entry->owner == owner && entry->key.starts_with(idempotency_key + "\n");
  });
}

std::optional<std::string> ImportStore::owner_of(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry = find_locked(id);
  if (entry == nullptr) return std::nullopt;
  return entry->owner;
}

std::vector<ImportDocument> ImportStore::list(const std::function<bool(const std::string&)>& may_see) const {
  const std::lock_guard lock(mutex_);
  std::vector<ImportDocument> documents;
  for (const auto& entry : entries_)
    if (may_see(entry->owner)) documents.push_back(seen(*entry));
  return documents;
}

bool ImportStore::remove(const std::string& id) {
  Work work;  // what it holds is let go outside the lock
  const std::lock_guard lock(mutex_);
  const auto entry = find_locked(id);
  if (entry == nullptr) return false;
  entry->context.cancel();
  work = std::move(entry->work);
  std::erase(entries_, entry);
  return true;
}

void ImportStore::cancel_all() {
  const std::lock_guard lock(mutex_);
  for (const auto& entry : entries_) entry->context.cancel();
}

}  // namespace pointwright::server
