#include "server/jobs/tile_cuts.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace pointwright::server {
namespace {

const float* column(const Points& points, int axis) {
  return axis == 0 ? points.x() : axis == 1 ? points.y() : points.z();
}

}  // namespace

TileCuts::TileCuts(const Points& samples, std::size_t most, std::size_t most_of_cell) {
  std::vector<std::uint32_t> order(samples.size());
  std::iota(order.begin(), order.end(), 0U);
  nodes_.emplace_back();
  const Most each{.tile = std::max<std::size_t>(most, 1), .cell = std::max<std::size_t>(most_of_cell, 1)};
  divide(samples, order, 0, order.size(), each, false, 0);
}

void TileCuts::divide(const Points& samples, std::vector<std::uint32_t>& order, std::size_t begin,
                      std::size_t end, Most most, bool in_tile, std::uint32_t node) {
  const auto open_tile = [&] {
    if (!in_tile) first_cells_.push_back(cell_count_);
    in_tile = true;
  };
  const auto leaf = [&] {
    open_tile();
    nodes_[node].below = cell_count_++;
  };
  if (end - begin <= most.tile) open_tile();
  if (in_tile && end - begin <= most.cell) return leaf();
  Box3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(samples[order[i]]);
  int axis = 0;
  (box.max - box.min).maxCoeff(&axis);
  if (!(box.max[axis] > box.min[axis])) return leaf();  // all in one place
  const float* const values = column(samples, axis);
  const auto first = order.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = order.begin() + static_cast<std::ptrdiff_t>(end);
  const auto less = [&](std::uint32_t a, std::uint32_t b) { return values[a] < values[b]; };
  std::nth_element(first, first + (last - first) / 2, last, less);
  float cut = values[*(first + (last - first) / 2)];
  if (cut == box.min[axis]) {
    // Half of them share the lowest place: the cut goes above it.
    cut = std::numeric_limits<float>::max();
    for (auto i = first; i != last; ++i)
      if (values[*i] > box.min[axis]) cut = std::min(cut, values[*i]);
  }
  const auto middle = std::partition(first, last, [&](std::uint32_t i) { return values[i] < cut; });
  const auto split = static_cast<std::size_t>(middle - order.begin());
  nodes_[node].cut = cut;
  nodes_[node].axis = axis;
  nodes_[node].below = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  divide(samples, order, begin, split, most, in_tile, nodes_[node].below);
  nodes_[node].above = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  divide(samples, order, split, end, most, in_tile, nodes_[node].above);
}

std::uint32_t TileCuts::cell_of(const Vec3f& p) const {
  const Node* node = nodes_.data();
  while (node->axis >= 0) node = &nodes_[p[node->axis] < node->cut ? node->below : node->above];
  return node->below;
}

std::vector<std::uint32_t> TileCuts::cells_in(const Box3f& box) const {
  std::vector<std::uint32_t> cells;
  std::vector<std::uint32_t> open{0};
  while (!open.empty()) {
    const Node& node = nodes_[open.back()];
    open.pop_back();
    if (node.axis < 0) {
      cells.push_back(node.below);
      continue;
    }
    if (box.max[node.axis] >= node.cut) open.push_back(node.above);
    if (box.min[node.axis] < node.cut) open.push_back(node.below);
  }
  std::sort(cells.begin(), cells.end());
  return cells;
}

}  // namespace pointwright::server
