#pragma once
// The error of a parameter outside of its range.

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

}  // namespace pointwright
