#pragma once
// What the report says of a finished cloud beyond what its file says of itself.

#include "engine/io/cloud_io.h"

namespace pointwright {

/// Fills in attributes, ranges, spacing, step and warnings.
/// Pre:         the cloud is in coherent order; bounds and counts are in the report
/// file_origin: the origin that the file itself had
/// Cost:        O(N) and 4096 searches
/// Determinism: bitwise equal for any thread count
void complete_report(ImportedCloud& imported, const Vec3d& file_origin);

}  // namespace pointwright
