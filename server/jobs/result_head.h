#pragma once
// What stands before and behind the records of a result, where their number has changed.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "server/jobs/scan_records.h"

namespace pointwright::server {

/// LAS counts its points by the number of their return, from 1 on.
using ReturnCounts = std::array<std::uint64_t, 15>;
void add_returns(const ScanRecords& records, std::span<const std::byte> chunk, ReturnCounts& counts);

/// The bytes before the first record, for `count` records: those of the scan where it had as many. What the
/// records themselves say (bounds, returns) is not in it yet.
/// Errors: kTooLarge, where the file's version cannot say so many
Result<std::vector<std::byte>> head_of_result(const ScanRecords& records, std::span<const std::byte> scan,
                                              std::uint64_t count);

/// Puts the number of points by their return into a LAS file's head.
void set_returns(std::span<std::byte> head, const ReturnCounts& counts);

}  // namespace pointwright::server
