#include "server/store/session_store.h"

#include <algorithm>
#include <chrono>

#include "engine/multires/normal_stencil.h"
#include "engine/simplification/attributes.h"
#include "engine/simplification/subsample.h"
#include "server/base/random_id.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

/// Bytes a sample of a session with one band: the hierarchy while it is built, then the rest, the committed,
/// the previewed and the shown surface with their fields and frames.
constexpr std::uint64_t kBytesPerSample = 500;
/// What another band adds to a surface: positions, normals and the detail coefficient.
constexpr std::uint64_t kBytesPerBand = 28;
/// Surfaces of a session that are not in its history: the committed, the previewed, the shown, one that is
/// being made, and two whose memory a drag keeps.
constexpr std::uint64_t kLiveSurfaces = 6;
/// What a drag keeps a sample for each band, and while it is prepared once more: the stencils that carry
/// normals. Then shape operators, and a sample's neighbours.
constexpr std::uint64_t kStencilBytes = 4 * NormalStencil::kNeighbors + 16;
constexpr std::uint64_t kShapeBytes = 12;
constexpr std::uint64_t kBytesPerNeighbor = 4;
/// What an inserted sample takes besides, with its cell, its parent and its spacing in the samplings of the
/// committed, the previewed and the shown state. Of those the columns of its cloud come to it.
constexpr std::uint64_t kSamplings = 3;
constexpr std::uint64_t kBytesInSampling = 38;
/// Stored history states that a session may need at most before it thins them out, and the bytes a sample of
/// one with one band.
constexpr std::uint64_t kHistoryStates = 32;
constexpr std::uint64_t kStateBytesPerSample = 52;

constexpr std::chrono::seconds kExpiryInterval{10};
/// A session that could not be brought back is not tried again before.
constexpr std::chrono::seconds kWakePause{1};

/// What choosing so many of N samples takes while it lasts (engine/simplification/subsample.h).
std::uint64_t memory_to_choose(std::uint64_t count, std::uint64_t of) {
  constexpr std::uint64_t kBytesEach = 14;
  constexpr std::uint64_t kBytesPerCandidate = 450;
  constexpr std::uint64_t kCandidates = 8;
  return of * kBytesEach + std::min(of, kCandidates * count) * kBytesPerCandidate;
}

Outcome<ChosenSamples> uniform_subsample(const Cloud& cloud, std::uint64_t count,
                                         const ExecutionContext& context) {
  const auto kept = subsample(cloud.position, cloud.normal, {.target = KeepCount{count}}, &context);
  if (!kept) return protocol::to_problem(kept.error());
  auto index = std::make_shared<std::vector<std::uint32_t>>();
  for (const std::uint32_t i : kept.value()) index->push_back(cloud.id[i]);
  std::sort(index->begin(), index->end());
  return ChosenSamples{.cloud = std::make_shared<const Cloud>(chosen_cloud(cloud, kept.value())),
                       .cloud_index = std::move(index)};
}

Problem no_such_session() {
  return {.kind = ProblemKind::kNotFound, .detail = "there is no such session"};
}

}  // namespace

SessionStore::SessionStore(const Limits& limits, const CloudStore& clouds, SessionServices services,
                           Archive* archive, Removed removed)
    : limits_(limits),
      clouds_(clouds),
      services_(std::move(services)),
      archive_(archive),
      removed_(std::move(removed)),
      memory_(limits.max_session_bytes) {
  if (limits_.session_idle_expiry_s > 0)
    watcher_ = std::jthread([this](const std::stop_token& stop) { watch_expiry(stop); });
}

SessionStore::~SessionStore() {
  watcher_ = {};
  close_all("the server is stopping");
}

bool SessionStore::Entry::is_idle() const {
  return session == nullptr ||
         (session.use_count() == 1 && session->document()->state != protocol::SessionState::kBuilding);
}

bool SessionStore::Entry::may_wake_again() const {
  if (session == nullptr || !woken || std::chrono::steady_clock::now() - *woken < kWakePause) return false;
  const SharedDocument document = session->document();
  return document->state == protocol::SessionState::kFailed && document->error &&
         document->error->kind != ProblemKind::kDamaged;
}

