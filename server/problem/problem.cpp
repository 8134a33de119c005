#include "server/problem/problem.h"

namespace pointwright::server {

const std::vector<ProblemKind>& all_problem_kinds() {
  static const std::vector<ProblemKind> kinds = [] {
    std::vector<ProblemKind> all;
    for (int i = 0; i <= static_cast<int>(ProblemKind::kCancelled); ++i)
      all.push_back(static_cast<ProblemKind>(i));
    return all;
  }();
  return kinds;
}

ProblemKind problem_kind(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return ProblemKind::kInvalidValue;
    case ErrorCode::kMalformedData:
      return ProblemKind::kMalformedCloud;
    case ErrorCode::kUnsupportedFormat:
      return ProblemKind::kUnsupportedFormat;
    case ErrorCode::kNonFinite:
      return ProblemKind::kNonFinite;
    case ErrorCode::kOutOfRange:
      return ProblemKind::kOutOfRange;
    case ErrorCode::kTooLarge:
      return ProblemKind::kTooManySamples;
    case ErrorCode::kEmptyCloud:
      return ProblemKind::kEmptyCloud;
    case ErrorCode::kEmptyRegion:
      return ProblemKind::kEmptyRegion;
    case ErrorCode::kRegionsIntersect:
      return ProblemKind::kRegionsIntersect;
    case ErrorCode::kCancelled:
      return ProblemKind::kCancelled;
  }
  throw LogicError("an unknown error code");
}

Problem problem_of(const Error& error, std::string_view pointer_prefix) {
  Problem problem{.kind = problem_kind(error.code),
                  .detail = error.message,
                  .limit = error.limit,
                  .actual = error.actual};
  if (!error.field.empty()) {
    std::string pointer(pointer_prefix);
    pointer.push_back('/');
    for (const char c : error.field) pointer.push_back(c == '.' ? '/' : c);
    problem.errors.emplace_back(std::move(pointer), error.message);
  }
  return problem;
}

}  // namespace pointwright::server
