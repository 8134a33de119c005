#pragma once
// What a job reads: the scan whole, or as records; and which mode that leads to.

#include <cstdint>
#include <optional>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "server/base/outcome.h"
#include "server/ingest/confined.h"
#include "server/jobs/full_resolution.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/unpacked_scan.h"

namespace pointwright::server {

/// The mode of a job; in tiles, with the scan's file and what it is: records, or what becomes such.
struct ChosenMode {
  JobMode mode = JobMode::kTiles;
  std::optional<MappedFile> file = std::nullopt;
  std::optional<ScanRecords> records = std::nullopt;
  std::optional<PackedScan> packed = std::nullopt;
  bool packs = false;  ///< the result becomes Draco tiles
};
/// Problems: the output is the input; what the mode that was asked for cannot do; those of opening the scan
Outcome<ChosenMode> choose_mode(const JobParams& params);

/// How a decoder of so many bytes is confined where the job asks for that.
ConfineLimits confinement(const JobParams& params, std::uint64_t bytes);

/// The whole scan. Errors: those of read_local_cloud() and decode_confined()
Result<ImportedCloud> read_scan(const JobParams& params);

}  // namespace pointwright::server