SessionStore::Needs SessionStore::needs_of(const HierarchyParams& params, std::uint64_t samples,
                                           const Cloud& cloud) const {
  const std::uint64_t more_bands = (params.scales.size() - 1) * kBytesPerBand;
  const std::uint64_t drag = (params.scales.size() + 1) * kStencilBytes + kShapeBytes;
  const std::uint64_t graph = params.neighbors * kBytesPerNeighbor;
  const std::uint64_t live_each =
      kBytesPerSample + kLiveSurfaces * more_bands + drag + graph + limits_.max_named_regions;
  const std::uint64_t columns = memory_of(cloud) / std::max<std::uint64_t>(cloud.size(), 1);
  return {.live = samples * live_each,
          .history =
              std::min(limits_.history_bytes, samples * kHistoryStates * (kStateBytesPerSample + more_bands)),
          .inserted_each = live_each + kSamplings * (kBytesInSampling + graph + columns)};
}

SessionParams SessionStore::params_of(const KeptSession& kept, std::uint64_t first, const Needs& needs,
                                      const std::shared_ptr<Budget::Hold>& memory) const {
  const std::uint64_t samples = std::max(first, kept.samples);
  return {.id = kept.id,
          .name = kept.name,
          .owner = kept.owner,
          .cloud_id = kept.cloud,
          .hierarchy = kept.params,
          .history_bytes = needs.history,
          .max_edits = static_cast<std::size_t>(limits_.max_edits),
          .max_operations = static_cast<std::size_t>(limits_.max_operations),
          .max_painting_vertices = static_cast<std::size_t>(limits_.max_painting_vertices),
          .max_named_regions = static_cast<std::size_t>(limits_.max_named_regions),
          .room = std::make_shared<SampleRoom>(std::max(limits_.max_session_samples, samples), memory,
                                               samples, needs.inserted_each),
          .created = kept.created,
          .keeper = archive_ == nullptr ? nullptr : archive_->keeper(kept.id)};
}

Outcome<Done> SessionStore::put_samples(SessionParams& params, const KeptSession& kept,
                                        const SharedCloud& cloud, std::shared_ptr<const Cloud> samples,
                                        std::uint64_t held) {
  if (!kept.preview) {
    params.cloud = std::move(samples);
    return Done{};
  }
  struct Whole {
    std::shared_ptr<const Cloud> samples;
    std::shared_ptr<Budget::Hold> memory;
  };
  const auto whole = std::make_shared<Whole>();
  const std::uint64_t choosing = memory_to_choose(kept.preview->count, samples->size());
  if (choosing > held) {
    auto memory = room_for(choosing - held);
    if (!memory.ok()) return memory.problem();
    whole->memory = std::move(memory.value());
  }
  const protocol::ModelBounds bounds{.min = cloud->document.report.bounds_min,
                                     .max = cloud->document.report.bounds_max};
  params.preview = {
      .size = *kept.preview,
      .origin = samples->origin,
      .bounds = bounds,
      .diagonal = bounds_of(samples->position).diagonal(),
      .choose = [this, cloud, whole, count = kept.preview->count](const ExecutionContext& context) {
        const std::shared_ptr<Budget::Hold> memory = std::move(whole->memory);
        auto chosen = uniform_subsample(*whole->samples, count, context);
        whole->samples.reset();
        clouds_.let_go(*cloud);
        return chosen;
      }};
  whole->samples = std::move(samples);
  return Done{};
}

std::vector<SessionStore::Entry>::iterator SessionStore::entry_of(const std::string& id) {
  return std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.kept.id == id; });
}

