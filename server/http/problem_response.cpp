#include "server/http/problem_response.h"

#include "protocol/json/documents.h"

namespace pointwright::server {

Response problem_response(Problem problem, std::string_view instance, std::string_view request_id) {
  problem.instance = instance;
  problem.request_id = request_id;
  const protocol::ProblemInfo& info = protocol::problem_info(problem.kind);
  Response response{.status = info.status, .content_type = "application/problem+json"};
  response.body = protocol::to_text(protocol::to_json(problem));
  if (info.retryable) response.with_header("Retry-After", "2");
  return response;
}

Response problem_response(Problem problem, const Request& request) {
  return problem_response(std::move(problem), request.head.path, request.id);
}

}  // namespace pointwright::server
