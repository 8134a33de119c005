#pragma once
// Marks as runs of equal ones: neighbours in the order of the samples are neighbours in space.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "engine/editing/painting.h"

namespace pointwright::server {

/// Each run is its length times 4 plus the mark, seven bits a byte, the lowest first, the top bit set on all
/// bytes of a run but the last.
std::vector<std::byte> encode_marks(const Marks& marks);
/// None where the bytes are not what encode_marks() makes.
std::optional<Marks> decode_marks(std::span<const std::byte> bytes);

}  // namespace pointwright::server
