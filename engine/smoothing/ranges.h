#pragma once
// Ranges that several ways of smoothing share.

#include "engine/core/result.h"

namespace pointwright {

/// lambda of Eq. (7): in (0, 0.7]. Error: kInvalidArgument, field "lambda".
Result<void> validate_lambda(float lambda);
/// A smoothing scale: finite and not negative. Error: kInvalidArgument, field "scale".
Result<void> validate_scale(float scale);

}  // namespace pointwright