void SessionStore::restore(std::vector<KeptSession> sessions) {
  const std::lock_guard lock(mutex_);
  for (KeptSession& kept : sessions) {
    Entry entry;
    entry.cloud_use = clouds_.use(kept.cloud);
    if (entry.cloud_use == nullptr && !kept.damage) kept.damage = "what is stored of its cloud is damaged";
    entry.quota = std::move(kept.quota);
    entry.kept = std::move(kept);
    entry.kept.used = std::chrono::system_clock::now();  // nobody could ask while nothing ran
    entries_.push_back(std::move(entry));
  }
}

void SessionStore::put_to_sleep(Entry& entry) {
  const SharedDocument document = entry.session->document();
  entry.kept.name = document->name;
  entry.kept.revision = document->revision;
  entry.kept.head = document->head;
  if (document->surface.samples != nullptr) entry.kept.samples = document->surface.samples->size();
  if (document->error && document->error->kind == ProblemKind::kDamaged)
    entry.kept.damage = document->error->detail;
  entry.session.reset();  // all of it is in the archive
  entry.memory.reset();
}

Outcome<std::shared_ptr<Budget::Hold>> SessionStore::room_for(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  if (auto memory = memory_.hold(bytes)) return memory;
  const auto refused = [&](ProblemKind kind, const char* detail) {
    return Problem{.kind = kind,
                   .detail = detail,
                   .limit = static_cast<double>(memory_.total()),
                   .actual = static_cast<double>(memory_.held() + bytes)};
  };
  if (archive_ == nullptr || bytes > memory_.total())
    return refused(ProblemKind::kOutOfSpace, "the memory for sessions is used up");
  std::vector<Entry*> idle;
  std::uint64_t gain = memory_.total() - std::min(memory_.held(), memory_.total());
  for (Entry& entry : entries_) {
    if (entry.session == nullptr || !entry.is_idle()) continue;
    idle.push_back(&entry);
    gain += entry.bytes;
  }
  if (gain < bytes)
    return refused(ProblemKind::kOverloaded, "sessions that are in use take the memory for sessions");
  std::stable_sort(idle.begin(), idle.end(),
                   [](const Entry* a, const Entry* b) { return a->kept.used < b->kept.used; });
  for (Entry* entry : idle) {
    put_to_sleep(*entry);
    if (auto memory = memory_.hold(bytes)) return memory;
  }
  return refused(ProblemKind::kOverloaded, "sessions that are in use take the memory for sessions");
}

Outcome<std::shared_ptr<Session>> SessionStore::create(const protocol::CreateSessionRequest& request,
                                                       const Caller& caller,
                                                       std::shared_ptr<const void> quota,
                                                       const Seal<std::shared_ptr<Session>>& seal) {
  Entry entry;
  entry.quota = std::move(quota);
  entry.cloud_use = clouds_.use(request.cloud);
  const SharedCloud cloud = entry.cloud_use == nullptr ? nullptr : clouds_.find(request.cloud);
  if (cloud == nullptr || !caller.may_see(cloud->owner))
    return Problem{.kind = ProblemKind::kNotFound,
                   .detail = "there is no cloud with that id",
                   .errors = {{.pointer = "/cloud", .detail = "no such cloud"}}};
  auto samples = clouds_.samples_of(*cloud);
  if (!samples.ok()) return samples.problem();
  {
    const std::lock_guard lock(mutex_);
    if (entries_.size() + coming_ >= limits_.max_sessions)
      return Problem{.kind = ProblemKind::kTooMany,
                     .detail = "the server holds as many sessions as it may",
                     .limit = static_cast<double>(limits_.max_sessions),
                     .actual = static_cast<double>(entries_.size() + coming_)};
    ++coming_;
  }
  const std::shared_ptr<const void> counted(nullptr, [this](const void*) {
    const std::lock_guard lock(mutex_);
    --coming_;
  });
  const std::uint64_t whole = samples.value()->size();
  const std::uint64_t first = std::min(whole, request.preview.value_or(whole));
  const Needs needs = needs_of(request.params, first, *samples.value());
  entry.bytes = needs.live + needs.history;
  auto memory = room_for(entry.bytes);
  if (!memory.ok()) return memory.problem();
  entry.memory = std::move(memory.value());
  const auto now = std::chrono::system_clock::now();
  entry.kept = {.id = random_id(),
                .owner = caller.token,
                .cloud = request.cloud,
                .name = request.name.empty() ? cloud->document.name : request.name,
                .params = request.params,
                .created = now,
                .used = now,
                .samples = first,
                .damage = std::nullopt};
  if (first < whole) entry.kept.preview = {.count = first, .of = whole};
  SessionParams params = params_of(entry.kept, first, needs, entry.memory);
  if (auto put = put_samples(params, entry.kept, cloud, std::move(samples.value()), entry.bytes); !put.ok())
    return put.problem();
  const auto session = Session::make(std::move(params), services_);
  if (archive_ != nullptr) {
    std::optional<KeptAnswer> answer;
    if (seal) answer = seal(session);
    auto kept = archive_->add(entry.kept, answer ? &*answer : nullptr);
    if (!kept.ok()) return kept.problem();
  }
  entry.session = session;
  {
    const std::lock_guard lock(mutex_);
    entries_.push_back(std::move(entry));
  }
  session->start();
  return session;
}

