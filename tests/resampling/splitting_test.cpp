// Stretch of cells, and what it makes samples split into.
#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "tests/resampling/resampling_support.h"
#include "tests/support/pulled_plane.h"

namespace pointwright {
namespace {

TEST_CASE("principal stretches are the roots of the eigenvalues of the first fundamental form") {
  test::Random random(9);
  for (int round = 0; round < 500; ++round) {
    const double scale = std::pow(10.0, random.uniform(-6.0, 6.0));
    const Vec3f u = (scale * random.uniform(0.1, 2.0) * random.direction()).cast<float>();
    const Vec3f v = (scale * random.uniform(0.1, 2.0) * random.direction()).cast<float>();
    Eigen::Matrix2d form;
    const Vec3d a = u.cast<double>();
    const Vec3d b = v.cast<double>();
    form << a.dot(a), a.dot(b), a.dot(b), b.dot(b);
    const Eigen::Vector2d values = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(form).eigenvalues();
    const PrincipalStretch stretch = principal_stretch(u, v);
    REQUIRE(static_cast<double>(stretch.major) == doctest::Approx(std::sqrt(values[1])).epsilon(1e-5));
    REQUIRE(static_cast<double>(stretch.minor) ==
            doctest::Approx(a.cross(b).norm() / std::sqrt(values[1])).epsilon(1e-5));
    const Vec3f major = stretch.cosine * u + stretch.sine * v;
    const Vec3f minor = stretch.cosine * v - stretch.sine * u;
    REQUIRE(static_cast<double>(major.norm()) ==
            doctest::Approx(static_cast<double>(stretch.major)).epsilon(1e-5));
    REQUIRE(std::abs(static_cast<double>(major.dot(minor))) < 3e-6 * form.trace());
  }
}

TEST_CASE("principal stretches of cells that are none, and of enormous ones, are finite") {
  const Vec3f zero = Vec3f::Zero();
  const PrincipalStretch none = principal_stretch(zero, zero);
  CHECK(none.major == 0.0F);
  CHECK(none.minor == 0.0F);
  const PrincipalStretch flat = principal_stretch({1.0F, 0.0F, 0.0F}, zero);
  CHECK(flat.major == 1.0F);
  CHECK(flat.minor == 0.0F);
  for (const float size : {1e25F, 1e-25F}) {
    CAPTURE(size);
    const PrincipalStretch huge = principal_stretch({2.0F * size, 0.0F, 0.0F}, {0.0F, size, 0.0F});
    CHECK(huge.major == doctest::Approx(static_cast<double>(2.0F * size)));
    CHECK(huge.minor == doctest::Approx(static_cast<double>(size)));
    CHECK(huge.cosine == doctest::Approx(1.0));
  }
}

// Everything is stretched along two axes: t = 1.
test::EditScene stretched_plane(double x, double y, const ResamplingParams& resampling) {
  const Level base = test::level_of(test::plane(20, 0.1, test::Sampling::kRegular));
  test::EditScene scene =
      test::scene_with({.levels = {base}, .detail = {}}, test::to_cloud(base.position),
                       {.zero = Region(test::from_list({{1e6F, 0.0F, 0.0F}}), {1.0F}),
                        .one = Region(test::from_list({Vec3f::Zero()}), {1e5F})},
                       test::resampling_by(Scaling{.factors = Vec3d(x, y, 1.0)}, resampling));
  // Estimates are wider at the border.
  pointwright::Sampling sampling = *scene.sampling;
  std::fill(sampling.spacing.begin(), sampling.spacing.end(), 0.1F);
  scene.sampling = std::make_shared<const pointwright::Sampling>(std::move(sampling));
  return scene;
}

TEST_CASE("a direction splits from the bound on, into as many parts as come nearest to the spacing") {
  const std::size_t n = 400;
  const auto parts = [&](double x, double y, const ResamplingParams& resampling) {
    const ResampledEdit edit = test::resampled(stretched_plane(x, y, resampling));
    test::check_sound(edit);
    return static_cast<double>(edit.sampling->size()) / static_cast<double>(n);
  };
  CHECK(parts(1.49, 1.0, {}) == 1.0);
  CHECK(parts(1.51, 1.0, {}) == 2.0);
  CHECK(parts(2.6, 1.0, {}) == 3.0);
  CHECK(parts(1.0, 2.6, {}) == 3.0);
  CHECK(parts(3.0, 3.0, {}) == 9.0);
  CHECK(parts(4.2, 1.6, {}) == 8.0);
  CHECK(parts(0.2, 0.2, {}) == 1.0);
  // Another bound: from there on, and as much finer or wider.
  CHECK(parts(1.04, 1.0, {.bound = 1.05}) == 1.0);
  CHECK(parts(1.06, 1.0, {.bound = 1.05}) == 2.0);
  CHECK(parts(2.99, 1.0, {.bound = 3.0}) == 1.0);
  CHECK(parts(3.01, 1.0, {.bound = 3.0}) == 2.0);
  CHECK(parts(15.9, 1.0, {.bound = 16.0}) == 1.0);
  // A floor in model units.
  CHECK(parts(4.0, 4.0, {.min_spacing = 1.0}) == 1.0);
  CHECK(parts(4.0, 1.0, {.min_spacing = 0.3}) == 2.0);
  // At most so many of one, whatever the stretch.
  CHECK(parts(900.0, 1.0, {}) == 64.0);
  CHECK(parts(1000.0, 1000.0, {}) == 64.0);
}

TEST_CASE("max_samples is refused before anything is made") {
  const auto run = [](std::uint32_t most, ResamplingEffort effort) {
    const test::EditScene scene = stretched_plane(3.0, 3.0, {.max_samples = most});
    return apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field, scene.regions,
                                effort);
  };
  for (const ResamplingEffort effort : {ResamplingEffort::kExact, ResamplingEffort::kPreview}) {
    const auto refused = run(3'599, effort);
    REQUIRE(!refused.ok());
    CHECK(refused.error().code == ErrorCode::kTooLarge);
    CHECK(refused.error().field == "resampling.max_samples");
    CHECK(refused.error().limit == 3'599.0);
    CHECK(refused.error().actual == 3'600.0);
    CHECK(run(3'600, effort).ok());
    CHECK(run(0, effort).ok());
  }
  // Fewer than there are already: no error as long as none is added.
  const test::EditScene still = stretched_plane(1.0, 1.0, {.max_samples = 1});
  CHECK(test::resampled(still).sampling->size() == 400);
}

TEST_CASE("no more samples than there are ids") {
  test::EditScene scene = stretched_plane(3.0, 3.0, {});
  pointwright::Sampling sampling = *scene.sampling;
  sampling.next_id = std::numeric_limits<std::uint32_t>::max() - 100;
  scene.sampling = std::make_shared<const pointwright::Sampling>(sampling);
  const auto refused = apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field,
                                            scene.regions, ResamplingEffort::kExact);
  REQUIRE(!refused.ok());
  CHECK(refused.error().code == ErrorCode::kTooLarge);
  CHECK(refused.error().limit == 500.0);
}

TEST_CASE("every parameter of resampling is checked") {
  const auto error_of = [](const ResamplingParams& params) {
    const auto result = validate(params);
    REQUIRE(!result.ok());
    return result.error();
  };
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  CHECK(validate(ResamplingParams{}).ok());
  for (const double bound : {1.05, 16.0}) CHECK(validate(ResamplingParams{.bound = bound}).ok());
  for (const double collect : {0.0, 0.9}) CHECK(validate(ResamplingParams{.collect = collect}).ok());
  for (const std::uint32_t sweeps : {0U, 64U}) CHECK(validate(ResamplingParams{.sweeps = sweeps}).ok());
  CHECK(validate(ResamplingParams{.min_spacing = 1e9}).ok());
  struct Wrong {
    ResamplingParams params;
    const char* field;
    ErrorCode code;
    std::optional<double> limit;
  };
  const ErrorCode range = ErrorCode::kInvalidArgument;
  const ErrorCode finite = ErrorCode::kNonFinite;
  const std::vector<Wrong> all = {
      {{.bound = 1.0}, "resampling.bound", range, 1.05},
      {{.bound = 17.0}, "resampling.bound", range, 16.0},
      {{.bound = kNothing}, "resampling.bound", finite, std::nullopt},
      {{.min_spacing = -1e-9}, "resampling.min_spacing", range, 0.0},
      {{.min_spacing = 2e9}, "resampling.min_spacing", range, 1e9},
      {{.min_spacing = kEndless}, "resampling.min_spacing", finite, std::nullopt},
      {{.sweeps = 65}, "resampling.sweeps", range, 64.0},
      {{.collect = -0.1}, "resampling.collect", range, 0.0},
      {{.collect = 0.91}, "resampling.collect", range, 0.9},
      {{.collect = kNothing}, "resampling.collect", finite, std::nullopt},
  };
  for (const Wrong& wrong : all) {
    const Error error = error_of(wrong.params);
    CAPTURE(error.message);
    CHECK(error.field == wrong.field);
    CHECK(error.code == wrong.code);
    CHECK(error.limit == wrong.limit);
  }
}

// A full turn of the middle of Figure 7's plane within it: areas stay.
test::PulledPlane turned_plane(bool shear_aware) {
  test::PulledPlane scene = test::pulled_plane(100);
  scene.params = test::resampling_by(
      Rotation{.point = Vec3d(0.5, 0.5, 0.0), .axis = Vec3d::UnitZ(), .angle_rad = 2.0 * std::numbers::pi},
      {.shear_aware = shear_aware});
  return scene;
}

TEST_CASE("a turn within the plane splits far less where shear is taken into account") {
  Level dense{.position = Points(400'000), .normal = Points(400'000)};
  test::Random random(3);
  for (std::size_t i = 0; i < dense.position.size(); ++i) {
    dense.position.set(i, Vec3d(random.uniform(), random.uniform(), 0.0).cast<float>());
    dense.normal.set(i, Vec3f::UnitZ());
  }
  std::vector<double> size;
  for (const bool aware : {false, true}) {
    const test::PulledPlane scene = turned_plane(aware);
    const ResampledEdit edit = test::resampled(scene);
    test::check_sound(edit);
    const test::Holes holes = test::holes_of(test::evenly_on_deformed(scene, dense),
                                             edit.surface.levels[0].position, scene.spacing);
    MESSAGE(edit.sampling->size() << " samples, discs " << holes.p999 << " / " << holes.most);
    size.push_back(static_cast<double>(edit.sampling->size()));
    CHECK(holes.p999 < (aware ? 1.0 : 0.9));
    CHECK(holes.most < 1.3);
  }
  CHECK(size[0] / size[1] > 2.5);
  CHECK(size[0] / size[1] < 3.0);
}

}  // namespace
}  // namespace pointwright
