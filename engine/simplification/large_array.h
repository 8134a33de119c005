#pragma once
// Scratch memory of a contraction (internal to this folder).

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include "engine/core/parallel.h"

namespace pointwright {

/// Of a LargeArray: knows how it was come by.
struct FreeMemory {
  void* mapping = nullptr;  ///< or nullptr: from operator new
  std::size_t bytes = 0;
  std::align_val_t alignment{};
  template <typename T>
  void operator()(T* memory) const {
#if defined(__linux__)
    if (mapping != nullptr) {
      munmap(mapping, bytes);
      return;
    }
#endif
    ::operator delete(memory, alignment);
  }
};

/// An array without values, aligned to cache lines at least. Returned to the system as soon as it goes.
template <typename T>
using LargeArray = std::unique_ptr<T[], FreeMemory>;

/// Asks for large pages where that is worth it: the first touch of each small one costs more than writing it,
/// and reading far apart looks up an address for each.
template <typename T>
LargeArray<T> make_large_array(std::size_t count) {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
  constexpr std::size_t kLine = 64;
  static_assert(alignof(T) <= kLine);
#if defined(__linux__) && defined(MADV_HUGEPAGE)
  constexpr std::size_t kPage = std::size_t{2} << 20U;
  if (count * sizeof(T) >= kPage) {
    std::size_t bytes = (count * sizeof(T) + kPage - 1) / kPage * kPage;
    std::size_t room = bytes + kPage;  // what lies before and after whole pages is never touched
    void* const mapping = mmap(nullptr, room, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapping == MAP_FAILED) throw std::bad_alloc();
    void* first = mapping;
    std::align(kPage, bytes, first, room);
    madvise(first, bytes, MADV_HUGEPAGE);  // no more than a wish
    return {static_cast<T*>(first), FreeMemory{.mapping = mapping, .bytes = bytes + kPage}};
  }
#endif
  constexpr std::align_val_t kAlignment{kLine};
  return {static_cast<T*>(::operator new(count * sizeof(T), kAlignment)),
          FreeMemory{.alignment = kAlignment}};
}

/// Leaves the values source[0], source[1], ..., in this order, and gives back the room of the others.
template <typename T>
void compact(LargeArray<T>& values, const std::uint32_t* source, std::size_t count) {
  LargeArray<T> left = make_large_array<T>(count);
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) left[i] = values[source[i]];
  });
  values = std::move(left);
}

}  // namespace pointwright
