#include "engine/editing/scale_field.h"

#include <doctest/doctest.h>

#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

RegionPair plane_regions(const Level& plane, float border, float spacing) {
  return regions_from_marks(plane.position, std::vector<float>(plane.position.size(), spacing),
                            test::marks_beside(plane.position, border), Vec3d::Zero())
      .value();
}

TEST_CASE("the quartic blend has the paper's values and slopes") {
  CHECK(blend_value(Blend::kQuartic, 0.0F) == 1.0F);
  CHECK(blend_value(Blend::kQuartic, 1.0F) == 0.0F);
  CHECK(blend_value(Blend::kQuartic, 0.5F) == doctest::Approx(0.5625));
  CHECK(blend_slope(Blend::kQuartic, 0.0F) == 0.0F);
  CHECK(blend_slope(Blend::kQuartic, 1.0F) == 0.0F);
  CHECK(blend_slope(Blend::kQuartic, 0.5F) == doctest::Approx(-1.5));
}

TEST_CASE("every blend falls from 1 to 0 with flat ends, and the kernels compute it with its slope") {
  // Along x between two balls, t is the blend of the distance to the one-region.
  const std::size_t n = 1001;
  Points line(n);
  for (std::size_t i = 0; i < n; ++i)
    line.set(i, {static_cast<float>(i) / static_cast<float>(n - 1), 0.0F, 0.0F});
  const RegionPair regions{.zero = Region(test::points_of({{0, 0, 0}}), {0.0F}),
                           .one = Region(test::points_of({{1, 0, 0}}), {0.0F})};
  for (const Blend blend : {Blend::kQuartic, Blend::kCubic, Blend::kQuintic, Blend::kCosine}) {
    CAPTURE(static_cast<int>(blend));
    CHECK(blend_value(blend, 0.0F) == 1.0F);
    CHECK(std::abs(blend_value(blend, 1.0F)) < 1e-6F);
    CHECK(std::abs(blend_slope(blend, 0.0F)) < 1e-6F);
    CHECK(std::abs(blend_slope(blend, 1.0F)) < 1e-6F);
    const ScaleField field = compute_scale_field(line, regions, blend);
    double worst = 0.0;
    double worst_slope = 0.0;
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const float x = 1.0F - line[i].x();
      worst = std::max(worst, static_cast<double>(std::abs(field.t[i] - blend_value(blend, x))));
      // t grows along x as beta falls with the distance to the one-region.
      worst_slope =
          std::max(worst_slope, static_cast<double>(std::abs(field.gradient[i].x() + blend_slope(blend, x))));
      const double numeric = (static_cast<double>(blend_value(blend, x + 1e-3F)) -
                              static_cast<double>(blend_value(blend, x - 1e-3F))) /
                             2e-3;
      CHECK(std::abs(numeric - static_cast<double>(blend_slope(blend, x))) < 2e-3);
      CHECK(field.t[i] >= field.t[i - 1]);
    }
    CHECK(worst < 2e-6);
    CHECK(worst_slope < 2e-5);
  }
}

TEST_CASE("t is 0 on every zero-sample, 1 on every one-sample, and grows monotonously between") {
  const Level plane = test::plane_level(101);
  const Marks marks = test::marks_beside(plane.position, 0.3F);
  const ScaleField field =
      compute_scale_field(plane.position, plane_regions(plane, 0.3F, 0.02F), Blend::kQuartic);
  std::size_t wrong = 0;
  std::size_t falling = 0;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (marks[i] == 1) wrong += field.t[i] != 0.0F || field.gradient[i] != Vec3f::Zero();
    if (marks[i] == 2) wrong += field.t[i] != 1.0F || field.gradient[i] != Vec3f::Zero();
    if (i % 101 == 0) continue;
    // On a row t must not fall, and must rise where both samples are free.
    falling += field.t[i] < field.t[i - 1];
    if (marks[i] == 0 && marks[i - 1] == 0) falling += field.t[i] <= field.t[i - 1];
  }
  CHECK(wrong == 0);
  CHECK(falling == 0);
}

TEST_CASE("t agrees with Eq. (11) and (12) in double precision") {
  const Level plane = test::plane_level(41);
  const RegionPair regions = plane_regions(plane, 0.3F, 0.05F);
  const Points queries = test::random_points(500, 41, 1.3F);
  const ScaleField field = compute_scale_field(queries, regions, Blend::kQuartic);
  double worst = 0.0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    worst = std::max(worst, std::abs(test::reference_t(regions, queries[i].cast<double>()) - field.t[i]));
  }
  CHECK(worst < 2e-6);
}

TEST_CASE("t is continuous: across a fine walk it never jumps") {
  const Level plane = test::plane_level(41);
  const RegionPair regions = plane_regions(plane, 0.3F, 0.05F);
  const std::size_t steps = 20'000;
  Points walk(steps);
  for (std::size_t i = 0; i < steps; ++i) {
    const float s = -1.0F + 2.0F * static_cast<float>(i) / static_cast<float>(steps);
    walk.set(i, {s, 0.31F * s, 0.1F * std::sin(9.0F * s)});
  }
  const ScaleField field = compute_scale_field(walk, regions, Blend::kQuartic);
  float largest_jump = 0.0F;
  for (std::size_t i = 1; i < steps; ++i)
    largest_jump = std::max(largest_jump, std::abs(field.t[i] - field.t[i - 1]));
  CHECK(largest_jump < 1e-3F);  // steps of 1e-4, the gap between the regions is 0.5
  CHECK(field.t.front() == 0.0F);
  CHECK(field.t[steps - 1] == 1.0F);
}

