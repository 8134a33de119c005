#include "tests/bench/peers/library.h"

#include <algorithm>

#include "engine/core/parallel.h"

namespace pointwright::peers {

void search_all(std::size_t samples, std::uint32_t k, NeighborLists& lists,
                const std::function<void(std::size_t, std::uint32_t*)>& search) {
  parallel_for(samples, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> found(k + 1);
    for (std::size_t i = begin; i < end; ++i) {
      search(i, found.data());
      // The sample is the first of its list; among exact duplicates it may be another, or not in it at all.
      const auto self = std::find(found.begin(), found.end() - 1, i);
      std::copy(self + 1, found.end(),
                std::copy(found.begin(), self, lists.begin() + static_cast<std::ptrdiff_t>(i * k)));
    }
  });
}

}  // namespace pointwright::peers
