#pragma once
// A coarsening that is nothing but a grid: for tests of the V-cycle that should not depend on how pairs are
// contracted.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "engine/core/median.h"
#include "engine/core/parallel.h"
#include "engine/smoothing/smoothing_hierarchy.h"
#include "engine/spatial/coherent_order.h"

namespace pointwright::test {

/// Means over the cells of a grid, 2.45 spacings wide: a quarter of the samples on a surface that cuts the
/// grid at random.
inline Result<Coarsening> coarsen_by_voxels(const Points& position, const Points& normal,
                                            const NeighborGraph& graph) {
  const float cell = 2.45F * median(local_spacing(position, graph));
  const Box3f box = bounds_of(position);
  std::vector<std::uint64_t> keys(position.size());
  std::vector<std::uint32_t> order(position.size());
  std::iota(order.begin(), order.end(), 0U);
  for (std::size_t i = 0; i < position.size(); ++i) {
    const Vec3f c = (position[i] - box.min) / cell;
    keys[i] = static_cast<std::uint64_t>(c.x()) | (static_cast<std::uint64_t>(c.y()) << 21) |
              (static_cast<std::uint64_t>(c.z()) << 42);
  }
  sort_by_key(keys, order);
  Coarsening result;
  result.parent.resize(position.size());
  std::vector<Vec3f> places;
  std::vector<Vec3f> normals;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    Vec3f place = Vec3f::Zero();
    Vec3f direction = Vec3f::Zero();
    for (; end < order.size() && keys[end] == keys[begin]; ++end) {
      place += position[order[end]] - position[order[begin]];
      direction += normal[order[end]];
      result.parent[order[end]] = static_cast<std::uint32_t>(places.size());
    }
    places.emplace_back(position[order[begin]] + place / static_cast<float>(end - begin));
    normals.push_back(direction.norm() > 0.0F ? Vec3f(direction.normalized()) : normal[order[begin]]);
    begin = end;
  }
  Points unordered(places.size());
  for (std::size_t m = 0; m < places.size(); ++m) unordered.set(m, places[m]);
  const std::vector<std::uint32_t> coherent = coherent_order(unordered);
  std::vector<std::uint32_t> rank(coherent.size());
  result.position.resize(coherent.size());
  result.normal.resize(coherent.size());
  for (std::uint32_t m = 0; m < coherent.size(); ++m) {
    rank[coherent[m]] = m;
    result.position.set(m, unordered[coherent[m]]);
    result.normal.set(m, normals[coherent[m]]);
  }
  for (std::uint32_t& parent : result.parent) parent = rank[parent];
  return result;
}

}  // namespace pointwright::test
