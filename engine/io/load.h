#pragma once
// Values out of files' bytes, which stand where they stand.

#include <cstddef>
#include <cstring>

namespace pointwright {

/// The value whose bytes begin there, aligned or not.
template <typename T>
T load(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof(T));
  return value;
}

}  // namespace pointwright
