// Resampling of samples and deformations that leave little to compute with.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "engine/resampling/cells.h"
#include "engine/resampling/resampled_edit.h"
#include "tests/support/pulled_plane.h"

namespace pointwright {
namespace {

/// Any samples between a zero-region at the origin and a one-region at (1, 0, 0).
test::PulledPlane scene_of(const test::Surface& samples, const Deformation& deformation) {
  test::PulledPlane scene;
  const std::size_t n = samples.size();
  scene.surface.levels.push_back({.position = samples.position, .normal = samples.normal});
  scene.regions = {.zero = Region(test::from_list({Vec3f::Zero()}), {0.05F}),
                   .one = Region(test::from_list({Vec3f::UnitX()}), {0.05F})};
  scene.params = {.deformation = deformation, .resampling = ResamplingParams{.collect = 0.9}};
  scene.field = compute_scale_field(samples.position, scene.regions, scene.params.blend);
  scene.sampling = std::make_shared<const Sampling>(
      rest_sampling(std::make_shared<const Cloud>(test::to_cloud(samples)),
                    std::make_shared<const NeighborGraph>(build_neighbor_graph(samples.position, 10)),
                    std::vector<float>(n, 0.1F)));
  return scene;
}

test::Surface facing_up(const Points& position) {
  test::Surface samples{.position = position, .normal = Points(position.size())};
  for (std::size_t i = 0; i < position.size(); ++i) samples.normal.set(i, Vec3f::UnitZ());
  return samples;
}

ResampledEdit resampled(const test::PulledPlane& scene) {
  auto result = apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field, scene.regions,
                                     ResamplingEffort::kExact);
  REQUIRE(result.ok());
  return std::move(result).value();
}

/// Columns of one size without a hole, ids and neighbours that exist.
void check_whole(const ResampledEdit& edit, std::size_t before) {
  const Sampling& sampling = *edit.sampling;
  const std::size_t n = before + edit.inserted - edit.removed;
  REQUIRE(sampling.size() == n);
  REQUIRE(edit.surface.sample_count() == n);
  REQUIRE(sampling.cloud->size() == n);
  REQUIRE(sampling.graph->count == n);
  CHECK((sampling.parent.empty() || sampling.parent.size() == n));
  CHECK(sampling.cell_u.size() == n);
  CHECK(sampling.cell_v.size() == n);
  for (const Level& level : edit.surface.levels) {
    REQUIRE(level.position.size() == n);
    CHECK(test::all_finite(level.position));
    CHECK(test::all_finite(level.normal));
  }
  CHECK(test::all_finite(sampling.cell_u));
  CHECK(test::all_finite(sampling.cell_v));
  std::vector<std::uint32_t> ids(sampling.cloud->id.begin(), sampling.cloud->id.end());
  std::sort(ids.begin(), ids.end());
  CHECK(std::adjacent_find(ids.begin(), ids.end()) == ids.end());
  CHECK((ids.empty() || ids.back() < sampling.next_id));
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < sampling.graph->k; ++j)
      beyond += static_cast<std::size_t>(sampling.graph->index(i, j) >= n);
  CHECK(beyond == 0);
}

TEST_CASE("stretches of any size have principal axes") {
  for (const float size : {1e-30F, 1e-12F, 1e-6F, 1.0F, 1e6F, 1e12F, 1e30F}) {
    CAPTURE(size);
    const PrincipalStretch stretch =
        principal_stretch({3.0F * size, 4.0F * size, 0.0F}, {0.0F, 0.0F, 2.0F * size});
    CHECK(stretch.major / size == doctest::Approx(5.0F).epsilon(1e-6));
    CHECK(stretch.minor / size == doctest::Approx(2.0F).epsilon(1e-6));
    CHECK(stretch.cosine == 1.0F);
    CHECK(stretch.sine == 0.0F);
  }
  const PrincipalStretch nothing = principal_stretch(Vec3f::Zero(), Vec3f::Zero());
  CHECK(nothing.major == 0.0F);
  CHECK(nothing.minor == 0.0F);
  CHECK(nothing.cosine == 1.0F);
}

