// Squeezed samples: kept while editing, collected when asked for (§5.3).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "tests/resampling/resampling_support.h"

namespace pointwright {
namespace {

constexpr double kUnit = 0.02;
constexpr double kCollect = 0.7;

Level jittered_plane() {
  return test::level_of(test::plane(100, kUnit, test::Sampling::kJittered));
}
float wave_at(const Vec3f& p) {
  return 0.001F * std::sin(40.0F * p.x()) * std::cos(30.0F * p.y());
}

// The middle of a plane scaled in its plane.
test::EditScene middle_scaled(const Vec3d& factors, double collect) {
  const Level base = jittered_plane();
  return test::scene_of(
      test::one_band(base, [&](std::size_t i) { return wave_at(base.position[i]); }),
      [](const Vec3f& p) { return p.norm() > 0.9F   ? 1
                                  : p.norm() < 0.5F ? 2
                                                    : 0; },
      test::resampling_by(Scaling{.factors = factors}, {.collect = collect}));
}
// The regions of samples that an earlier edit has moved: marks stay on samples.
RegionPair regions_of(const test::EditScene& scene, const ResampledEdit& edit) {
  const Points& p = edit.surface.levels[0].position;
  Marks marks(p.size(), 0);
  for (std::size_t i = 0; i < scene.sampling->size(); ++i)
    marks[i] = scene.field.t[i] == 1.0F ? 2 : scene.field.t[i] == 0.0F ? 1 : 0;
  auto regions = regions_from_marks(p, std::vector<float>(p.size(), static_cast<float>(0.2 * kUnit)), marks,
                                    Vec3d::Zero());
  REQUIRE(regions.ok());
  return std::move(regions).value();
}

std::vector<std::uint32_t> numbers_by_id(const Cloud& cloud) {
  std::vector<std::uint32_t> number;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.id[i] >= number.size()) number.resize(cloud.id[i] + 1, kNoParent);
    number[cloud.id[i]] = static_cast<std::uint32_t>(i);
  }
  return number;
}

// That `left` is `all` without some samples: bits, order and rows of the others.
void check_survivors(const ResampledEdit& all, const ResampledEdit& left) {
  test::check_sound(left);
  REQUIRE(left.sampling->size() + left.removed == all.sampling->size());
  const std::vector<std::uint32_t> number = numbers_by_id(*all.sampling->cloud);
  std::size_t changed = 0;
  std::uint32_t last = 0;
  for (std::size_t m = 0; m < left.sampling->size(); ++m) {
    const std::uint32_t i = number[left.sampling->cloud->id[m]];
    REQUIRE(i != kNoParent);
    changed += m > 0 && i <= last ? 1U : 0U;
    last = i;
    for (std::size_t k = 0; k < all.surface.levels.size(); ++k) {
      changed += left.surface.levels[k].position[m] == all.surface.levels[k].position[i] ? 0U : 1U;
      changed += left.surface.levels[k].normal[m] == all.surface.levels[k].normal[i] ? 0U : 1U;
    }
    for (std::size_t k = 0; k < all.surface.detail.size(); ++k)
      changed += left.surface.detail[k][m] == all.surface.detail[k][i] ? 0U : 1U;
    changed += left.sampling->spacing[m] == all.sampling->spacing[i] ? 0U : 1U;
  }
  CHECK(changed == 0);
}

TEST_CASE("a squeeze and its inverse lose no sample and no detail") {
  const test::EditScene scene = middle_scaled(Vec3d(0.3, 0.3, 1.0), 0.0);
  const ResampledEdit squeezed = test::resampled(scene);
  test::check_sound(squeezed);
  CHECK(squeezed.removed == 0);
  CHECK(squeezed.sampling->size() == scene.sampling->size() + squeezed.inserted);
  const test::EditScene back =
      test::scene_after(squeezed, regions_of(scene, squeezed),
                        test::resampling_by(Scaling{.factors = Vec3d(1.0 / 0.3, 1.0 / 0.3, 1.0)}));
  const ResampledEdit restored = test::resampled(back);
  test::check_sound(restored);
  CHECK(restored.removed == 0);
  double farthest = 0.0;
  std::size_t compared = 0;
  std::size_t changed = 0;
  for (std::size_t i = 0; i < scene.sampling->size(); ++i) {
    changed += restored.surface.detail[0][i] == scene.surface.detail[0][i] ? 0U : 1U;
    changed += restored.sampling->cloud->id[i] == scene.sampling->cloud->id[i] ? 0U : 1U;
    if (scene.field.t[i] != 1.0F) continue;
    ++compared;
    const Vec3f away = restored.surface.levels[1].position[i] - scene.surface.levels[1].position[i];
    farthest = std::max(farthest, static_cast<double>(away.norm()));
  }
  CHECK(compared > 1000);
  CHECK(changed == 0);
  MESSAGE("back to within " << farthest);
  CHECK(farthest < 1e-6);
}

