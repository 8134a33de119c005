#pragma once
// How the server's own steps fail: one catalogue of everything that a client can be told.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "engine/core/result.h"

namespace pointwright::server {

enum class ProblemKind {
  kMalformedRequest,
  kMalformedJson,
  kInvalidValue,
  kHostNotAllowed,
  kOriginNotAllowed,
  kNotFound,
  kMethodNotAllowed,
  kRequestTimeout,
  kWrongState,
  kCloudInUse,
  kLengthRequired,
  kStaleRevision,
  kBodyTooLarge,
  kPathTooLong,
  kUnsupportedMediaType,
  kRangeNotSatisfiable,
  kExpectationFailed,
  kRevisionRequired,
  kTooMany,
  kHeadTooLarge,
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
  kCancelled,
};

/// All kinds, for tests and for /problems/{slug}.
const std::vector<ProblemKind>& all_problem_kinds();
/// The kind that an error of the engine is shown as.
ProblemKind problem_kind(ErrorCode code);

/// One failure: what the client is told.
struct Problem {
  ProblemKind kind = ProblemKind::kInternalError;
  std::string detail;
  /// JSON Pointers to the members at fault, each with a sentence.
  std::vector<std::pair<std::string, std::string>> errors = {};
  std::optional<double> limit = std::nullopt;
  std::optional<double> actual = std::nullopt;
  std::optional<std::uint64_t> revision = std::nullopt;  ///< the current one, where a stale one was named
  std::vector<std::pair<std::string, std::string>> headers = {};  ///< further headers of the answer (Allow, Retry-After)
};

/// `field` of the error becomes a JSON Pointer below `pointer_prefix` ("deformation.axis" -> "/deformation/axis").
Problem problem_of(const Error& error, std::string_view pointer_prefix = "");

/// A value or a Problem: how the server's own steps fail.
template <typename T>
class [[nodiscard]] Outcome {
 public:
  Outcome(T value)
      : state_(std::in_place_index<0>, std::move(value)) {}  // NOLINT(google-explicit-constructor)
  Outcome(Problem problem)
      : state_(std::in_place_index<1>, std::move(problem)) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  [[nodiscard]] T& value() { return std::get<0>(state_); }
  [[nodiscard]] const T& value() const { return std::get<0>(state_); }
  [[nodiscard]] const Problem& problem() const { return std::get<1>(state_); }

 private:
  std::variant<T, Problem> state_;
};

}  // namespace pointwright::server
