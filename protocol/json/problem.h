#pragma once
// Problem documents (RFC 9457): the whole vocabulary of refusals, in one table.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "protocol/json/parse.h"
#include "protocol/json/requests.h"

namespace pointwright::protocol {

enum class ProblemKind {
  kMalformedRequest,
  kMalformedJson,
  kEmptyBody,
  kInvalidValue,
  kHostNotAllowed,
  kOriginNotAllowed,
  kUnauthorized,
  kForbidden,
  kNotFound,
  kMethodNotAllowed,
  kNotAcceptable,
  kRequestTimeout,
  kWrongState,
  kCloudInUse,
  kUploadOffset,
  kLengthRequired,
  kStaleRevision,
  kTusVersion,
  kBodyTooLarge,
  kPathTooLong,
  kUnsupportedMediaType,
  kRangeNotSatisfiable,
  kExpectationFailed,
  kUploadLocked,
  kRevisionRequired,
  kTooMany,
  kHeadTooLarge,
  kChecksumMismatch,
  kInternalError,
  kNotImplemented,
  kOverloaded,
  kHttpVersion,
  kOutOfSpace,
  kMalformedCloud,
  kUnsupportedFormat,
  kNonFinite,
  kOutOfRange,
  kTooManySamples,
  kEmptyCloud,
  kEmptyRegion,
  kRegionsIntersect,
  kOutOfDisk,
  kStorageFailed,
  kDamaged,
  kKeyInUse,
  kKeyReused,
  kCancelled,
};

/// One row of the table.
struct ProblemInfo {
  ProblemKind kind;
  int status;                    ///< of the HTTP response
  std::string_view slug;         ///< "type" is "/problems/<slug>"; stable for ever
  std::string_view title;        ///< a short phrase
  std::string_view explanation;  ///< a sentence or two: what /problems/<slug> says
  bool retryable;                ///< the same request may succeed later: send Retry-After
};

const ProblemInfo& problem_info(ProblemKind kind);
/// The whole table, in the order of the enumeration.
std::span<const ProblemInfo> all_problems();
/// Null where no problem has that slug.
const ProblemInfo* find_problem(std::string_view slug);

/// Retry-After where something of what takes the room ends by itself.
inline constexpr std::uint32_t kPassingSeconds = 5;

/// The problem that a failure of the engine is to a client. Exhaustive over ErrorCode.
ProblemKind problem_of(ErrorCode code);

struct Problem {
  ProblemKind kind = ProblemKind::kInternalError;
  std::string detail;         ///< this occurrence, in one sentence, with values and limits
  std::string instance = {};  ///< the path of the request
  std::string request_id = {};
  std::vector<JsonFault> errors = {};
  std::optional<double> limit = std::nullopt;
  std::optional<double> actual = std::nullopt;
  std::optional<std::uint64_t> revision = std::nullopt;     ///< kStaleRevision: the current one
  std::optional<std::uint32_t> retry_after = std::nullopt;  ///< seconds, where they are known

  [[nodiscard]] int status() const { return problem_info(kind).status; }
};

/// The problem of an engine error: detail, limits, and the field as a pointer.
Problem to_problem(const Error& error);
/// The problem of a refused JSON request, with all faults that were kept.
Problem to_problem(const JsonErrors& errors);

/// {type, title, status, detail, instance, request_id, errors?, limit?, actual?, revision?}
JsonDocument to_json(const Problem& problem);

}  // namespace pointwright::protocol