Outcome<std::shared_ptr<Session>> SessionStore::get(const std::string& id) {
  std::shared_ptr<std::mutex> turn;
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entry_of(id);
    if (entry == entries_.end()) return no_such_session();
    entry->kept.used = std::chrono::system_clock::now();
    if (entry->session != nullptr && !entry->may_wake_again()) return entry->session;
    turn = entry->turn;
  }
  const std::lock_guard waking(*turn);
  return wake(id);
}

void SessionStore::mark_damaged(const std::string& id, const std::string& reason) {
  archive_->keeper(id)->give_up(reason);
  const std::lock_guard lock(mutex_);
  const auto entry = entry_of(id);
  if (entry != entries_.end()) entry->kept.damage = reason;
}

Outcome<std::shared_ptr<Session>> SessionStore::wake(const std::string& id) {
  KeptSession kept;
  std::shared_ptr<Session> failed;
  std::shared_ptr<Budget::Hold> its_memory;
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entry_of(id);
    if (entry == entries_.end()) return no_such_session();
    if (entry->session != nullptr && !entry->may_wake_again()) return entry->session;
    failed = std::move(entry->session);
    its_memory = std::move(entry->memory);
    entry->session = nullptr;
    entry->memory = nullptr;
    if (entry->kept.damage) return Problem{.kind = ProblemKind::kDamaged, .detail = *entry->kept.damage};
    kept = entry->kept;
  }
  if (failed != nullptr) failed->close("the session is brought back once more");
  failed = nullptr;
  its_memory = nullptr;
  auto document = archive_->load(id);
  if (!document.ok()) {
    if (document.problem().kind == ProblemKind::kDamaged) mark_damaged(id, document.problem().detail);
    return document.problem();
  }
  const SharedCloud cloud = clouds_.find(kept.cloud);
  if (cloud == nullptr) return no_such_session();
  auto samples = clouds_.samples_of(*cloud);
  // A cloud whose file is damaged may be uploaded again: the session itself is whole.
  if (!samples.ok()) return samples.problem();
  const std::uint64_t first = kept.preview ? kept.preview->count : samples.value()->size();
  Needs needs = needs_of(kept.params, first, *samples.value());
  // Those that edits inserted come back with it.
  const std::uint64_t inserted = kept.samples - std::min(kept.samples, first);
  needs.live += inserted * needs.inserted_each;
  auto memory = room_for(needs.live + needs.history);
  if (!memory.ok()) return memory.problem();
  SessionParams params = params_of(kept, first, needs, memory.value());
  params.kept = document.value();
  if (auto put = put_samples(params, kept, cloud, std::move(samples.value()), needs.live + needs.history);
      !put.ok())
    return put.problem();
  const auto session = Session::make(std::move(params), services_);
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entry_of(id);
    if (entry == entries_.end()) return no_such_session();
    entry->session = session;
    entry->memory = std::move(memory.value());
    entry->bytes = needs.live + needs.history;
    entry->woken = std::chrono::steady_clock::now();
  }
  session->start();
  return session;
}

