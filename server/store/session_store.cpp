#include "server/store/session_store.h"

#include <algorithm>

#include "engine/multires/normal_stencil.h"
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

}  // namespace

SessionStore::SessionStore(const Limits& limits, SessionServices services)
    : limits_(limits), services_(std::move(services)), memory_(limits.max_session_bytes) {}

SessionStore::~SessionStore() {
  close_all("the server is stopping");
}

Outcome<std::shared_ptr<Session>> SessionStore::create(const CloudStore& clouds,
                                                       const protocol::CreateSessionRequest& request) {
  Entry entry;
  entry.cloud_use = clouds.use(request.cloud);
  const SharedCloud cloud = entry.cloud_use == nullptr ? nullptr : clouds.find(request.cloud);
  if (cloud == nullptr)
    return Problem{.kind = ProblemKind::kNotFound,
                   .detail = "there is no cloud with that id",
                   .errors = {{.pointer = "/cloud", .detail = "no such cloud"}}};
  const std::uint64_t samples = cloud->cloud->size();
  const std::uint64_t more_bands = (request.params.scales.size() - 1) * kBytesPerBand;
  const std::uint64_t drag = (request.params.scales.size() + 1) * kStencilBytes + kShapeBytes;
  const std::uint64_t graph = request.params.neighbors * kBytesPerNeighbor;
  const std::uint64_t live_each = kBytesPerSample + kLiveSurfaces * more_bands + drag + graph;
  const std::uint64_t live = samples * live_each;
  const std::uint64_t columns = memory_of(*cloud->cloud) / std::max<std::uint64_t>(samples, 1);
  const std::uint64_t inserted_each = live_each + kSamplings * (kBytesInSampling + graph + columns);
  const std::uint64_t history =
      std::min(limits_.history_bytes, samples * kHistoryStates * (kStateBytesPerSample + more_bands));
  const std::lock_guard lock(mutex_);
  if (entries_.size() >= limits_.max_sessions)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the server holds as many sessions as it may",
                   .limit = static_cast<double>(limits_.max_sessions),
                   .actual = static_cast<double>(entries_.size())};
  auto memory = memory_.hold(live + history);
  if (memory == nullptr)
    return Problem{.kind = ProblemKind::kOutOfSpace,
                   .detail = "the memory for sessions is used up",
                   .limit = static_cast<double>(memory_.total()),
                   .actual = static_cast<double>(memory_.held() + live + history)};
  entry.session =
      Session::create({.id = random_id(),
                       .name = request.name.empty() ? cloud->document.name : request.name,
                       .cloud_id = request.cloud,
                       .cloud = cloud->cloud,
                       .hierarchy = request.params,
                       .history_bytes = history,
                       .max_edits = static_cast<std::size_t>(limits_.max_edits),
                       .max_operations = static_cast<std::size_t>(limits_.max_operations),
                       .max_painting_vertices = static_cast<std::size_t>(limits_.max_painting_vertices),
                       .room = std::make_shared<SampleRoom>(std::max(limits_.max_session_samples, samples),
                                                            memory, samples, inserted_each)},
                      services_);
  entry.memory = std::move(memory);
  entries_.push_back(entry);
  return entry.session;
}

std::shared_ptr<Session> SessionStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.session->id() == id; });
  return it == entries_.end() ? nullptr : it->session;
}

std::vector<std::shared_ptr<Session>> SessionStore::list() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<Session>> sessions;
  for (const Entry& entry : entries_) sessions.push_back(entry.session);
  return sessions;
}

Outcome<Done> SessionStore::remove(const std::string& id, Session::Expected expected) {
  if (const auto session = expected ? find(id) : nullptr)
    if (auto closed = session->close_at("the session was deleted", *expected); !closed.ok()) return closed;
  Entry removed;
  {
    const std::lock_guard lock(mutex_);
    const auto it =
        std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.session->id() == id; });
    if (it == entries_.end())
      return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such session"};
    removed = std::move(*it);
    entries_.erase(it);
  }
  removed.session->close("the session was deleted");
  return Done{};
}

// Not const: the sessions that it ends belong to the store.
// NOLINTNEXTLINE(readability-make-member-function-const)
void SessionStore::close_all(const std::string& reason) {
  for (const auto& session : list()) session->close(reason);
}

}  // namespace pointwright::server
