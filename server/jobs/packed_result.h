#pragma once
// The last step where a result is wanted as Draco tiles: cut by where its samples stand, and written piece by
// piece.

#include <cstdint>
#include <optional>
#include <string>

#include "engine/core/execution_context.h"
#include "protocol/json/problem.h"
#include "server/jobs/full_resolution.h"
#include "server/jobs/team.h"

namespace pointwright::server {

/// Bytes of scratch files for so many samples, beside the tiles' own bytes.
std::uint64_t packing_bytes(std::uint64_t samples, std::uint64_t record_bytes);

/// Writes the binary PLY `made` as Draco tiles (engine/io/draco_tiles.h) to `output`; lossless. Scratch files
/// go to `folder`, made where it is not there and removed in the end. Done by all of a team, each its tiles;
/// the archive is the leader's.
/// Problems:    those of reading and of writing, cancelled
/// Cost:        three passes over the samples, in memory of two tiles; what stands in one place is one tile's
/// Determinism: the same bytes for any number of threads and of a team; memory_bytes says how large tiles are
std::optional<protocol::Problem> pack_result(const std::string& made, const std::string& output,
                                             const std::string& folder, std::uint64_t memory_bytes,
                                             Team& team, const ExecutionContext& context,
                                             const JobProgress& progress);

}  // namespace pointwright::server
