#pragma once
// A file as one span of bytes, whatever its size: its pages come and go.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "engine/core/result.h"

namespace pointwright::server {

/// Read-only. A file that another program cuts short while it is mapped ends this one (SIGBUS): only workers,
/// whose end harms nobody else, map files.
class MappedFile {
 public:
  /// Errors: kInvalidArgument (cannot be opened, no regular file; field "path"), kEmptyCloud (no bytes)
  static Result<MappedFile> open(const std::string& path);
  ~MappedFile();
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;

  [[nodiscard]] std::span<const std::byte> bytes() const { return {data_, size_}; }
  /// Lets the memory of these bytes go; they can be read again.
  void release(std::uint64_t begin, std::uint64_t end) const;

 private:
  MappedFile(const std::byte* data, std::size_t size) : data_(data), size_(size) {}

  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace pointwright::server
