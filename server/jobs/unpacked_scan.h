#pragma once
// Scans that are no records of one length become such: ASCII PLY and Draco tiles are written anew, piece by
// piece, as the binary PLY that tiles are made of.

#include <cstdint>
#include <optional>
#include <string>

#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "protocol/json/problem.h"
#include "server/jobs/full_resolution.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/team.h"

namespace pointwright::server {

enum class Packing { kTextPly, kDracoTiles };

/// A scan that can be unpacked, as its head says.
struct PackedScan {
  Packing packing = Packing::kTextPly;
  std::uint64_t samples = 0;
  /// Of a sample once unpacked; nullopt: only its tiles say.
  std::optional<std::uint64_t> record_bytes;
  std::uint64_t most_of_tile = 0;  ///< samples of the largest tile; 0: it has none
  /// For one tile to be decoded at a time.
  [[nodiscard]] std::uint64_t least_memory() const;
};
/// nullopt where a scan of this kind is read in memory alone. Errors: those of its header or index
Result<std::optional<PackedScan>> packed_scan(const MappedFile& file);

/// Writes the scan to `to`, a binary PLY of vertices alone. Done by all of a team, each its pieces.
/// Problems: those of reading the scan (with line or tile), of writing, out of disk, cancelled
/// Cost:     one pass over the scan (text: two); memory of a few pieces
std::optional<protocol::Problem> unpack_scan(const JobParams& params, const MappedFile& file,
                                             const PackedScan& scan, const std::string& to, Team& team,
                                             const ExecutionContext& context, const JobProgress& progress);

}  // namespace pointwright::server
