#pragma once
// Scenes for dynamic resampling, and what must hold after every edit.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "engine/editing/deformation_map.h"
#include "engine/resampling/carried_sampling.h"
#include "engine/resampling/insertion.h"
#include "engine/resampling/relaxation.h"
#include "engine/resampling/resampled_edit.h"
#include "tests/editing/editing_support.h"
#include "tests/support/spacing.h"
#include "tests/support/surfaces.h"

namespace pointwright::test {

/// A surface, its samples and an edit of it.
struct EditScene {
  MultiresSurface surface;
  std::shared_ptr<const pointwright::Sampling> sampling;
  RegionPair regions;
  EditParams params;
  ScaleField field;
};

inline Level level_of(const Surface& surface) {
  return {.position = surface.position, .normal = surface.normal};
}

/// Parameters of one deformation with resampling.
inline EditParams resampling_by(const Deformation& deformation, const ResamplingParams& resampling = {}) {
  return {.level = 0,
          .blend = Blend::kQuartic,
          .deformation = deformation,
          .gains = {},
          .resampling = resampling};
}

/// The zero- and the one-region by where samples stand on the level: 1, 2 or 0 as RegionKind.
using RegionOf = std::function<int(const Vec3f&)>;
inline RegionPair regions_on(const Points& position, const std::vector<float>& spacing,
                             const RegionOf& region_of) {
  Marks marks(position.size(), 0);
  for (std::size_t i = 0; i < marks.size(); ++i) marks[i] = static_cast<std::uint8_t>(region_of(position[i]));
  auto regions = regions_from_marks(position, spacing, marks, Vec3d::Zero());
  REQUIRE(regions.ok());
  return std::move(regions).value();
}

/// One ball.
inline Region ball(const Vec3f& center, float radius) {
  return Region(from_list({center}), {radius});
}
/// t = 1 on all of a surface, wherever edits take it.
inline RegionPair everything() {
  return {.zero = ball({1e6F, 0.0F, 0.0F}, 1.0F), .one = ball(Vec3f::Zero(), 1e5F)};
}

/// A scene of samples that have a graph of k neighbours and their local spacing; the regions as given.
inline EditScene scene_with(const MultiresSurface& surface, const Cloud& cloud, const RegionPair& regions,
                            const EditParams& params, std::uint32_t k = 10) {
  EditScene scene{.surface = surface, .sampling = nullptr, .regions = regions, .params = params, .field = {}};
  auto graph = std::make_shared<const NeighborGraph>(build_neighbor_graph(surface.finest().position, k));
  std::vector<float> spacing = local_spacing(surface.finest().position, *graph);
  scene.sampling = std::make_shared<const pointwright::Sampling>(
      rest_sampling(std::make_shared<const Cloud>(cloud), graph, std::move(spacing)));
  scene.field = compute_scale_field(surface.levels[params.level].position, regions, params.blend);
  return scene;
}
inline EditScene scene_of(const MultiresSurface& surface, const RegionOf& region_of,
                          const EditParams& params) {
  const Points& position = surface.levels[params.level].position;
  const NeighborGraph graph = build_neighbor_graph(surface.finest().position, 10);
  return scene_with(surface, to_cloud(surface.finest().position),
                    regions_on(position, local_spacing(position, graph), region_of), params);
}

/// What comes after an edit: the same regions or others, another edit.
inline EditScene scene_after(const ResampledEdit& edit, const RegionPair& regions, const EditParams& params) {
  return {.surface = edit.surface,
          .sampling = edit.sampling,
          .regions = regions,
          .params = params,
          .field = compute_scale_field(edit.surface.levels[params.level].position, regions, params.blend)};
}

/// Of an EditScene or a PulledPlane.
template <typename Scene>
ResampledEdit resampled(const Scene& scene, ResamplingEffort effort = ResamplingEffort::kExact) {
  auto result =
      apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field, scene.regions, effort);
  REQUIRE(result.ok());
  return std::move(result).value();
}

/// Where the inserted samples stand at rest, step by step as apply_resampled_edit() finds it.
template <typename Scene>
Points children_at_rest(const Scene& scene) {
  const Level& level = scene.surface.levels[scene.params.level];
  const DeformMap map = to_deform_map(scene.params.deformation, scene.sampling->cloud->origin);
  const std::vector<std::uint32_t> blocks = moving_blocks(scene.field);
  const Cells rest = cells_on_level(*scene.sampling, level.normal, blocks);
  const MappedCells mapped = map_cells(map, blocks, scene.field, level, rest, nullptr);
  const ResamplingParams& params = *scene.params.resampling;
  const auto splits = find_splits(*scene.sampling, mapped.cells, scene.field, blocks, params);
  REQUIRE(splits.ok());
  std::vector<std::uint32_t> parents;
  for (const Split& split : splits.value().splits) parents.push_back(split.sample);
  RestPatches patches(level, *scene.sampling->graph);
  patches.require(parents);
  Births births = give_birth(splits.value(), patches, *scene.sampling, rest, mapped.cells, scene.field);
  RelaxationMemory memory;
  relax({.map = map,
         .regions = scene.regions,
         .blend = scene.params.blend,
         .splits = splits.value(),
         .patches = patches,
         .sampling = *scene.sampling,
         .rest = rest,
         .rest_position = level.position,
         .deformed = mapped.position,
         .blocks = blocks,
         .params = params,
         .coarser = 1.0F},
        params.sweeps, births, memory);
  Points children(births.x.size());
  for (std::size_t c = 0; c < births.x.size(); ++c)
    children.set(c,
                 patches.of(splits.value().splits[births.split[c]].sample).point(births.x[c], births.y[c]));
  return children;
}

