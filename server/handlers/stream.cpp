#include <algorithm>
#include <chrono>

#include "protocol/frames/stream_record.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// A reader that takes a piece in time stays; so no piece is so large that a slow link could not carry it.
constexpr std::size_t kPieceBytes = 128 * 1024;
/// How soon a stream notices that its client is gone, that building went on, or that the server stops.
constexpr std::chrono::milliseconds kPollInterval{200};

/// One stream of one viewer: at most one frame under way, always the newest; what changed meanwhile is in the
/// next one.
class StreamWriter {
 public:
  StreamWriter(Service& service, Session& session, std::uint16_t attributes, BodySink& sink)
      : service_(service), session_(session), attributes_(attributes), sink_(sink) {}

  void run() {
    const std::chrono::milliseconds heartbeat(service_.config.limits.heartbeat_ms);
    std::uint64_t changes = 0;
    SteadyClock::time_point beat = SteadyClock::now() + heartbeat;
    while (!sink_.is_peer_gone()) {
      const auto closed = session_.closed_reason();
      if (closed || sink_.is_stopping()) {
        send_event(protocol::end_event(closed.value_or("the server is stopping")));
        return;
      }
      if (!send_news()) return;
      if (SteadyClock::now() >= beat) {
        if (!send_event(protocol::heartbeat_event())) return;
        beat = SteadyClock::now() + heartbeat;
      }
      changes = session_.feed().wait_beyond(changes, std::min(beat, SteadyClock::now() + kPollInterval));
    }
  }

 private:
  bool send_news() {
    const SharedDocument document = session_.document();
    if (document != document_) {
      document_ = document;
      if (!send_event(protocol::session_event(session_.describe(*document)))) return false;
    }
    if (document->state == protocol::SessionState::kBuilding) {
      const Progress progress = session_.progress();
      if (progress.phase != progress_.phase || progress.fraction != progress_.fraction) {
        progress_ = progress;
        if (!send_event(protocol::progress_event(progress))) return false;
      }
    }
    if (session_.display().version() == version_) return true;
    const auto frame = computed(service_.interactive,
                                [this] { return session_.display().frame_since(version_, attributes_); });
    if (!frame.ok()) return false;
    version_ = frame.value().version;
    return send_record(protocol::StreamRecordType::kFrame, *frame.value().bytes);
  }

  bool send_event(const protocol::JsonDocument& event) {
    const std::string text = protocol::to_text(event);
    return send_record(protocol::StreamRecordType::kEvent,
                       std::as_bytes(std::span(text.data(), text.size())));
  }

  bool send_record(protocol::StreamRecordType type, std::span<const std::byte> payload) {
    if (!sink_.write(protocol::stream_record_header(type, payload.size()))) return false;
    while (!payload.empty()) {
      const auto piece = payload.first(std::min(payload.size(), kPieceBytes));
      if (!sink_.write(piece)) return false;
      payload = payload.subspan(piece.size());
    }
    return true;
  }

  Service& service_;
  Session& session_;
  const std::uint16_t attributes_;
  BodySink& sink_;
  SharedDocument document_;
  Progress progress_;
  std::uint64_t version_ = 0;
};

}  // namespace

Response get_stream(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  if (auto known = check_query(request.head, {"attributes"}); !known.ok())
    return problem_response(known.problem(), request);
  constexpr auto kAllowed =
      static_cast<std::uint16_t>(protocol::kAllFrameAttributes & ~unsigned{protocol::kFrameIds});
  const auto asked = query_attributes(request.head, kAllowed, protocol::kFrameNormal);
  if (!asked.ok()) return problem_response(asked.problem(), request);
  auto slot = service.streams.hold(1);
  if (slot == nullptr)
    return problem_response({.kind = ProblemKind::kOverloaded,
                             .detail = "all streams are in use",
                             .limit = static_cast<double>(service.streams.total())},
                            request);
  const std::uint16_t attributes = session.value()->available_attributes(asked.value());
  StreamBody body = [&service, session = session.value(), attributes, slot = std::move(slot)](
                        BodySink& sink) { StreamWriter(service, *session, attributes, sink).run(); };
  return {.content_type = "application/octet-stream", .body = std::move(body)};
}

}  // namespace pointwright::server
