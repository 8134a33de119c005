// Server-sent events: the small half of a stream, for whoever wants no frames.

#include <utility>

#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/handlers/session_news.h"
#include "server/handlers/viewing.h"

namespace pointwright::server {
namespace {

/// After how many milliseconds a client that was cut off should come again.
constexpr std::string_view kRetry = "retry: 2000\n\n";

bool write_text(BodySink& sink, std::string_view text) {
  return sink.write(std::as_bytes(std::span(text.data(), text.size())));
}

/// One event. Its id is the revision that the client then knows.
bool write_event(BodySink& sink, const protocol::JsonDocument& event, Session::Expected known) {
  std::string text;
  if (known) text.append("id: r").append(std::to_string(*known)).append("\n");
  text.append("event: ").append(event.at("event").get<std::string>());
  text.append("\ndata: ").append(protocol::to_text(event)).append("\n\n");
  return write_text(sink, text);
}

/// What Last-Event-ID says; nothing where it is none of ours.
Session::Expected last_revision(const RequestHead& head) {
  const auto id = head.header("last-event-id");
  if (!id || id->size() < 2 || id->size() > 17 || id->front() != 'r') return {};
  std::uint64_t revision = 0;
  for (const char c : id->substr(1)) {
    if (c < '0' || c > '9') return {};
    revision = 10 * revision + static_cast<std::uint64_t>(c - '0');
  }
  return revision;
}

}  // namespace

Response get_events(Service& service, const Request& request) {
  if (auto known = check_query(request.head, {"viewer"}); !known.ok())
    return problem_response(known.problem(), request);
  auto admitted = admit_viewer(service, request);
  if (!admitted.ok()) return problem_response(admitted.problem(), request);
  StreamBody body = [&service, viewing = std::move(admitted.value())](BodySink& sink) {
    SessionNews news(*viewing.session, last_revision(viewing.head));
    const auto tell = [&sink](const protocol::JsonDocument& event, Session::Expected known) {
      return write_event(sink, event, known);
    };
    if (!write_text(sink, kRetry)) return;
    run_stream(service, viewing, sink,
               {.news = [&] { return news.send(tell); },
                .heartbeat = [&] { return write_text(sink, ": alive\n\n"); },
                .end = [&](const std::string& reason) { (void)tell(protocol::end_event(reason), {}); }});
  };
  Response response{.content_type = "text/event-stream; charset=utf-8", .body = std::move(body)};
  // Proxies that gather an answer before they pass it on would gather for ever.
  return response.with_header("Cache-Control", "no-store").with_header("X-Accel-Buffering", "no");
}

}  // namespace pointwright::server
