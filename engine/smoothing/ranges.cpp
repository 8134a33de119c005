#include "engine/smoothing/ranges.h"

#include <cmath>

#include "engine/core/out_of_range.h"

namespace pointwright {

Result<void> validate_lambda(float lambda) {
  if (lambda > 0.0F && lambda <= 0.7F) return {};
  return out_of_range("lambda must lie in (0, 0.7]", "lambda", 0.7, static_cast<double>(lambda));
}

Result<void> validate_scale(float scale) {
  if (std::isfinite(scale) && scale >= 0.0F) return {};
  return Error{.code = ErrorCode::kInvalidArgument,
               .message = "the smoothing scale must be finite and not negative",
               .field = "scale"};
}

}  // namespace pointwright
