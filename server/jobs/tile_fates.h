#pragma once
// What became of a tile's own samples, and who was inserted among them.

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/core/points.h"
#include "engine/transfer/transferred_edits.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {

/// Where a tile's samples come from.
struct TileSource {
  const MappedFile& file;
  const ScanRecords& records;
};

/// Gives a tile's cloud what inserted samples take from those around them: the numbers of its records that
/// lie between (ScanRecords::mixed), and whose record each one is.
/// Cost: reads the records
void take_record_values(const TileSource& source, TileInput& input);

/// What one step made of a tile. Own samples alone: each inserted one belongs to the tile of the one that it
/// descends from.
/// `rest`, `shown`: of the preview's samples, before and after; NaN where one was collected
/// Pre:    take_record_values() before edits that resample
/// Errors: kInvalidArgument, where a record cannot say the place of an inserted sample
Result<TileResult> result_of(const TileSource& source, const TileInput& input, const TransferredSamples& made,
                             const Points& rest, const Points& shown);

/// The tile's own samples, and those that descend from them.
std::uint64_t own_count(const TileInput& input, const Sampling& sampling);

/// What a file's whole numbers cannot say.
Error unsaid_place();

}  // namespace pointwright::server