/// F of a level of samples that are no scene's own, with their t.
struct DeformedLevel {
  ScaleField field;
  Level level;
};
template <typename Scene>
DeformedLevel deformed_by(const Scene& scene, const Level& rest) {
  DeformedLevel result{.field = compute_scale_field(rest.position, scene.regions, scene.params.blend),
                       .level = rest};
  deform(scene.params.deformation, Vec3d::Zero(), result.field, rest, result.level);
  return result;
}

/// Points spread evenly over the part of the true deformed surface with 0 < t < 1: of a dense sampling of the
/// surface at rest, as many stay as the deformation makes area.
template <typename Scene>
Points evenly_on_deformed(const Scene& scene, const Level& dense) {
  const DeformedLevel deformed = deformed_by(scene, dense);
  std::vector<double> area(dense.position.size(), 0.0);
  for (std::size_t i = 0; i < area.size(); ++i) {
    const float t = deformed.field.t[i];
    if (t <= 0.0F || t >= 1.0F) continue;
    const Mat3d jacobian =
        deformation_jacobian(scene.params.deformation, dense.position[i].cast<double>(),
                             static_cast<double>(t), deformed.field.gradient[i].template cast<double>());
    const Vec3d n = dense.normal[i].cast<double>();
    const Vec3d u = n.unitOrthogonal();
    area[i] = (jacobian * u).cross(jacobian * n.cross(u)).norm();
  }
  const double most = *std::max_element(area.begin(), area.end());
  Random random(3);
  std::vector<Vec3f> list;
  for (std::size_t i = 0; i < area.size(); ++i)
    if (random.uniform() * most < area[i]) list.push_back(deformed.level.position[i]);
  return from_list(list);
}

/// Radii of the largest empty discs around points of the true surface.
struct Holes {
  double p999 = 0.0;
  double most = 0.0;
};
inline Holes holes_of(const Points& surface, const Points& samples, double unit) {
  const std::vector<double> gap = distances_to(surface, samples);
  return {.p999 = gap[gap.size() * 999 / 1000] / unit, .most = gap.back() / unit};
}

/// Those of the points whose entry of `keep` is set.
inline Points selected(const Points& points, const std::vector<std::uint8_t>& keep) {
  std::vector<Vec3f> list;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (keep[i] != 0) list.push_back(points[i]);
  return coherent(from_list(list));
}

inline double root_mean_square(const std::vector<double>& values) {
  double square = 0.0;
  for (const double value : values) square += value * value;
  return values.empty() ? 0.0 : std::sqrt(square / static_cast<double>(values.size()));
}

/// Entries of rows that are wrong: a sample that there is not, or the row's own.
inline std::size_t wrong_rows(const NeighborGraph& graph) {
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < graph.count; ++i)
    for (std::uint32_t j = 0; j < graph.k; ++j)
      wrong += graph.index(i, j) >= graph.count || graph.index(i, j) == i ? 1U : 0U;
  return wrong;
}

/// What holds after every edit: columns of one length, distinct ids, finite places, unit normals, rows of
/// neighbours that exist.
inline void check_sound(const ResampledEdit& edit) {
  const pointwright::Sampling& sampling = *edit.sampling;
  const std::size_t n = sampling.size();
  CHECK(sampling.cloud->size() == n);
  CHECK(sampling.graph->count == n);
  CHECK(sampling.cell_u.size() == n);
  CHECK(sampling.cell_v.size() == n);
  CHECK((sampling.parent.empty() || sampling.parent.size() == n));
  CHECK(wrong_rows(*sampling.graph) == 0);
  CHECK(pointwright::validate(*sampling.cloud).ok());
  CHECK(all_finite(sampling.cell_u));
  CHECK(all_finite(sampling.cell_v));
  for (const std::uint32_t id : sampling.cloud->id) REQUIRE(id < sampling.next_id);
  for (const Level& level : edit.surface.levels) {
    REQUIRE(level.position.size() == n);
    REQUIRE(level.normal.size() == n);
    CHECK(all_finite(level.position));
    float farthest = 0.0F;
    for (std::size_t i = 0; i < n; ++i) {
      const float away = std::abs(level.normal[i].norm() - 1.0F);
      farthest = away <= farthest ? farthest : away;  // NaN counts
    }
    CHECK(farthest < 1e-5F);
  }
  for (const std::vector<float>& detail : edit.surface.detail) {
    REQUIRE(detail.size() == n);
    CHECK(std::all_of(detail.begin(), detail.end(), [](float d) { return std::isfinite(d); }));
  }
}

inline bool same_bytes(const NeighborGraph& a, const NeighborGraph& b) {
  return a.count == b.count && a.k == b.k && a.lanes == b.lanes;
}
/// Clouds that are equal as values and hold no NaN are equal to the bit but for the sign of zeros.
inline bool same_bytes(const ResampledEdit& a, const ResampledEdit& b) {
  const pointwright::Sampling& s = *a.sampling;
  const pointwright::Sampling& t = *b.sampling;
  return a.inserted == b.inserted && a.removed == b.removed && same_bytes(a.surface, b.surface) &&
         same_bytes(*s.graph, *t.graph) && s.spacing == t.spacing && s.parent == t.parent &&
         same_bytes(s.cell_u, t.cell_u) && same_bytes(s.cell_v, t.cell_v) && s.next_id == t.next_id &&
         s.cloud->id == t.cloud->id && same_bytes(s.cloud->position, t.cloud->position) &&
         s.cloud->texcoord == t.cloud->texcoord && s.cloud->color == t.cloud->color &&
         s.cloud->scalars == t.cloud->scalars;
}

}  // namespace pointwright::test
