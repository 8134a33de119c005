#pragma once
// Marks as runs of equal ones: neighbours in the order of the samples are neighbours in space.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/editing/painting.h"

namespace pointwright::server {

/// Each run is its length times 4 plus the mark, seven bits a byte, the lowest first, the top bit set on all
/// bytes of a run but the last.
std::vector<std::byte> encode_marks(const Marks& marks);
/// None where the bytes are no runs, or runs of more than `most` samples.
/// Cost: what the runs say, at most `most` bytes
std::optional<Marks> decode_marks(std::span<const std::byte> bytes, std::uint64_t most = 4'000'000'000);

}  // namespace pointwright::server
