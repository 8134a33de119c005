#pragma once
// A stand-in for apply_resampled_edit, quick and easy to follow: samples that move far enough get a double.

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/editing/edit.h"
#include "engine/resampling/resampled_edit.h"

namespace pointwright::test {

namespace stand_in {

template <typename T>
std::vector<T> gathered(const std::vector<T>& column, const std::vector<std::uint32_t>& order) {
  std::vector<T> result;
  for (const std::uint32_t i : order) result.push_back(column[i]);
  return result;
}

inline Points gathered(const Points& column, const std::vector<std::uint32_t>& order) {
  Points result(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) result.set(i, column[order[i]]);
  return result;
}

inline MultiresSurface gathered(const MultiresSurface& surface, const std::vector<std::uint32_t>& order) {
  MultiresSurface result;
  for (const Level& level : surface.levels)
    result.levels.push_back(
        {.position = gathered(level.position, order), .normal = gathered(level.normal, order)});
  for (const auto& detail : surface.detail) result.detail.push_back(gathered(detail, order));
  return result;
}

}  // namespace stand_in

/// Doubles every tenth sample that moves by `bound` and more, at a small offset; every twentieth in a
/// preview. With `collect`, every 25th sample that moves is removed. The cells of what is doubled are twice
/// as long.
inline Result<ResampledEdit> double_every_tenth(const MultiresSurface& surface,
                                                const std::shared_ptr<const Sampling>& sampling,
                                                const EditParams& params, const ScaleField& field,
                                                const RegionPair& regions, ResamplingEffort effort,
                                                const ExecutionContext* context) {
  POINTWRIGHT_CHECK(!regions.zero.empty() && !regions.one.empty(), "the regions of the field");
  if (context != nullptr && context->is_cancelled()) return cancelled_error();
  const ResamplingParams& asked = *params.resampling;
  const bool exact = effort == ResamplingEffort::kExact;
  const auto count = static_cast<std::uint32_t>(sampling->size());
  MultiresSurface moved = apply_edit(surface, *sampling->graph, params, field, sampling->cloud->origin);
  std::vector<std::uint32_t> kept;
  std::vector<std::uint32_t> parents;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vec3f way = moved.finest().position[i] - surface.finest().position[i];
    const bool far = static_cast<double>(way.norm()) >= asked.bound * 0.01;
    if (far && i % (exact ? 10 : 20) == 0) parents.push_back(i);
    if (!(exact && asked.collect > 0.0 && field.t[i] > 0.0F && i % 25 == 1)) kept.push_back(i);
  }
  const std::size_t after = kept.size() + parents.size();
  if (asked.max_samples > 0 && after > asked.max_samples && !parents.empty())
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the edit needs " + std::to_string(after) + " samples",
                 .field = "resampling.max_samples",
                 .limit = static_cast<double>(asked.max_samples),
                 .actual = static_cast<double>(after)};
  std::vector<std::uint32_t> order = kept;
  order.insert(order.end(), parents.begin(), parents.end());
  ResampledEdit result{.surface = stand_in::gathered(moved, order),
                       .sampling = nullptr,
                       .inserted = parents.size(),
                       .removed = count - kept.size()};
  for (Level& level : result.surface.levels)
    for (std::size_t i = kept.size(); i < after; ++i)
      level.position.set(i, level.position[i] + Vec3f(0.003F, 0.001F, 0.0F));

  Sampling next = *sampling;
  if (!parents.empty() || kept.size() != count) {
    Cloud cloud = permuted(*sampling->cloud, order);
    next.parent = sampling->parent.empty() ? std::vector<std::uint32_t>(count, kNoParent) : sampling->parent;
    next.parent = stand_in::gathered(next.parent, order);
    for (std::size_t i = kept.size(); i < after; ++i) {
      cloud.position.set(i, result.surface.finest().position[i]);
      next.parent[i] = cloud.id[i];
      cloud.id[i] = next.next_id++;
    }
    next.spacing = stand_in::gathered(sampling->spacing, order);
    next.graph = std::make_shared<const NeighborGraph>(
        build_neighbor_graph(result.surface.finest().position, sampling->graph->k));
    next.cloud = std::make_shared<const Cloud>(std::move(cloud));
  }
  Points u(count), v(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    u.set(i, sampling->cell_u.empty() ? Vec3f(1, 0, 0) : sampling->cell_u[i]);
    v.set(i, sampling->cell_v.empty() ? Vec3f(0, 1, 0) : sampling->cell_v[i]);
  }
  for (const std::uint32_t i : parents) u.set(i, 2.0F * u[i]);
  next.cell_u = stand_in::gathered(u, order);
  next.cell_v = stand_in::gathered(v, order);
  result.sampling = std::make_shared<const Sampling>(std::move(next));
  return result;
}

}  // namespace pointwright::test
