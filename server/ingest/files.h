#pragma once
// Whole files in and out, so that a reader sees the old file or the new one, never half of either.

#include <cstddef>
#include <cstdint>
#include <functional>
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

/// Why a call failed, by its errno: kTooLarge where there is no room (or quota), else kInvalidArgument; field
/// "path".
Error file_error(const char* what, const std::string& path, int number);

/// Writes to a new file beside `path`, brings it to the disk, gives it the name, brings the folder to the
/// disk. Where any of that fails, `path` is as it was and nothing is left behind. The file is readable by its
/// owner alone.
/// Errors: kTooLarge (no space or quota; field "path"), kInvalidArgument (anything else; field "path")
Result<void> write_file_atomically(const std::string& path, std::span<const std::byte> bytes);
/// The same with what fill(descriptor) writes; false: errno says why it could not. An error of its own is
/// what is answered.
Result<void> fill_file_atomically(const std::string& path, const std::function<Result<bool>(int)>& fill);
/// The same with the first `size` bytes of an open file, piece by piece.
Result<void> copy_file_atomically(const std::string& path, int file, std::uint64_t size);

/// Deletes what writers of `path` left beside it when they were killed: files with their names, of processes
/// that are not there and that nobody holds.
void remove_leftovers(const std::string& path);

/// Calls take(piece) for every piece of an open file's first `size` bytes, in order, wherever its offset
/// stands. False: it cannot be read or is shorter, or take() says so.
bool read_pieces(int file, std::uint64_t size, const std::function<bool(std::span<const std::byte>)>& take);

/// Writes all of it where the open file's offset stands. False: errno says why.
bool write_all(int file, std::span<const std::byte> bytes);
/// The same at `offset` from the file's beginning, wherever its own stands.
bool write_all_at(int file, std::span<const std::byte> bytes, std::uint64_t offset);

/// Brings the names in a folder to the disk. False: the disk does not say so.
bool sync_folder(const std::string& path);

}  // namespace pointwright
