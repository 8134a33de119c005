#include "server/http/problem_response.h"

#include <utility>

#include "protocol/json/documents.h"

namespace pointwright::server {

Response problem_response(Problem problem, std::string_view instance, std::string_view request_id) {
  problem.instance = instance;
  problem.request_id = request_id;
  const std::string retry_after = std::to_string(problem.retry_after.value_or(2));
  const protocol::ProblemInfo& info = protocol::problem_info(problem.kind);
  Response response{.status = info.status, .content_type = "application/problem+json"};
  response.body = protocol::to_text(protocol::to_json(problem));
  if (info.retryable || problem.retry_after) response.with_header("Retry-After", retry_after);
  if (problem.kind == ProblemKind::kUnauthorized)
    // In place: gcc 12 takes the strings that with_header() moves for too short.
    response.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"pointwright\"");
  return response;
}

Response problem_response(Problem problem, const Request& request) {
  return problem_response(std::move(problem), request.head.path, request.id);
}

Response not_found(std::string detail, const Request& request) {
  return problem_response(Problem{.kind = ProblemKind::kNotFound, .detail = std::move(detail)}, request);
}

Problem malformed_request(std::string detail) {
  return Problem{.kind = ProblemKind::kMalformedRequest, .detail = std::move(detail)};
}

}  // namespace pointwright::server
