#pragma once
// Whole files in and out, so that a reader sees the old file or the new one, never half of either.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace pointwright {

/// The bytes of a regular file (links are followed).
/// Errors: kInvalidArgument (cannot be opened or read; field "path"), kTooLarge (beyond max_bytes)
Result<std::vector<std::byte>> read_file(const std::string& path,
                                         std::uint64_t max_bytes = std::numeric_limits<std::uint64_t>::max());

/// Writes to a new file beside `path`, brings it to the disk, gives it the name, brings the folder to the
/// disk. Where any of that fails, `path` is as it was and nothing is left behind. The file is readable by its
/// owner alone.
/// Errors: kTooLarge (no space or quota; field "path"), kInvalidArgument (anything else; field "path")
Result<void> write_file_atomically(const std::string& path, std::span<const std::byte> bytes);

}  // namespace pointwright
