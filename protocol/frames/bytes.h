#pragma once
// Little-endian scalars in byte buffers.

#include <bit>
#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace pointwright::protocol {

static_assert(std::endian::native == std::endian::little,
              "frames are little-endian and copied as they are; a big-endian port has to swap bytes here");

/// Reads a scalar at `offset`. Pre: it lies inside the bytes.
template <typename T>
T load(std::span<const std::byte> bytes, std::size_t offset) {
  static_assert(std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, bytes.subspan(offset, sizeof(T)).data(), sizeof(T));
  return value;
}

/// Writes a scalar at `out`. Pre: sizeof(T) bytes there are writable.
template <typename T>
void store(std::byte* out, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::memcpy(out, &value, sizeof(T));
}

/// Bytes up to the next whole word of 4.
constexpr std::size_t padded_to_word(std::size_t bytes) {
  return (bytes + 3) / 4 * 4;
}

/// Leaves new elements uninitialised: a buffer that is about to be written whole need not be cleared first.
template <typename T>
struct UninitialisedAllocator : std::allocator<T> {
  template <typename U>
  struct rebind {                             // NOLINT(readability-identifier-naming): the standard's name
    using other = UninitialisedAllocator<U>;  // NOLINT(readability-identifier-naming)
  };
  template <typename U>
  void construct(U* place) noexcept(std::is_nothrow_default_constructible_v<U>) {
    ::new (static_cast<void*>(place)) U;
  }
  template <typename U, typename... Args>
  void construct(U* place, Args&&... args) {
    ::new (static_cast<void*>(place)) U(std::forward<Args>(args)...);
  }
};

}  // namespace pointwright::protocol
