#include "protocol/json/access.h"
#include "server/handlers/handlers.h"

namespace pointwright::server {

Response list_tokens(Service& service, const Request&) {
  return json_response(protocol::token_list(service.access.tokens.list()));
}

Response create_token(Service& service, const Request& request) {
  const auto terms = parsed_body(service, request, protocol::parse_token_request);
  if (!terms.ok()) return problem_response(terms.problem(), request);
  const auto made = service.access.tokens.add(terms.value(), service.config.limits.max_tokens);
  if (!made.ok()) return problem_response(made.problem(), request);
  protocol::JsonDocument document = protocol::to_json(made.value().entry.document);
  document["secret"] = made.value().secret;
  return json_response(document, 201).with_header("Location", "/v1/tokens/" + made.value().entry.document.id);
}

Response revoke_token(Service& service, const Request& request) {
  if (auto revoked = service.access.tokens.revoke(request.captures.at(0)); !revoked.ok())
    return problem_response(revoked.problem(), request);
  service.access.shares.forget_owner(request.captures.at(0));
  return {.status = 204};
}

}  // namespace pointwright::server
