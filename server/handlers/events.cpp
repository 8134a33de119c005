// Server-sent events: the small half of a stream, for whoever wants no frames.

#include <utility>

#include "server/handlers/event_stream.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/handlers/session_news.h"
#include "server/handlers/viewing.h"

namespace pointwright::server {
namespace {

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
  auto admitted = admit_viewer(service, request);
  if (!admitted.ok()) return problem_response(admitted.problem(), request);
  StreamBody body = [&service, viewing = std::move(admitted.value())](BodySink& sink) {
    SessionNews news(*viewing.session, last_revision(viewing.head));
    const auto tell = [&sink](const protocol::JsonDocument& event, Session::Expected known) {
      return write_event(sink, event, known);
    };
    if (!write_retry(sink)) return;
    run_stream(service, viewing, sink,
               {.news = [&] { return news.send(tell); },
                .heartbeat = [&] { return write_heartbeat(sink); },
                .end = [&](const std::string& reason) { (void)tell(protocol::end_event(reason), {}); }});
  };
  return event_stream(std::move(body));
}

}  // namespace pointwright::server
