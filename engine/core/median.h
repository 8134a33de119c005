#pragma once
// The median of a list.

#include <algorithm>
#include <cstddef>
#include <vector>

namespace pointwright {

/// The upper median; T() of an empty list. Cost: O(N).
template <typename T>
T median(std::vector<T> values) {
  if (values.empty()) return T();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace pointwright
