// Figure 7: samples inserted into a plane that is pulled up.
#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>

#include "engine/core/parallel.h"
#include "engine/resampling/resampled_edit.h"
#include "tests/support/pulled_plane.h"
#include "tests/support/spacing.h"

namespace pointwright {
namespace {

ResampledEdit resampled(const test::PulledPlane& scene, ResamplingEffort effort = ResamplingEffort::kExact) {
  auto result =
      apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field, scene.regions, effort);
  REQUIRE(result.ok());
  return std::move(result).value();
}

// The height of the pulled plane over a point at rest.
float height_at(const test::PulledPlane& scene, const Points& rest, std::vector<float>& area) {
  const ScaleField field = compute_scale_field(rest, scene.regions, Blend::kQuartic);
  area.resize(rest.size());
  for (std::size_t i = 0; i < rest.size(); ++i)
    area[i] = std::sqrt(1.0F + std::pow(static_cast<float>(test::PulledPlane::kHeight), 2.0F) *
                                   field.gradient[i].squaredNorm());
  return 0.0F;
}

// Samples of the part that moves and is not rigid.
Points stretched_part(const test::PulledPlane& scene, const ResampledEdit& edit) {
  const Points& p = edit.surface.levels[0].position;
  Points rest(p.size());
  for (std::size_t i = 0; i < p.size(); ++i) rest.set(i, {p[i].x(), p[i].y(), 0.0F});
  const ScaleField field = compute_scale_field(rest, scene.regions, Blend::kQuartic);
  std::vector<Vec3f> list;
  for (std::size_t i = 0; i < p.size(); ++i)
    if (field.t[i] > 0.0F && field.t[i] < 1.0F) list.push_back(p[i]);
  return test::from_list(list);
}

struct Holes {
  double p999 = 0.0;
  double most = 0.0;
};
// Radii of the largest empty discs on the true surface around points that are uniform on it.
Holes holes(const test::PulledPlane& scene, const ResampledEdit& edit, double unit) {
  test::Random random(3);
  Points rest(400'000);
  for (std::size_t i = 0; i < rest.size(); ++i)
    rest.set(i, Vec3d(random.uniform(), random.uniform(), 0.0).cast<float>());
  const ScaleField field = compute_scale_field(rest, scene.regions, Blend::kQuartic);
  std::vector<float> area;
  height_at(scene, rest, area);
  const float most = *std::max_element(area.begin(), area.end());
  std::vector<Vec3f> list;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (field.t[i] <= 0.0F || field.t[i] >= 1.0F) continue;
    if (random.uniform() * static_cast<double>(most) > static_cast<double>(area[i])) continue;
    list.push_back(rest[i] + Vec3f(0.0F, 0.0F, field.t[i] * static_cast<float>(test::PulledPlane::kHeight)));
  }
  const std::vector<double> gap = test::distances_to(test::from_list(list), edit.surface.levels[0].position);
  return {.p999 = gap[gap.size() * 999 / 1000] / unit, .most = gap.back() / unit};
}

TEST_CASE("a plane pulled up has the counts of Figure 7") {
  const char* sw = std::getenv("SW");
  for (const std::size_t side : {100UL}) {
    test::PulledPlane scene = test::pulled_plane(side);
    if (sw) scene.params.resampling->sweeps = (unsigned)atoi(sw);
    for (int repeat = 0; repeat < 1; ++repeat) {
      const auto begin = std::clock();
      const ResampledEdit edit = resampled(scene);
      const double ms = 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
      MESSAGE("side " << side << ": " << edit.sampling->size() << " samples in " << ms << " ms");
    }
    const ResampledEdit edit = resampled(scene);
    const double wanted = std::max(scene.spacing, test::PulledPlane::kMinSpacing / 1.5);
    const test::Spacing spacing = test::spacing_of(test::coherent(stretched_part(scene, edit)), wanted);
    const std::vector<double> all = test::nearest_distances(test::coherent(stretched_part(scene, edit)));
    const Holes disc = holes(scene, edit, wanted);
    MESSAGE("NN min " << spacing.least << " mean " << spacing.mean << " cv " << spacing.variation
                      << " max/mean " << all.back() / wanted / spacing.mean << " disc " << disc.p999 << " / "
                      << disc.most);
    double square = 0.0;
    double worst = 0.0;
    std::size_t off = 0;
    const std::size_t before = scene.sampling->size();
    const Points& p = edit.surface.levels[0].position;
    for (std::size_t i = before; i < edit.sampling->size(); ++i) {
      const auto& uv = edit.sampling->cloud->texcoord[i];
      const double error =
          std::hypot(static_cast<double>(uv[0] - p[i].x()), static_cast<double>(uv[1] - p[i].y()));
      square += error * error;
      worst = std::max(worst, error);
    }
    Points rest(p.size());
    for (std::size_t i = 0; i < p.size(); ++i) rest.set(i, {p[i].x(), p[i].y(), 0.0F});
    const ScaleField field = compute_scale_field(rest, scene.regions, Blend::kQuartic);
    for (std::size_t i = 0; i < p.size(); ++i)
      off += p[i].z() != field.t[i] * static_cast<float>(test::PulledPlane::kHeight);
    MESSAGE("uv rms " << std::sqrt(square / static_cast<double>(edit.inserted)) / scene.spacing << " max "
                      << worst / scene.spacing << " off surface " << off);
  }
}

}  // namespace
}  // namespace pointwright
