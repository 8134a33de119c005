#include <algorithm>

#include "server/handlers/handlers.h"

namespace pointwright::server {
namespace {

/// What a session on the cloud takes of the caller's quotas.
Outcome<std::shared_ptr<const void>> hold_session(Service& service, const Caller& caller,
                                                  const protocol::CreateSessionRequest& asked) {
  const SharedCloud cloud = service.clouds.find(asked.cloud);
  // create() says so.
  if (cloud == nullptr || !caller.may_see(cloud->owner)) return std::shared_ptr<const void>();
  const std::uint64_t whole = cloud->document.report.sample_count;
  const std::uint64_t first = std::min(whole, asked.preview.value_or(whole));
  return service.access.hold(caller, {{Quota::kSessions, 1}, {Quota::kSamples, first}});
}

}  // namespace

Response list_sessions(Service& service, const Request& request) {
  const auto may_see = [&](const std::string& owner, const std::string& id) {
    return request.caller.may_see_session(owner, id);
  };
  return json_response(protocol::session_list(service.sessions.summaries(may_see)));
}

Response create_session(Service& service, const Request& request) {
  const auto body = parsed_body(service, request, protocol::parse_create_session);
  if (!body.ok()) return problem_response(body.problem(), request);
  const auto quota = hold_session(service, request.caller, body.value());
  if (!quota.ok()) return problem_response(quota.problem(), request);
  using Made = std::shared_ptr<Session>;
  const auto answer = [](const Made& session) {
    return session_response(*session, *session->document(), 202)
        .with_header("Location", "/v1/sessions/" + session->id());
  };
  const auto session =
      service.sessions.create(body.value(), request.caller, quota.value(), sealed<Made>(request, answer));
  if (!session.ok()) return problem_response(session.problem(), request);
  return answer_of(request, session.value(), answer);
}

Response get_session(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  return session_response(*session.value(), *session.value()->document());
}

Response patch_session(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto change = parsed_body(service, request, protocol::parse_session_change);
  if (!change.ok()) return problem_response(change.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto renamed = session.value()->rename(change.value().name, expected.value());
  if (!renamed.ok()) return problem_response(renamed.problem(), request);
  return session_response(*session.value(), *renamed.value());
}

Response delete_session(Service& service, const Request& request) {
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  if (auto removed = service.sessions.remove(request.captures.at(0), expected.value()); !removed.ok())
    return problem_response(removed.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
