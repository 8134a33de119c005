#pragma once
// ZIP archives of whole files, by way of libarchive (https://libarchive.org).

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"

struct archive;

namespace pointwright {

struct ZipEntry {
  std::string name;
  std::uint64_t bytes = 0;  ///< of its content
  /// Called once, when its turn comes.
  std::function<Result<std::vector<std::byte>>()> content;
};
/// Takes the archive's bytes in their order. False: it cannot.
using ByteSink = std::function<bool(std::span<const std::byte>)>;

/// The entries in that order, not compressed; the same entries give the same bytes.
/// Errors: those of the entries' contents; kInvalidArgument where one has other bytes than it says, or the
///         sink took no more
Result<void> write_zip(std::span<const ZipEntry> entries, const ByteSink& sink);

/// Reads the files of an archive one after the other, in the order of their places in it.
class ZipReader {
 public:
  /// The bytes must outlive the reader. Errors: kMalformedData
  static Result<ZipReader> open(std::span<const std::byte> bytes);

  /// The next file's name; nullopt behind the last. Errors: kMalformedData
  Result<std::optional<std::string>> next();
  /// What the file of the last next() holds. Errors: kMalformedData, kTooLarge beyond so many bytes
  Result<std::vector<std::byte>> content(std::uint64_t most_bytes);

 private:
  explicit ZipReader(archive* opened);

  std::unique_ptr<archive, int (*)(archive*)> archive_;
  std::string name_;  // of the current file
  bool is_at_end_ = false;
};

}  // namespace pointwright
