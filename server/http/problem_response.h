#pragma once
// Problems as answers, and values that may be problems.

#include <string>
#include <string_view>
#include <variant>

#include "protocol/json/problem.h"
#include "server/http/message.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

/// The answer: application/problem+json with the request's path and id, and Retry-After where the kind is
/// retryable.
Response problem_response(Problem problem, std::string_view instance, std::string_view request_id);
Response problem_response(Problem problem, const Request& request);

/// 404, and what is not there.
Response not_found(std::string detail, const Request& request);
/// 400, and why.
Problem malformed_request(std::string detail);

}  // namespace pointwright::server
