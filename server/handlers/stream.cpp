#include <algorithm>
#include <utility>

#include "protocol/frames/stream_record.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/handlers/session_news.h"
#include "server/handlers/viewing.h"

namespace pointwright::server {
namespace {

/// A reader that takes a piece in time stays; so no piece is so large that a slow link could not carry it.
constexpr std::size_t kPieceBytes = 128 * 1024;

/// One stream of one viewer: at most one frame under way, always the newest; what changed meanwhile is in the
/// next one.
class StreamWriter {
 public:
  StreamWriter(Service& service, Session& session, std::uint16_t attributes, BodySink& sink)
      : service_(service), session_(session), attributes_(attributes), sink_(sink), news_(session) {}

  bool send_news() {
    if (!news_.send(
            [this](const protocol::JsonDocument& event, Session::Expected) { return send_event(event); }))
      return false;
    if (session_.display().version() == version_) return true;
    const auto frame = computed(service_.interactive,
                                [this] { return session_.display().frame_since(version_, attributes_); });
    if (!frame.ok()) return false;
    const std::uint64_t before = std::exchange(version_, frame.value().version);
    service_.metrics.count_frame(frame.value().bytes->size(), before == 0 ? 0 : version_ - before - 1);
    return send_record(protocol::StreamRecordType::kFrame, *frame.value().bytes);
  }

  bool send_event(const protocol::JsonDocument& event) {
    const std::string text = protocol::to_text(event);
    return send_record(protocol::StreamRecordType::kEvent,
                       std::as_bytes(std::span(text.data(), text.size())));
  }

 private:
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
  SessionNews news_;
  std::uint64_t version_ = 0;
};

}  // namespace

Response get_stream(Service& service, const Request& request) {
  constexpr auto kAllowed =
      static_cast<std::uint16_t>(protocol::kAllFrameAttributes & ~unsigned{protocol::kFrameIds});
  const auto asked = query_attributes(request.head, kAllowed, protocol::kFrameNormal);
  if (!asked.ok()) return problem_response(asked.problem(), request);
  auto admitted = admit_viewer(service, request);
  if (!admitted.ok()) return problem_response(admitted.problem(), request);
  const std::uint16_t attributes = admitted.value().session->available_attributes(asked.value());
  StreamBody body = [&service, viewing = std::move(admitted.value()), attributes](BodySink& sink) {
    StreamWriter writer(service, *viewing.session, attributes, sink);
    run_stream(service, viewing, sink,
               {.news = [&] { return writer.send_news(); },
                .heartbeat = [&] { return writer.send_event(protocol::heartbeat_event()); },
                .end = [&](const std::string& reason) { writer.send_event(protocol::end_event(reason)); }});
  };
  return {.content_type = "application/octet-stream", .body = std::move(body)};
}

}  // namespace pointwright::server
