// Several edits one after the other: what one stretches counts for the next.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "tests/resampling/resampling_support.h"

namespace pointwright {
namespace {

constexpr double kSpacing = 0.02;

test::EditScene scene_of_plane(const RegionPair& regions, const EditParams& params) {
  const Level base = test::level_of(test::plane(80, kSpacing, test::Sampling::kJittered));
  return test::scene_with({.levels = {base}, .detail = {}}, test::to_cloud(base.position), regions, params);
}
Scaling along_x(double factor) {
  return Scaling{.factors = Vec3d(factor, 1.0, 1.0)};
}

// The plane at rest stretched along x, densely, but for its border.
Points stretched_plane(double factor) {
  test::Random random(4);
  Points points(200'000);
  for (std::size_t i = 0; i < points.size(); ++i)
    points.set(i,
               Vec3d(factor * random.uniform(-0.75, 0.75), random.uniform(-0.75, 0.75), 0.0).cast<float>());
  return points;
}

TEST_CASE("eight stretches below the bound do not thin the surface") {
  test::EditScene scene = scene_of_plane(test::everything(), test::resampling_by(along_x(1.3)));
  const std::size_t n = scene.sampling->size();
  const test::Holes at_rest =
      test::holes_of(stretched_plane(1.0), scene.surface.levels[0].position, kSpacing);
  double factor = 1.0;
  ResampledEdit edit;
  for (int step = 0; step < 8; ++step) {
    edit = test::resampled(scene);
    test::check_sound(edit);
    factor *= 1.3;
    const test::Holes holes =
        test::holes_of(stretched_plane(factor), edit.surface.levels[0].position, kSpacing);
    const double density = static_cast<double>(edit.sampling->size()) / (factor * static_cast<double>(n));
    MESSAGE("stretched " << factor << ": " << edit.sampling->size() << " samples, density " << density
                         << ", discs " << holes.p999 << " / " << holes.most << " (at rest " << at_rest.p999
                         << " / " << at_rest.most << ")");
    CHECK(density > 0.68);
    CHECK(density < 1.3);
    CHECK(holes.p999 < 1.05);
    CHECK(holes.most < 1.25);
    scene = test::scene_after(edit, scene.regions, scene.params);
  }
  // All cells are shorter than the bound, and longer than what a split leaves at least.
  const StretchColumns columns = stretch_columns(*edit.sampling);
  for (std::size_t i = 0; i < columns.major.size(); ++i) {
    REQUIRE(columns.major[i] < 1.5F + 1e-4F);
    REQUIRE(columns.major[i] > 0.75F - 1e-4F);
    REQUIRE(columns.minor[i] > 0.75F - 1e-4F);
  }
}

TEST_CASE("edits without resampling between two with it count") {
  EditParams still = test::resampling_by(Translation{});
  test::EditScene scene = scene_of_plane(test::everything(), still);
  const std::size_t n = scene.sampling->size();
  ResampledEdit edit = test::resampled(scene);
  CHECK(edit.inserted == 0);
  scene = test::scene_after(edit, scene.regions, test::resampling_by(along_x(1.3)));
  scene.params.resampling.reset();
  for (int step = 0; step < 3; ++step) {
    scene.sampling = carried_sampling(scene.sampling, scene.surface, scene.params, scene.field);
    CHECK(scene.sampling->size() == n);
    scene.surface =
        apply_edit(scene.surface, *scene.sampling->graph, scene.params, scene.field, Vec3d::Zero());
    scene.field = compute_scale_field(scene.surface.levels[0].position, scene.regions, Blend::kQuartic);
  }
  scene.params = still;
  edit = test::resampled(scene);
  test::check_sound(edit);
  CHECK(edit.inserted == n);  // 1.3^3 = 2.2: everybody in two
  const ResampledEdit at_once =
      test::resampled(scene_of_plane(test::everything(), test::resampling_by(along_x(1.3 * 1.3 * 1.3))));
  CHECK(at_once.inserted == edit.inserted);
}

TEST_CASE("a sampling that carries no cells is not touched by an edit without resampling") {
  EditParams params = test::resampling_by(along_x(1.3));
  params.resampling.reset();
  const test::EditScene scene = scene_of_plane(test::everything(), params);
  CHECK(carried_sampling(scene.sampling, scene.surface, params, scene.field) == scene.sampling);
}

// A disc around (x, 0) and a ring around it that moves; all of the other half of the plane stays.
RegionPair beside(const Points& position, float x) {
  return test::regions_on(position, std::vector<float>(position.size(), 0.3F * static_cast<float>(kSpacing)),
                          [x](const Vec3f& p) {
                            const float r = std::hypot(p.x() - x, p.y());
                            return p.x() * x < 0.0F || r > 0.35F ? 1 : r < 0.1F ? 2 : 0;
                          });
}

TEST_CASE("an edit elsewhere finds the samples as it would have found them alone") {
  const EditParams up = test::resampling_by(Translation{.vector = Vec3d(0.0, 0.0, 1.0)});
  const Level base = test::level_of(test::plane(80, kSpacing, test::Sampling::kJittered));
  const test::EditScene left = scene_of_plane(beside(base.position, -0.4F), up);
  const test::EditScene right = scene_of_plane(beside(base.position, 0.4F), up);
  const ResampledEdit alone = test::resampled(right);
  const ResampledEdit first = test::resampled(left);
  CHECK(alone.inserted > 1000);
  CHECK(first.inserted > 1000);
  const ResampledEdit second =
      test::resampled(test::scene_after(first, beside(first.surface.levels[0].position, 0.4F), up));
  test::check_sound(second);
  CHECK(second.inserted == alone.inserted);
  // Who has not moved has a cell as at rest.
  const StretchColumns columns = stretch_columns(*first.sampling);
  for (std::size_t i = 0; i < left.sampling->size(); ++i) {
    if (left.field.t[i] > 0.0F) continue;
    REQUIRE(std::abs(columns.major[i] - 1.0F) < 1e-5F);
    REQUIRE(std::abs(columns.minor[i] - 1.0F) < 1e-5F);
  }
}

}  // namespace
}  // namespace pointwright
