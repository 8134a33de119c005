#pragma once
// LZF, the compression inside binary_compressed PCD files.

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/core/result.h"

namespace pointwright {

/// No LZF data expands to more than this many bytes a byte: three of them say 264 at most.
inline constexpr std::uint64_t kMostLzfRatio = 88;

/// Expands `from` into all of `to`: not a byte less, not a byte more.
/// Errors: kMalformedData
Result<void> expand_lzf(std::span<const std::byte> from, std::span<std::byte> to);

}  // namespace pointwright
