#pragma once
// Kinds of problems to HTTP: one status and one stable slug each (RFC 9457).

#include <string_view>

#include "server/http/message.h"
#include "server/problem/problem.h"

namespace pointwright::server {

/// The fixed part of a kind. `retryable`: the same request may succeed later (answers carry Retry-After).
struct ProblemInfo {
  int status;
  std::string_view slug;
  std::string_view title;
  std::string_view explanation;  ///< what GET /problems/{slug} says
  bool retryable;
};

const ProblemInfo& problem_info(ProblemKind kind);
/// The answer: application/problem+json, with Retry-After where the kind is retryable.
Response problem_response(const Problem& problem, std::string_view instance, std::string_view request_id);

}  // namespace pointwright::server
