#pragma once
// What a job reads: the scan whole, or as records; and which mode that leads to.

#include <optional>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "server/base/outcome.h"
#include "server/jobs/full_resolution.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/scan_records.h"

namespace pointwright::server {

/// The mode of a job; in tiles, with the scan's records in its mapped file.
struct ChosenMode {
  JobMode mode = JobMode::kTiles;
  std::optional<MappedFile> file;
  std::optional<ScanRecords> records;
};
/// Problems: the output is the input; what the mode that was asked for cannot do; those of opening the scan
Outcome<ChosenMode> choose_mode(const JobParams& params);

/// The whole scan. Errors: those of read_local_cloud() and decode_confined()
Result<ImportedCloud> read_scan(const JobParams& params);

}  // namespace pointwright::server