TEST_CASE("the gradient is that of finite differences away from the medial lines") {
  const Level plane = test::plane_level(41);
  const RegionPair regions = plane_regions(plane, 0.3F, 0.05F);
  const Points queries = test::random_points(400, 43, 0.9F);
  const ScaleField field = compute_scale_field(queries, regions, Blend::kQuartic);
  std::size_t compared = 0;
  double worst = 0.0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Vec3d p = queries[i].cast<double>();
    const auto difference = [&](double h) {
      Vec3d g;
      for (int c = 0; c < 3; ++c) {
        const Vec3d step = h * Vec3d::Unit(c);
        g[c] = (test::reference_t(regions, p + step) - test::reference_t(regions, p - step)) / (2.0 * h);
      }
      return g;
    };
    const Vec3d wide = difference(1e-4);
    const Vec3d narrow = difference(1e-5);
    if ((wide - narrow).norm() > 1e-3 * (1.0 + narrow.norm())) continue;  // the nearest ball changes here
    ++compared;
    worst = std::max(worst, (narrow - field.gradient[i].cast<double>()).norm() / (1.0 + narrow.norm()));
  }
  CHECK(compared > 300);
  CHECK(worst < 1e-3);
}

TEST_CASE("the field of N samples is that of the first N of more, and its padding is 0") {
  const Level plane = test::plane_level(21);
  const RegionPair regions = plane_regions(plane, 0.3F, 0.05F);
  const Points many = test::random_points(64, 47);
  const ScaleField all = compute_scale_field(many, regions, Blend::kQuartic);
  for (const std::size_t n : {0, 1, 15, 16, 17}) {
    Points some = many;
    some.resize(n);
    const ScaleField field = compute_scale_field(some, regions, Blend::kQuartic);
    REQUIRE(field.size() == n);
    REQUIRE(field.t.size() == padded_to_block(n));
    CHECK(test::same_bytes(field.t.data(), all.t.data(), n));
    for (std::size_t i = 0; i < n; ++i) CHECK(test::same_sample(field.gradient, all.gradient, i));
    for (std::size_t i = n; i < field.t.size(); ++i) CHECK(field.t[i] == 0.0F);
  }
}

TEST_CASE("the same bytes for any thread count and instruction set") {
  const Level plane = test::plane_level(41);
  const RegionPair regions = plane_regions(plane, 0.3F, 0.05F);
  const Points queries = test::random_points(9001, 53);
  test::for_all_machines([&] { return compute_scale_field(queries, regions, Blend::kQuartic); },
                         [](const ScaleField& a, const ScaleField& b) { CHECK(test::same_bytes(a, b)); });
}

TEST_CASE("far, tiny and overlapping regions give finite fields within [0, 1]") {
  const auto ball = [](const Vec3f& center, float radius) {
    return Region(test::points_of({center}), std::vector<float>{radius});
  };
  const std::vector<RegionPair> pairs = {{.zero = ball({1e9F, 0, 0}, 1.0F), .one = ball({-1e9F, 0, 0}, 1.0F)},
                                         {.zero = ball({0, 0, 0}, 0.0F), .one = ball({1e-20F, 0, 0}, 0.0F)},
                                         {.zero = ball({0, 0, 0}, 1e-30F), .one = ball({0, 1e9F, 0}, 1e8F)},
                                         {.zero = ball({0, 0, 0}, 0.5F), .one = ball({0.1F, 0, 0}, 0.5F)}};
  Points queries = test::random_points(100, 59);
  queries.set(0, Vec3f::Zero());
  queries.set(1, {5e-21F, 0, 0});
  queries.set(2, {1e9F, 1e9F, 1e9F});
  for (const RegionPair& regions : pairs) {
    const ScaleField field = compute_scale_field(queries, regions, Blend::kQuartic);
    CHECK(test::all_finite(field.gradient));
    CHECK(*std::min_element(field.t.begin(), field.t.end()) >= 0.0F);
    CHECK(*std::max_element(field.t.begin(), field.t.end()) <= 1.0F);
  }
  // A point of both regions does not move.
  CHECK(compute_scale_field(queries, pairs[3], Blend::kQuartic).t[0] == 0.0F);
}

TEST_CASE("a cancelled computation stops, one without regions is a programming error") {
  const Level plane = test::plane_level(201);
  const ExecutionContext context;
  context.cancel();
  const ScaleField field =
      compute_scale_field(plane.position, plane_regions(plane, 0.3F, 0.01F), Blend::kQuartic, &context);
  CHECK(std::all_of(field.t.begin(), field.t.end(), [](float t) { return t == 0.0F; }));
  CHECK_THROWS_AS(compute_scale_field(plane.position, RegionPair{}, Blend::kQuartic), LogicError);
}

}  // namespace
}  // namespace pointwright
