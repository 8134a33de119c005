#include "server/handlers/event_stream.h"

#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace pointwright::server {
namespace {

bool write_text(BodySink& sink, std::string_view text) {
  return sink.write(std::as_bytes(std::span(text.data(), text.size())));
}

}  // namespace

bool write_event(BodySink& sink, const protocol::JsonDocument& event, std::optional<std::uint64_t> id) {
  std::string text = id ? std::string("id: r").append(std::to_string(*id)).append("\n") : std::string();
  text.append("event: ").append(event.at("event").get<std::string>());
  text.append("\ndata: ").append(protocol::to_text(event)).append("\n\n");
  return write_text(sink, text);
}

bool write_heartbeat(BodySink& sink) {
  return write_text(sink, ": alive\n\n");
}

bool write_retry(BodySink& sink) {
  return write_text(sink, "retry: 2000\n\n");  // milliseconds
}

Response event_stream(StreamBody body) {
  Response response{.content_type = "text/event-stream; charset=utf-8", .body = std::move(body)};
  // Proxies that gather an answer before they pass it on would gather for ever.
  return response.with_header("Cache-Control", "no-store").with_header("X-Accel-Buffering", "no");
}

}  // namespace pointwright::server
