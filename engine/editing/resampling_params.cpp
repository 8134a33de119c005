#include "engine/editing/resampling_params.h"

#include <cmath>
#include <string>

#include "engine/core/out_of_range.h"

namespace pointwright {
namespace {

Result<void> within(double value, double least, double greatest, const char* name) {
  const std::string field = std::string("resampling.") + name;
  if (!std::isfinite(value))
    return Error{.code = ErrorCode::kNonFinite, .message = field + " is not a finite number", .field = field};
  if (value >= least && value <= greatest) return {};
  return out_of_range(field + " is " + std::to_string(value) + (value < least ? ", below " : ", above ") +
                          std::to_string(value < least ? least : greatest),
                      field, value < least ? least : greatest, value);
}

}  // namespace

Result<void> validate(const ResamplingParams& params) {
  if (auto ok = within(params.bound, kLeastStretchBound, kGreatestStretchBound, "bound"); !ok) return ok;
  if (auto ok = within(params.min_spacing, 0.0, kGreatestMinSpacing, "min_spacing"); !ok) return ok;
  if (auto ok = within(params.sweeps, 0.0, kMaxRelaxationSweeps, "sweeps"); !ok) return ok;
  return within(params.collect, 0.0, kGreatestCollectDistance, "collect");
}

}  // namespace pointwright
