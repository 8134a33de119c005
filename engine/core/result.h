#pragma once
// Expected failures travel as values. std::expected is not in C++20, so this is the small part of it that we
// need.

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "engine/core/check.h"

namespace pointwright {

/// Why an operation of the engine could not be done. protocol/json/problem.cpp maps each to a status.
enum class ErrorCode {
  kInvalidArgument,    ///< a parameter is outside its stated range; `field` names it
  kMalformedData,      ///< bytes that are not what they claim to be
  kUnsupportedFormat,  ///< a format, version or feature that we do not read
  kNonFinite,          ///< NaN or infinity where a finite number is owed
  kOutOfRange,         ///< coordinates beyond 1e9, or an extent too small for its offset
  kTooLarge,           ///< a stated limit is exceeded; `limit` and `actual` say by how much
  kEmptyCloud,         ///< no sample at all
  kEmptyRegion,        ///< a zero- or one-region without any sample or volume
  kRegionsIntersect,   ///< the zero- and one-region meet (paper §4: their intersection must be empty)
  kCancelled,          ///< the execution context was cancelled
};

struct Error {
  ErrorCode code = ErrorCode::kInvalidArgument;
  std::string message;  ///< one sentence for a person, naming values and limits
  std::string field;    ///< the parameter or property at fault, as a path ("deformation.axis"); may be empty
  std::optional<double> limit = std::nullopt;
  std::optional<double> actual = std::nullopt;
};

/// A value or an Error. Reading the wrong side is a LogicError.
template <typename T>
class [[nodiscard]] Result {
 public:
  // NOLINTNEXTLINE(google-explicit-constructor)
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  [[nodiscard]] T& value() & {
    POINTWRIGHT_CHECK(ok(), "value() of a failed Result");
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] const T& value() const& {
    POINTWRIGHT_CHECK(ok(), "value() of a failed Result");
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T&& value() && {
    POINTWRIGHT_CHECK(ok(), "value() of a failed Result");
    return std::move(*std::get_if<0>(&state_));
  }
  [[nodiscard]] const Error& error() const {
    POINTWRIGHT_CHECK(!ok(), "error() of a successful Result");
    return *std::get_if<1>(&state_);
  }

 private:
  std::variant<T, Error> state_;
};

/// Success without a value, or an Error.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] const Error& error() const {
    POINTWRIGHT_CHECK(!ok(), "error() of a successful Result");
    return *error_;
  }

 private:
  std::optional<Error> error_;
};

}  // namespace pointwright
