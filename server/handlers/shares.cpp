#include "protocol/json/access.h"
#include "server/handlers/handlers.h"

namespace pointwright::server {

Response list_shares(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  return json_response(protocol::share_list(service.access.shares.list(session.value()->id())));
}

Response create_share(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto terms = parsed_body(service, request, protocol::parse_share_request);
  if (!terms.ok()) return problem_response(terms.problem(), request);
  const std::string& id = session.value()->id();
  const auto made = service.access.shares.add(id, request.caller.token, terms.value());
  if (!made.ok()) return problem_response(made.problem(), request);
  if (!service.sessions.owner_of(id)) {
    // Deleted in between, where nothing is kept that would have told.
    service.access.shares.forget(id);
    return not_found("there is no such session", request);
  }
  const auto& [share, capability] = made.value();
  protocol::JsonDocument document = protocol::to_json(share.document);
  document["capability"] = capability;
  return json_response(document, 201)
      .with_header("Location",
                   std::string("/v1/sessions/").append(id).append("/shares/").append(share.document.id));
}

Response revoke_share(Service& service, const Request& request) {
  if (auto revoked = service.access.shares.revoke(request.captures.at(0), request.captures.at(1));
      !revoked.ok())
    return problem_response(revoked.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
