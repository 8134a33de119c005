#pragma once
// Columns in another order, or of a part of the samples.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

/// Entry i of the result is column[order[i]]; an empty column stays empty. Cost: O(order).
template <typename T>
std::vector<T> gathered(const std::vector<T>& column, const std::vector<std::uint32_t>& order) {
  std::vector<T> result;
  if (column.empty()) return result;
  result.reserve(order.size());
  for (const std::uint32_t i : order) result.push_back(column[i]);
  return result;
}

inline Points gathered(const Points& column, const std::vector<std::uint32_t>& order) {
  Points result;
  if (column.empty()) return result;
  result.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) result.set(i, column[order[i]]);
  return result;
}

}  // namespace pointwright
