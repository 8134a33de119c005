#include "server/handlers/handlers.h"

namespace pointwright::server {

Response list_sessions(Service& service, const Request&) {
  std::vector<protocol::SessionSummary> summaries;
  for (const auto& session : service.sessions.list())
    summaries.push_back(session->describe(*session->document()).summary);
  return json_response(protocol::session_list(summaries));
}

Response create_session(Service& service, const Request& request) {
  const auto body = parsed_body(service, request, protocol::parse_create_session);
  if (!body.ok()) return problem_response(body.problem(), request);
  const auto session = service.sessions.create(service.clouds, body.value());
  if (!session.ok()) return problem_response(session.problem(), request);
  return session_response(*session.value(), *session.value()->document(), 202)
      .with_header("Location", "/v1/sessions/" + session.value()->id());
}

Response get_session(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  return session_response(*session.value(), *session.value()->document());
}

Response delete_session(Service& service, const Request& request) {
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  if (auto removed = service.sessions.remove(request.captures.at(0), expected.value()); !removed.ok())
    return problem_response(removed.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
