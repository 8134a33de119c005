#pragma once
// The errors of numbers outside of their range.

#include <string>
#include <utility>

#include "engine/core/result.h"

namespace pointwright {

/// `field` as the parameter is called; `limit` is the end of the range that was passed.
inline Error out_of_range(std::string message, std::string field, double limit, double actual) {
  return Error{.code = ErrorCode::kInvalidArgument,
               .message = std::move(message),
               .field = std::move(field),
               .limit = limit,
               .actual = actual};
}

/// More of something than there may be.
inline Error too_large(std::string message, std::string field, double limit, double actual) {
  Error error = out_of_range(std::move(message), std::move(field), limit, actual);
  error.code = ErrorCode::kTooLarge;
  return error;
}

}  // namespace pointwright