TEST_CASE("the farthest pull that an edit may ask for splits each sample into as many as may be") {
  test::PulledPlane scene = test::pulled_plane(12);
  scene.params.deformation = Translation{.vector = Vec3d(0.0, 0.0, kMaxDeformationLength)};
  const std::size_t before = scene.sampling->size();
  const ResampledEdit edit = resampled(scene);
  check_whole(edit, before);
  const auto stretched = static_cast<std::size_t>(std::count_if(
      scene.field.t.begin(), scene.field.t.end(), [](float t) { return t > 0.0F && t < 1.0F; }));
  REQUIRE(stretched > 40);
  CHECK(edit.inserted >= 60 * stretched);
  const Points& p = edit.surface.finest().position;
  Points rest(p.size());
  for (std::size_t i = 0; i < p.size(); ++i) rest.set(i, {p[i].x(), p[i].y(), 0.0F});
  const ScaleField field = compute_scale_field(rest, scene.regions, scene.params.blend);
  std::size_t off = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
    off += static_cast<std::size_t>(p[i].z() != field.t[i] * static_cast<float>(kMaxDeformationLength));
  CHECK(off == 0);
}

TEST_CASE("a few samples, and samples at one place or on a line, are resampled or left as they are") {
  const Vec3f middle(0.5F, 0.0F, 0.0F);
  for (const Deformation& deformation :
       {Deformation(Translation{.vector = Vec3d(5.0, 0.0, 1.0)}), Deformation(NormalOffset{.distance = 5.0}),
        Deformation(Scaling{.center = Vec3d::Zero(), .factors = Vec3d::Constant(1e-3)}),
        Deformation(Scaling{.center = Vec3d::Zero(), .factors = Vec3d(1e-3, 4.0, 1e-3)})}) {
    CHECK(resampled(scene_of(facing_up(Points(0)), deformation)).sampling->size() == 0);
    const auto alone = resampled(scene_of(facing_up(test::identical(1, middle)), deformation));
    check_whole(alone, 1);
    CHECK(alone.inserted + alone.removed == 0);  // no neighbours, no cell
    const auto copies = resampled(scene_of(facing_up(test::identical(40, middle)), deformation));
    check_whole(copies, 40);
    CHECK(copies.inserted == 0);
    for (const std::size_t count : {2UL, 3UL, 60UL}) {
      CAPTURE(count);
      const auto line = facing_up(test::collinear(count, {0.1F, 0.0F, 0.0F}, {0.9F, 0.0F, 0.0F}));
      check_whole(resampled(scene_of(line, deformation)), count);
    }
  }
}

TEST_CASE("two coinciding sheets that are squeezed together each keep some samples") {
  test::Surface up = test::plane(24, 0.04, test::Sampling::kJittered);
  up = test::moved(up, Vec3d(0.5, 0.0, 0.0));
  test::Surface down = up;
  for (std::size_t i = 0; i < down.size(); ++i) down.normal.set(i, -up.normal[i]);
  // Both sheets twice: every place holds two samples that face up and two that face down.
  const test::Surface both = test::joined({up, down, up, down});
  const test::PulledPlane scene =
      scene_of(both, Scaling{.center = Vec3d::UnitX(), .factors = Vec3d::Constant(1e-2)});
  const ResampledEdit edit = resampled(scene);
  check_whole(edit, both.size());
  CHECK(edit.removed > both.size() / 10);
  const Points& normal = edit.surface.finest().normal;
  std::size_t facing_down = 0;
  for (std::size_t i = 0; i < normal.size(); ++i)
    facing_down += static_cast<std::size_t>(normal[i].z() < 0.0F);
  CHECK(facing_down > normal.size() / 4);
  CHECK(facing_down < normal.size() - normal.size() / 4);
}

}  // namespace
}  // namespace pointwright
