// Input that is legal and awkward: results are finite, with unit normals.
#include <doctest/doctest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "tests/resampling/resampling_support.h"

namespace pointwright {
namespace {

Level level_from(const Points& position) {
  Level level{.position = position, .normal = Points(position.size())};
  for (std::size_t i = 0; i < position.size(); ++i) level.normal.set(i, Vec3f::UnitZ());
  return level;
}
RegionPair left_and_right(float gap) {
  return {.zero = test::ball({-1e4F - gap, 0.0F, 0.0F}, 1e4F),
          .one = test::ball({1e4F + gap, 0.0F, 0.0F}, 1e4F)};
}

std::vector<Deformation> awkward_deformations() {
  return {Translation{},
          Translation{.vector = Vec3d(0.0, 0.0, 10.0)},
          Translation{.vector = Vec3d(-3.0, 0.0, 0.0)},
          Scaling{.factors = Vec3d(5.0, 0.001, 1.0)},
          Scaling{.factors = Vec3d::Constant(0.001)},
          Rotation{.axis = Vec3d::UnitX(), .angle_rad = 20.0},
          NormalOffset{.distance = 2.0},
          TowardPoint{.target = Vec3d(0.5, 0.5, 0.5), .amount = 1.0}};
}

// The edit, its preview, and the same again after it.
void check_all(const Level& level, const RegionPair& regions, const std::vector<Deformation>& deformations,
               const ResamplingParams& resampling = {.collect = 0.7}) {
  for (std::size_t d = 0; d < deformations.size(); ++d) {
    CAPTURE(d);
    CAPTURE(level.position.size());
    const MultiresSurface surface =
        test::one_band(level, [](std::size_t i) { return i % 2 == 0 ? 0.01F : 0.0F; });
    const test::EditScene scene = test::scene_with(surface, test::to_cloud(level.position), regions,
                                                   test::resampling_by(deformations[d], resampling));
    test::check_sound(test::resampled(scene, ResamplingEffort::kPreview));
    const ResampledEdit edit = test::resampled(scene);
    test::check_sound(edit);
    test::check_sound(test::resampled(test::scene_after(edit, regions, scene.params)));
  }
}

TEST_CASE("a handful of samples can be resampled") {
  for (std::size_t n = 0; n <= 12; ++n) {
    test::Random random(n);
    Points points(n);
    for (std::size_t i = 0; i < n; ++i)
      points.set(i, Vec3d(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), 0.0).cast<float>());
    const Level level = level_from(test::coherent(points));
    check_all(level, test::everything(), awkward_deformations());
    check_all(level, left_and_right(0.5F), awkward_deformations());
  }
}

TEST_CASE("samples at one place, on a line, and in pairs") {
  check_all(level_from(test::identical(40, {0.1F, 0.2F, 0.3F})), test::everything(), awkward_deformations());
  check_all(level_from(test::collinear(40, {-1.0F, 0.0F, 0.0F}, {1.0F, 0.0F, 0.0F})), left_and_right(0.5F),
            awkward_deformations());
  const test::Surface plane = test::plane(20, 0.1, test::Sampling::kJittered);
  const Level pairs = test::level_of(test::joined({plane, plane}));
  check_all(pairs, left_and_right(0.5F), awkward_deformations());
  check_all(pairs, test::everything(), awkward_deformations());
}

TEST_CASE("samples without a spacing or without neighbours do not split") {
  const Level level = level_from(test::identical(40, {0.1F, 0.2F, 0.3F}));
  const test::EditScene scene =
      test::scene_with({.levels = {level}, .detail = {}}, test::to_cloud(level.position), test::everything(),
                       test::resampling_by(Scaling{.factors = Vec3d::Constant(100.0)}));
  CHECK(scene.sampling->graph->k == 0);
  CHECK(test::resampled(scene).inserted == 0);
  const Level plane = test::level_of(test::plane(10, 0.1, test::Sampling::kJittered));
  test::EditScene none = test::scene_with({.levels = {plane}, .detail = {}}, test::to_cloud(plane.position),
                                          test::everything(), scene.params);
  pointwright::Sampling sampling = *none.sampling;
  std::fill(sampling.spacing.begin(), sampling.spacing.end(), 0.0F);
  none.sampling = std::make_shared<const pointwright::Sampling>(std::move(sampling));
  CHECK(test::resampled(none).inserted == 0);
}

TEST_CASE("regions that nearly touch stretch without limit, and samples split into at most 64") {
  const Level plane = test::level_of(test::plane(40, 0.05, test::Sampling::kJittered));
  for (const float gap : {0.02F, 1e-3F, 0.0F}) {
    check_all(plane, left_and_right(gap),
              {Translation{.vector = Vec3d(0.0, 0.0, 1e6)}, Translation{.vector = Vec3d(0.0, 0.0, 1e-3)},
               Rotation{.axis = Vec3d::UnitZ(), .angle_rad = 600.0}});
  }
  // Painted beside each other, without a gap.
  const test::EditScene scene = test::scene_of(
      {.levels = {plane}, .detail = {}}, [](const Vec3f& p) { return p.x() < 0.0F ? 1 : 2; },
      test::resampling_by(Translation{.vector = Vec3d(0.0, 0.0, 5.0)}));
  test::check_sound(test::resampled(scene));
}

TEST_CASE("folds and enormous stretches stay finite") {
  const Level plane = test::level_of(test::plane(40, 0.05, test::Sampling::kJittered));
  const test::EditScene scene = test::scene_of(
      {.levels = {plane}, .detail = {}},
      [](const Vec3f& p) { return p.norm() > 0.9F   ? 1
                                  : p.norm() < 0.2F ? 2
                                                    : 0; },
      test::resampling_by(Translation{.vector = Vec3d(0.9, 0.0, 0.0)}, {.collect = 0.7}));
  const ResampledEdit folded = test::resampled(scene);
  test::check_sound(folded);
  CHECK(folded.inserted > 0);
  CHECK(folded.removed > 0);
  test::EditScene far = scene;
  for (const double length : {1e6, 1e9}) {
    far.params = test::resampling_by(Translation{.vector = Vec3d(0.0, 0.0, length)});
    const ResampledEdit edit = test::resampled(far);
    test::check_sound(edit);
    CHECK(edit.sampling->size() <= 64 * scene.sampling->size());
  }
  // Scaled again and again, far beyond what squares of floats can hold.
  const std::vector<ElementaryDeformation> growth(8, Scaling{.factors = Vec3d::Constant(1000.0)});
  const test::EditScene grown =
      test::scene_with({.levels = {plane}, .detail = {}}, test::to_cloud(plane.position), test::everything(),
                       test::resampling_by(Deformation(growth)));
  const ResampledEdit enormous = test::resampled(grown);
  test::check_sound(enormous);
  CHECK(enormous.inserted == 63 * grown.sampling->size());
  const StretchColumns columns = stretch_columns(*enormous.sampling);
  for (std::size_t i = 0; i < columns.major.size(); ++i) {
    REQUIRE(std::isfinite(columns.major[i]));
    REQUIRE(std::isfinite(columns.minor[i]));
    REQUIRE(std::isfinite(columns.anisotropy[i]));
  }
}

TEST_CASE("nothing of a tangled model is lost: any order of edits stays sound") {
  test::Random random(11);
  const Level sphere = test::level_of(test::sphere(800, 1.0, test::Sampling::kRandom));
  test::EditScene scene = test::scene_of(
      {.levels = {sphere}, .detail = {}},
      [](const Vec3f& p) { return p.z() < -0.2F  ? 1
                                  : p.z() > 0.5F ? 2
                                                 : 0; },
      test::resampling_by(Translation{}));
  const RegionPair regions = scene.regions;
  for (int step = 0; step < 12; ++step) {
    const std::vector<Deformation> all = {
        Translation{.vector = random.uniform(0.1, 0.8) * random.direction()},
        Rotation{.axis = random.direction(), .angle_rad = random.uniform(-2.0, 2.0)},
        Scaling{.factors =
                    Vec3d(random.uniform(0.5, 1.8), random.uniform(0.5, 1.8), random.uniform(0.5, 1.8))},
        NormalOffset{.distance = random.uniform(-0.2, 0.3)}};
    EditParams params = test::resampling_by(
        all[random.below(all.size())],
        {.max_samples = 200'000, .shear_aware = step % 2 == 0, .collect = step % 3 == 0 ? 0.7 : 0.0});
    const ResampledEdit edit = test::resampled(
        test::scene_after({.surface = scene.surface, .sampling = scene.sampling}, regions, params));
    test::check_sound(edit);
    scene.surface = edit.surface;
    scene.sampling = edit.sampling;
  }
  CHECK(scene.sampling->size() > 100);
}

TEST_CASE(
    "the direction of the larger stretch is that of the cells' longest diameter, whatever their sides") {
  const Vec3f along = Vec3f(2.0F, -1.0F, 2.0F) / 3.0F;
  const Vec3f across = Vec3f(1.0F, 2.0F, 0.0F) / std::sqrt(5.0F);
  constexpr std::size_t kTurns = 16;
  Sampling sampling;
  sampling.spacing.assign(kTurns + 2, 1.0F);
  CHECK(stretch_directions(sampling)[0] == Vec3f::Zero());  // no cells: unit squares
  sampling.cell_u = Points(kTurns + 2);
  sampling.cell_v = Points(kTurns + 2);
  // The sides of one and the same stretched square, however it was turned before: J u, J v.
  for (std::size_t i = 0; i < kTurns; ++i) {
    const float angle = 0.4F * static_cast<float>(i);
    const float c = std::cos(angle);
    const float s = std::sin(angle);
    sampling.cell_u.set(i, 3.0F * c * along + 0.5F * s * across);
    sampling.cell_v.set(i, -3.0F * s * along + 0.5F * c * across);
  }
  // Round but for less than a thousandth; collapsed.
  sampling.cell_u.set(kTurns, 2.0F * along);
  sampling.cell_v.set(kTurns, 1.9995F * across);
  sampling.cell_u.set(kTurns + 1, Vec3f::Zero());
  sampling.cell_v.set(kTurns + 1, Vec3f::Zero());
  const Points directions = stretch_directions(sampling);
  for (std::size_t i = 0; i < kTurns; ++i) CHECK((directions[i] - along).norm() < 1e-5F);
  CHECK(directions[kTurns] == Vec3f::Zero());
  CHECK(directions[kTurns + 1] == Vec3f::Zero());
}

}  // namespace
}  // namespace pointwright
