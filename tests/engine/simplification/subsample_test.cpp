#include "engine/simplification/subsample.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "engine/spatial/kd_tree.h"
#include "tests/support/all_machines.h"
#include "tests/support/random_points.h"
#include "tests/support/spacing.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kPi = std::numbers::pi;

std::vector<std::uint32_t> chosen(const Surface& surface, std::size_t count) {
  auto result = subsample(surface.position, surface.normal, {.target = KeepCount{count}});
  REQUIRE(result.ok());
  const std::vector<std::uint32_t>& kept = result.value();
  CHECK(kept.size() == std::min(count, surface.size()));
  CHECK(std::is_sorted(kept.begin(), kept.end()));
  CHECK(std::adjacent_find(kept.begin(), kept.end()) == kept.end());
  CHECK((kept.empty() || kept.back() < surface.size()));
  return kept;
}

// A unit square whose density rises 16-fold along x.
Surface uneven_square(std::size_t count) {
  Random random(3);
  Surface surface{Points(count), Points(count)};
  for (std::size_t i = 0; i < count; ++i) {
    const double x = std::log2(1.0 + 15.0 * random.uniform()) / 4.0;
    const double y = random.uniform();
    surface.position.set(i, Vec3d(x, y, 0.0).cast<float>());
    surface.normal.set(i, {0.0F, 0.0F, 1.0F});
  }
  return coherent(surface);
}

Points random_subset(const Points& points, std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  for (std::size_t i = 0; i < count; ++i) std::swap(order[i], order[i + random.below(order.size() - i)]);
  order.resize(count);
  std::sort(order.begin(), order.end());
  return reordered(points, order);
}