TEST_CASE("collection restores the density of a squeezed surface") {
  const test::EditScene scene = middle_scaled(Vec3d(0.3, 0.3, 1.0), 0.0);
  test::EditScene collecting = scene;
  collecting.params.resampling->collect = kCollect;
  const ResampledEdit all = test::resampled(scene);
  const ResampledEdit left = test::resampled(collecting);
  check_survivors(all, left);

  // Nothing that t = 0 holds has gone.
  const std::set<std::uint32_t> ids(left.sampling->cloud->id.begin(), left.sampling->cloud->id.end());
  for (std::size_t i = 0; i < scene.sampling->size(); ++i)
    if (scene.field.t[i] == 0.0F) REQUIRE(ids.count(scene.sampling->cloud->id[i]) == 1);

  std::size_t whole = 0;
  for (std::size_t i = 0; i < scene.sampling->size(); ++i) whole += scene.field.t[i] == 1.0F ? 1U : 0U;
  const auto inside = [](const ResampledEdit& edit) {
    std::vector<std::uint8_t> keep;
    for (std::size_t i = 0; i < edit.sampling->size(); ++i)
      keep.push_back(edit.surface.levels[0].position[i].norm() < 0.15F ? 1 : 0);
    return test::selected(edit.surface.levels[0].position, keep);
  };
  const test::Spacing dense = test::spacing_of(inside(all), kUnit);
  const Points kept = inside(left);
  const test::Spacing spacing = test::spacing_of(kept, kUnit);
  const double asked = 0.09 * static_cast<double>(whole);
  MESSAGE(all.sampling->size() << " -> " << left.sampling->size() << "; scaled part: " << whole << " -> "
                               << kept.size() << " where its area asks for " << asked << "; nearest: mean "
                               << dense.mean << " -> " << spacing.mean << ", min " << spacing.least << ", cv "
                               << spacing.variation);
  CHECK(dense.mean < 0.3);
  CHECK(spacing.mean > 0.75);
  CHECK(spacing.mean < 1.0);
  CHECK(static_cast<double>(kept.size()) > 0.9 * asked);
  CHECK(static_cast<double>(kept.size()) < 1.1 * asked);
  Level fine = test::level_of(test::plane(600, kUnit / 6.0, test::Sampling::kRandom));
  const test::Holes holes =
      test::holes_of(test::evenly_on_deformed(scene, fine), left.surface.levels[0].position, kUnit);
  MESSAGE("discs " << holes.p999 << " / " << holes.most);
  CHECK(holes.p999 < 0.98);
  CHECK(holes.most < 1.2);

  // An edit that moves nothing collects the same.
  test::EditScene later = test::scene_after(all, regions_of(scene, all),
                                            test::resampling_by(Translation{}, {.collect = kCollect}));
  const ResampledEdit collected = test::resampled(later);
  later.params.resampling->collect = 0.0;
  check_survivors(test::resampled(later), collected);
  later.params.resampling->collect = kCollect;
  MESSAGE("by an edit that moves nothing: " << collected.sampling->size());
  CHECK(std::abs(static_cast<double>(collected.removed) - static_cast<double>(left.removed)) <
        0.03 * static_cast<double>(left.removed));
  // And doing so again finds next to nothing.
  test::EditScene again = test::scene_after(collected, regions_of(scene, all), later.params);
  again.field = compute_scale_field(collected.surface.levels[0].position, again.regions, Blend::kQuartic);
  const ResampledEdit twice = test::resampled(again);
  CHECK(twice.removed < collected.removed / 100 + 1);
}

TEST_CASE("noise of the input is not collected where nothing is squeezed") {
  for (const double factor : {1.0, 0.95}) {
    const test::EditScene scene = middle_scaled(Vec3d(factor, factor, 1.0), 0.9);
    CHECK(test::resampled(scene).removed == 0);
  }
}

TEST_CASE("stretched by four and back: inserted samples go, originals stay") {
  const Level base = jittered_plane();
  const MultiresSurface surface{.levels = {base}, .detail = {}};
  const test::EditScene scene =
      test::scene_with(surface, test::to_cloud(base.position), test::everything(),
                       test::resampling_by(Scaling{.factors = Vec3d(4.0, 4.0, 1.0)}));
  const std::size_t n = scene.sampling->size();
  const ResampledEdit wide = test::resampled(scene);
  test::check_sound(wide);
  CHECK(test::relative_error(static_cast<double>(wide.sampling->size()), 16.0 * static_cast<double>(n)) <
        0.06);
  test::EditScene back = test::scene_after(
      wide, scene.regions,
      test::resampling_by(Scaling{.factors = Vec3d(0.25, 0.25, 1.0)}, {.collect = kCollect}));
  const ResampledEdit restored = test::resampled(back);
  back.params.resampling->collect = 0.0;
  check_survivors(test::resampled(back), restored);
  std::size_t originals = 0;
  for (const std::uint32_t parent : restored.sampling->parent) originals += parent == kNoParent ? 1U : 0U;
  const test::Spacing spacing = test::spacing_of(test::coherent(restored.surface.levels[0].position), kUnit);
  MESSAGE(n << " -> " << wide.sampling->size() << " -> " << restored.sampling->size() << ", " << originals
            << " of them originals; nearest mean " << spacing.mean << ", min " << spacing.least);
  CHECK(test::relative_error(static_cast<double>(restored.sampling->size()), static_cast<double>(n)) < 0.05);
  CHECK(static_cast<double>(originals) > 0.87 * static_cast<double>(n));
}

TEST_CASE("a surface crushed to almost nothing still has sound neighbourhoods") {
  for (const double factor : {0.05, 0.001}) {
    const Level base = test::level_of(test::plane(60, kUnit, test::Sampling::kJittered));
    const test::EditScene scene =
        test::scene_with({.levels = {base}, .detail = {}}, test::to_cloud(base.position), test::everything(),
                         test::resampling_by(Scaling{.factors = Vec3d::Constant(factor)}, {.collect = 0.9}));
    const ResampledEdit edit = test::resampled(scene);
    test::check_sound(edit);
    CHECK(edit.sampling->size() >= 1);
    MESSAGE("scaled by " << factor << ": " << edit.sampling->size() << " left of " << scene.sampling->size());
    const Points& p = edit.surface.levels[0].position;
    const NeighborGraph exact = build_neighbor_graph(test::coherent(p), 10);
    CHECK(edit.sampling->graph->k == exact.k);
  }
}

}  // namespace
}  // namespace pointwright
