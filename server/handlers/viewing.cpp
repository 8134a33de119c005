#include "server/handlers/viewing.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// How soon a stream notices that its client is gone, that building went on, or that the server stops.
constexpr std::chrono::milliseconds kPollInterval{200};

/// Problem: not a name
Outcome<std::string> viewer_name(const RequestHead& head) {
  std::string name = query_value(head, "viewer").value_or("");
  if (!name.empty() && !protocol::is_valid_name(name))
    return Problem{
        .kind = ProblemKind::kInvalidValue,
        .detail = "a viewer's name has 1 to 120 bytes of UTF-8 without control characters",
        .errors = {{.pointer = "?viewer", .detail = "1 to 120 bytes of UTF-8 without control characters"}}};
  return name;
}

}  // namespace

Outcome<StreamSlot> admit_stream(Service& service, const Request& request) {
  auto quota = service.access.hold(request.caller, {{Quota::kStreams, 1}});
  if (!quota.ok()) return quota.problem();
  auto slot = service.streams.hold(1);
  if (slot == nullptr)
    return Problem{.kind = ProblemKind::kOverloaded,
                   .detail = "all streams are in use",
                   .limit = static_cast<double>(service.streams.total())};
  return StreamSlot(
      std::make_shared<const StreamSlot::element_type>(std::move(quota.value()), std::move(slot)));
}

Outcome<Viewing> admit_viewer(Service& service, const Request& request) {
  auto session = service.sessions.get(request.captures.at(0));
  if (!session.ok()) return session.problem();
  auto name = viewer_name(request.head);
  if (!name.ok()) return name.problem();
  auto slot = admit_stream(service, request);
  if (!slot.ok()) return slot.problem();
  return Viewing{.session = std::move(session.value()),
                 .head = request.head,
                 .name = std::move(name.value()),
                 .slot = std::move(slot.value())};
}

void run_stream(Service& service, const Viewing& viewing, BodySink& sink, const StreamVoice& voice) {
  Session& session = *viewing.session;
  const auto presence = session.presence().join(viewing.name);
  const std::chrono::milliseconds heartbeat(service.config.limits.heartbeat_ms);
  std::uint64_t changes = 0;
  auto beat = SteadyClock::now() + heartbeat;
  while (!sink.is_peer_gone()) {
    const auto closed = session.closed_reason();
    if (closed || sink.is_stopping()) return voice.end(closed.value_or("the server is stopping"));
    if (!voice.news()) return;
    if (SteadyClock::now() >= beat) {
      if (!service.access.identify(viewing.head).ok())
        return voice.end("the token or the link has expired or was revoked");
      if (!voice.heartbeat()) return;
      beat = SteadyClock::now() + heartbeat;
    }
    changes = session.feed().wait_beyond(changes, std::min(beat, SteadyClock::now() + kPollInterval));
  }
}

}  // namespace pointwright::server