std::vector<std::shared_ptr<Session>> SessionStore::awake() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<Session>> sessions;
  for (const Entry& entry : entries_)
    if (entry.session != nullptr) sessions.push_back(entry.session);
  return sessions;
}

std::optional<std::string> SessionStore::owner_of(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.kept.id == id; });
  return entry == entries_.end() ? std::nullopt : std::optional<std::string>(entry->kept.owner);
}

std::vector<protocol::SessionSummary> SessionStore::summaries(const MaySee& may_see) const {
  const std::lock_guard lock(mutex_);
  std::vector<protocol::SessionSummary> summaries;
  for (const Entry& entry : entries_) {
    if (may_see && !may_see(entry.kept.owner, entry.kept.id)) continue;
    if (entry.session != nullptr) {
      summaries.push_back(entry.session->describe(*entry.session->document()).summary);
      continue;
    }
    const KeptSession& kept = entry.kept;
    summaries.push_back(
        {.id = kept.id,
         .name = kept.name,
         .cloud = kept.cloud,
         .state = kept.damage ? protocol::SessionState::kFailed : protocol::SessionState::kAsleep,
         .revision = kept.revision,
         .created = kept.created,
         .sample_count = kept.samples,
         .preview = kept.preview});
  }
  return summaries;
}

Outcome<Done> SessionStore::remove(const std::string& id, Session::Expected expected) {
  std::shared_ptr<std::mutex> turn;
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entry_of(id);
    if (entry == entries_.end()) return no_such_session();
    turn = entry->turn;
  }
  const std::lock_guard removing(*turn);
  std::shared_ptr<Session> session;
  std::uint64_t revision = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entry_of(id);
    if (entry == entries_.end()) return no_such_session();
    session = entry->session;  // and it stays awake
    revision = entry->kept.revision;
  }
  const std::string reason = "the session was deleted";
  const auto forget = [&]() -> Outcome<Done> {
    return archive_ == nullptr ? Outcome<Done>(Done{}) : archive_->remove_session(id);
  };
  if (session != nullptr && expected) {
    if (auto closed = session->close_at(reason, *expected, forget); !closed.ok()) return closed;
  } else {
    if (expected && *expected != revision)
      return Problem{.kind = ProblemKind::kStaleRevision,
                     .detail = "the session is at revision " + std::to_string(revision) + ", not " +
                               std::to_string(*expected),
                     .revision = revision};
    if (auto forgotten = forget(); !forgotten.ok()) return forgotten;
    if (session != nullptr) session->close(reason);
  }
  Entry removed;
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entry_of(id);
    if (entry == entries_.end()) return no_such_session();
    removed = std::move(*entry);
    entries_.erase(entry);
  }
  if (removed_) removed_(id);
  return Done{};
}

std::size_t SessionStore::expire(protocol::TimePoint last_used) {
  std::vector<std::string> expired;
  {
    const std::lock_guard lock(mutex_);
    for (Entry& entry : entries_) {
      if (!entry.is_idle())
        entry.kept.used = std::chrono::system_clock::now();
      else if (entry.kept.used <= last_used)
        expired.push_back(entry.kept.id);
    }
  }
  std::size_t count = 0;
  for (const std::string& id : expired) count += remove(id).ok() ? 1 : 0;
  return count;
}

void SessionStore::watch_expiry(const std::stop_token& stop) {
  const std::chrono::seconds idle(limits_.session_idle_expiry_s);
  while (!stop.stop_requested()) {
    (void)expire(std::chrono::system_clock::now() - idle);
    std::unique_lock lock(mutex_);
    watch_.wait_for(lock, stop, std::min(kExpiryInterval, idle), [] { return false; });
  }
}

// Not const: the sessions that it ends belong to the store.
// NOLINTNEXTLINE(readability-make-member-function-const)
void SessionStore::close_all(const std::string& reason) {
  for (const auto& session : awake()) session->close(reason);
}

}  // namespace pointwright::server
