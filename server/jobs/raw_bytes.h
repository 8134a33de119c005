#pragma once
// Plain values as the bytes they are, between processes and files of one job.

#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

namespace pointwright::server {

template <typename T>
void append_raw(std::vector<std::byte>& bytes, const T* values, std::size_t count) {
  const std::size_t at = bytes.size();
  bytes.resize(at + count * sizeof(T));
  if (count > 0) std::memcpy(bytes.data() + at, static_cast<const void*>(values), count * sizeof(T));
}

/// Takes so many values off the front. False: there are fewer; nothing is taken then.
template <typename T>
bool take_raw(std::span<const std::byte>& bytes, T* to, std::size_t count) {
  if (count > bytes.size() / sizeof(T)) return false;
  if (count > 0) std::memcpy(static_cast<void*>(to), bytes.data(), count * sizeof(T));
  bytes = bytes.subspan(count * sizeof(T));
  return true;
}

}  // namespace pointwright::server