TEST_CASE("on surfaces samples are evenly spaced, however uneven the input is") {
  struct Case {
    std::string name;
    Surface surface;
    double area;
  };
  const Case cases[] = {{"plane", plane(400, 1.0 / 400, Sampling::kRandom), 1.0},
                        {"lattice", plane(400, 1.0 / 400, Sampling::kRegular), 1.0},
                        {"sphere", sphere(160'000, 1.0, Sampling::kRandom), 4.0 * kPi},
                        {"torus", torus(160'000, 1.0, 0.4, Sampling::kRandom), 1.6 * kPi * kPi},
                        {"density 1:16", uneven_square(160'000), 1.0}};
  for (const Case& one : cases) {
    const std::string& name = one.name;
    const Surface& surface = one.surface;
    CAPTURE(name);
    constexpr std::size_t kCount = 8'000;
    const double ideal = hexagonal_spacing(one.area, kCount);
    const Spacing spacing = spacing_of(reordered(surface.position, chosen(surface, kCount)), ideal);
    const double gap =
        largest_gap(surface.position, reordered(surface.position, chosen(surface, kCount)), ideal);
    MESSAGE(name << ": nearest " << spacing.least << " of the hexagonal distance, mean " << spacing.mean
                 << ", variation " << spacing.variation << ", largest gap " << gap);
    // A hexagonal pattern's is 1, a random subset's near 0.
    CHECK(spacing.least > 0.7);
    CHECK(spacing.mean > 0.78);
    CHECK(spacing.variation < 0.085);
    CHECK(gap < 1.1);
    const Points by_chance = random_subset(surface.position, kCount, 7);
    const Spacing chance = spacing_of(by_chance, ideal);
    CHECK(chance.least < 0.22);  // of the lattice: its own spacing
    CHECK(chance.variation > 0.4);
    CHECK(gap < 0.6 * largest_gap(surface.position, by_chance, ideal));
  }
}

TEST_CASE("with few candidates distances are as great as they allow") {
  const Surface surface = torus(80'000, 1.0, 0.4, Sampling::kRandom);
  struct Step {
    std::size_t count;
    double least;
  };
  double before = 1.0;
  for (const Step& step : {Step{4'000, 0.7}, Step{20'000, 0.65}, Step{40'000, 0.5}}) {
    const Spacing spacing = spacing_of(reordered(surface.position, chosen(surface, step.count)),
                                       hexagonal_spacing(1.6 * kPi * kPi, step.count));
    MESSAGE(step.count << " of 80000: " << spacing.least);
    CHECK(spacing.least > step.least);
    CHECK(spacing.least < before);
    before = spacing.least;
  }
}

TEST_CASE("the spectrum has blue noise's hole around zero") {
  // Of the unit square's middle: mean power |sum exp(2 pi i f . p)|^2 / M over rings of frequencies. White
  // noise has 1 everywhere; evenly spaced samples have nothing up to a good part of 1 / spacing.
  const Surface surface = plane(300, 1.0 / 300, Sampling::kRandom);
  const auto power = [](const Points& points, int low, int high) {
    double sum = 0.0;
    double waves = 0.0;
    for (int u = -high; u <= high; u += 2) {
      for (int v = 0; v <= high; v += 2) {
        const double f = std::hypot(u, v);
        if (f < low || f >= high) continue;
        double real = 0.0;
        double imaginary = 0.0;
        for (std::size_t i = 0; i < points.size(); ++i) {
          const Vec3d p = points[i].cast<double>();
          // Raised cosines over the square, or its border would leak into all frequencies.
          const double window = (1.0 + std::cos(2.0 * kPi * p.x())) * (1.0 + std::cos(2.0 * kPi * p.y()));
          const double phase = 2.0 * kPi * (u * p.x() + v * p.y());
          real += window * std::cos(phase);
          imaginary += window * std::sin(phase);
        }
        // The window's mean square is 9/4.
        sum += (real * real + imaginary * imaginary) / (2.25 * static_cast<double>(points.size()));
        waves += 1.0;
      }
    }
    return sum / waves;
  };
  constexpr std::size_t kCount = 1'500;  // spacing 0.028: the first ring of power is at 36
  const Points even = reordered(surface.position, chosen(surface, kCount));
  const Points white = random_subset(surface.position, kCount, 5);
  const double hole = power(even, 4, 13);
  MESSAGE("power below a third " << hole << ", at the ring " << power(even, 34, 42) << "; white "
                                 << power(white, 4, 13));
  CHECK(hole < 0.2);
  CHECK(power(even, 34, 42) > 1.0);
  CHECK(power(white, 4, 13) > 0.7);
}

TEST_CASE("both sheets of a thin part keep their share, and their spacing") {
  // A spacing of 0.012 is wanted, four times the gap.
  const Surface surface = parallel_sheets(300, 1.0 / 300, 0.003, Sampling::kRandom);
  constexpr std::size_t kCount = 8'000;
  const auto upper = [&](const std::vector<std::uint32_t>& kept) {
    std::vector<std::uint32_t> result;
    std::copy_if(kept.begin(), kept.end(), std::back_inserter(result),
                 [&](std::uint32_t i) { return surface.position[i].z() > 0.0F; });
    return reordered(surface.position, result);
  };
  const Points above = upper(chosen(surface, kCount));
  CHECK(relative_error(static_cast<double>(above.size()), kCount / 2.0) < 0.02);
  const Spacing spacing = spacing_of(above, hexagonal_spacing(2.0, kCount));
  MESSAGE("nearest on one sheet " << spacing.least << ", mean " << spacing.mean);
  CHECK(spacing.least > 0.6);
  CHECK(spacing.mean > 0.75);
  // Without normals the two are one sheet to look at, and a projection of both is even.
  const auto blind = subsample(surface.position, {}, {.target = KeepCount{kCount}});
  REQUIRE(blind.ok());
  Points flat = reordered(surface.position, blind.value());
  for (std::size_t i = 0; i < flat.size(); ++i) flat.set(i, {flat[i].x(), flat[i].y(), 0.0F});
  CHECK(spacing_of(flat, hexagonal_spacing(1.0, kCount)).least > 0.5);
  CHECK(spacing_of(upper(blind.value()), hexagonal_spacing(2.0, kCount)).least < 0.85 * spacing.least);
}

TEST_CASE("counts and ratios are met exactly and agree") {
  const Surface surface = torus(5'000, 1.0, 0.4, Sampling::kRandom);
  for (const std::size_t count : {1, 2, 3, 10, 100, 1'250, 2'501, 4'990, 4'999, 5'000, 6'000})
    chosen(surface, count);
  const auto by_ratio = subsample(surface.position, surface.normal, {.target = KeepRatio{0.25}});
  REQUIRE(by_ratio.ok());
  CHECK(by_ratio.value() == chosen(surface, 1'250));
  CHECK(subsample(surface.position, surface.normal, {.target = KeepRatio{1e-9}}).value().size() == 1);
  CHECK(subsample(surface.position, surface.normal, {.target = KeepRatio{1.0}}).value().size() == 5'000);
}

TEST_CASE("any number of threads and any instruction set chooses the same samples") {
  const Surface surfaces[] = {torus(60'000, 1.0, 0.4, Sampling::kRandom),
                              plane(200, 0.01, Sampling::kRegular),
                              parallel_sheets(120, 0.01, 0.002, Sampling::kRandom)};
  for (const Surface& surface : surfaces) {
    for (const std::size_t count : {600, 12'000}) {
      for_all_machines([&] { return chosen(surface, count); },
                       [](const auto& one, const auto& other) { CHECK(other == one); });
    }
  }
}

TEST_CASE("the model's scale does not matter") {
  const Surface surface = torus(20'000, 1.0, 0.4, Sampling::kRandom);
  const std::vector<std::uint32_t> reference = chosen(surface, 2'000);
  for (const float scale : {0x1p-80F, 0x1p-20F, 0x1p25F}) {
    Surface scaled = surface;
    for (std::size_t i = 0; i < surface.size(); ++i) scaled.position.set(i, surface.position[i] * scale);
    CHECK(chosen(scaled, 2'000) == reference);
  }
}

TEST_CASE("degenerate input is legal") {
  const auto run = [](const Points& position, std::size_t count) {
    Surface surface{position, Points(position.size())};
    for (std::size_t i = 0; i < position.size(); ++i) surface.normal.set(i, {0.0F, 0.0F, 1.0F});
    return chosen(surface, count);
  };
  CHECK(run(Points(), 1).empty());
  CHECK(run(identical(1, {1, 2, 3}), 1).size() == 1);
  CHECK(run(from_list({{0, 0, 0}, {1, 0, 0}}), 1).size() == 1);
  CHECK(run(from_list({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}), 2).size() == 2);
  // Of a pile, samples from all over it.
  const std::vector<std::uint32_t> pile = run(identical(1'000, {1, 2, 3}), 10);
  CHECK(pile.front() < 200);
  CHECK(pile.back() >= 800);
  // Duplicates only when every place is taken: 100 places of three samples each.
  std::vector<Vec3f> list;
  for (int place = 0; place < 100; ++place) {
    for (int i = 0; i < 3; ++i) list.push_back({static_cast<float>(place), 0.0F, 0.0F});
  }
  const Points triples = from_list(list);
  for (const std::size_t count : {60, 100, 150}) {
    std::vector<float> places;
    for (const std::uint32_t i : run(triples, count)) places.push_back(triples[i].x());
    CHECK(std::unique(places.begin(), places.end()) - places.begin() ==
          static_cast<std::ptrdiff_t>(std::min<std::size_t>(count, 100)));
  }
  // On a line, none beside another: 500 samples, every tenth wanted.
  const Points line = collinear(500, {0, 0, 0}, {499, 0, 0});
  CHECK(spacing_of(reordered(line, run(line, 50)), 10.0).least > 0.5);
  // A cluster in a billionth of the box is one place to a coarse grid, and to a fine count a surface of its
  // own.
  list.clear();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 60; ++x)
      list.push_back({0.01F * static_cast<float>(x), 0.01F * static_cast<float>(y), 0.0F});
  }
  list.push_back({-1e9F, -1e9F, -1e9F});
  list.push_back({1e9F, 1e9F, 1e9F});
  const Points crowded = coherent(from_list(list));
  const std::vector<std::uint32_t> some = run(crowded, 362);
  std::vector<std::uint32_t> inside;
  std::copy_if(some.begin(), some.end(), std::back_inserter(inside),
               [&](std::uint32_t i) { return crowded[i].norm() < 10.0F; });
  CHECK(inside.size() == 360);
  CHECK(spacing_of(reordered(crowded, inside), hexagonal_spacing(0.36, 360)).least > 0.55);
  // Points that fill a volume have no area; they are spread all the same.
  const Points volume = coherent_random_points(20'000, 4);
  const Points apart = reordered(volume, run(volume, 1'000));
  CHECK(spacing_of(apart, 1.0).least > 5.0 * spacing_of(random_subset(volume, 1'000, 2), 1.0).least);
}

TEST_CASE("parameters out of range are named") {
  const auto field = [](const SubsampleParams& params) {
    const auto result = subsample(identical(10, {0, 0, 0}), {}, params);
    REQUIRE(!result.ok());
    CHECK(result.error().code == ErrorCode::kInvalidArgument);
    CHECK(result.error().limit.has_value());
    return result.error().field;
  };
  CHECK(field({.target = KeepCount{0}}) == "target.count");
  CHECK(field({.target = KeepRatio{0.0}}) == "target.ratio");
  CHECK(field({.target = KeepRatio{1.01}}) == "target.ratio");
  CHECK(field({.target = KeepRatio{std::numeric_limits<double>::quiet_NaN()}}) == "target.ratio");
  CHECK(validate(SubsampleParams{}).ok());
}

TEST_CASE("cancelled work says so") {
  const Surface surface = torus(20'000, 1.0, 0.4, Sampling::kRandom);
  const ExecutionContext context;
  context.cancel();
  const auto result = subsample(surface.position, surface.normal, {.target = KeepCount{500}}, &context);
  REQUIRE(!result.ok());
  CHECK(result.error().code == ErrorCode::kCancelled);
}

}  // namespace
}  // namespace pointwright
