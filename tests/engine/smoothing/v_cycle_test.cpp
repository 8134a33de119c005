#include "engine/smoothing/v_cycle.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/spatial/kd_tree.h"
#include "tests/support/surfaces.h"
#include "tests/support/voxel_coarsener.h"
#include "tests/support/wave_amplitude.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kTau = 2.0 * std::numbers::pi;

struct Rest {
  Surface surface;
  NeighborGraph graph;
  SmoothingHierarchy hierarchy;
};

Rest rest_of(Surface surface, double scale, const Coarsener& coarsen = coarsen_by_voxels) {
  Rest rest{.surface = std::move(surface), .graph = {}, .hierarchy = {}};
  rest.graph = build_neighbor_graph(rest.surface.position, 10);
  auto hierarchy = build_smoothing_hierarchy(rest.surface.position, rest.surface.normal, rest.graph,
                                             static_cast<float>(scale), coarsen);
  REQUIRE(hierarchy.ok());
  rest.hierarchy = std::move(hierarchy).value();
  return rest;
}

VCycle cycle(const Rest& rest, const VCycleParams& params) {
  auto result = v_cycle(rest.surface.position, rest.surface.normal, rest.graph, rest.hierarchy, params);
  REQUIRE(result.ok());
  return std::move(result).value();
}

// Nearest-neighbour distance at the first percentile.
double nearest_distance(const Points& points) {
  const KdTree tree(points);
  std::vector<Neighbor> found;
  std::vector<double> distance;
  for (std::size_t i = 0; i < points.size(); ++i) {
    tree.nearest(points[i], 2, found);
    distance.push_back(std::sqrt(static_cast<double>(found[1].distance_sq)));
  }
  const auto at = distance.begin() + static_cast<std::ptrdiff_t>(distance.size() / 100);
  std::nth_element(distance.begin(), at, distance.end());
  return *at;
}

// Wavelength over scale at which half of the amplitude is left, between the rows of a table in log of both.
double half_attenuation(const std::vector<std::pair<double, double>>& table) {
  for (std::size_t row = 1; row < table.size(); ++row) {
    const auto [l0, a0] = table[row - 1];
    const auto [l1, a1] = table[row];
    if (a1 < 0.5) continue;
    const double part = (0.5 - a0) / (a1 - a0);
    return std::exp(std::log(l0) + part * (std::log(l1) - std::log(l0)));
  }
  return 0.0;
}

TEST_CASE("the V-cycle takes waves down as the scale says, the shorter the more") {
  // Half of the amplitude is left at L = s pi sqrt 2 / sqrt(ln 2), 5.34 s, of a Gaussian, and at s pi sqrt 2
  // / (ln 2)^(1/4), 4.87 s, of compensated steps. Where fine offsets were added back, waves of 1.5 s would
  // stay.
  constexpr std::size_t kSide = 200;
  for (const Sampling sampling : {Sampling::kJittered, Sampling::kRandom}) {
    for (const double scale : {4.0, 8.0}) {
      for (const VolumePreservation preserve : {VolumePreservation::kNone, VolumePreservation::kLocal}) {
        const bool is_plain = preserve == VolumePreservation::kNone;
        std::vector<std::pair<double, double>> table;
        for (const double ratio : {1.5, 3.0, 4.5, 5.0, 5.7, 8.0, 12.0}) {
          const double wavelength = ratio * scale;
          const double height = 0.01 * wavelength;
          const Rest rest = rest_of(wave(kSide, 1.0, sampling, height, wavelength), scale);
          const VCycle smoothed = cycle(rest, {.scale = static_cast<float>(scale), .preserve = preserve});
          CHECK(smoothed.depth >= 1);
          CHECK(relative_error(static_cast<double>(smoothed.scale), scale) < 0.01);
          const double left = wave_amplitude(smoothed.points, wavelength, 0.5 * kSide, 4.0 * scale) / height;
          if (!table.empty()) CHECK(left > table.back().second);
          table.emplace_back(ratio, left);
          if (is_plain && ratio > 2.0) {
            const double effective = wavelength / kTau * std::sqrt(-2.0 * std::log(left));
            CHECK(relative_error(effective, scale) < 0.05);
          }
        }
        CHECK(std::abs(table.front().second) < 0.03);
        const double half = half_attenuation(table);
        MESSAGE(std::string(is_plain ? "plain" : "local")
                << ", scale " << scale << ": half at " << half << " scales");
        CHECK(relative_error(half, is_plain ? 5.336 : 4.869) < (is_plain ? 0.03 : 0.07));
      }
    }
  }
}

TEST_CASE("over contracted levels, an octave each, waves go down as the scale says") {
  constexpr double kScale = 8.0;
  constexpr std::size_t kSide = 200;
  for (const Sampling sampling : {Sampling::kJittered, Sampling::kRandom}) {
    double before = 0.0;
    for (const double ratio : {3.0, 4.5, 6.0, 9.0}) {
      const double wavelength = ratio * kScale;
      const double height = 0.01 * wavelength;
      const Rest rest =
          rest_of(wave(kSide, 1.0, sampling, height, wavelength), kScale, contracting_coarsener());
      const VCycle smoothed = cycle(rest, {.scale = kScale});
      CHECK(smoothed.depth == 2);
      CHECK(smoothed.coarsest_spacing > static_cast<float>(kScale / 3.0));
      CHECK(smoothed.coarsest_spacing < static_cast<float>(kScale / 1.5));
      const double left = wave_amplitude(smoothed.points, wavelength, 0.5 * kSide, 4.0 * kScale) / height;
      const double effective = wavelength / kTau * std::sqrt(-2.0 * std::log(left));
      MESSAGE("wavelength " << ratio << " scales: " << left << ", effective scale " << effective / kScale);
      CHECK(left > before);
      CHECK(relative_error(effective, kScale) < 0.05);
      CHECK(nearest_distance(smoothed.points) >= 0.5 * nearest_distance(rest.surface.position));
      before = left;
    }
  }
}

TEST_CASE("sheets that the coarse spacing would join stay apart") {
  // Five spacings apart, so that the finest level's neighbours, of corners too, stay in one sheet; the ten
  // neighbours on the coarsest level reach eight far and are looked for on one side.
  const Rest rest =
      rest_of(parallel_sheets(100, 1.0, 5.0, Sampling::kJittered), 8.0, contracting_coarsener());
  REQUIRE(rest.hierarchy.coarse.size() == 2);
  CHECK(rest.hierarchy.coarse.back().measure.spacing > 3.0F);
  const VCycle smoothed = cycle(rest, {.scale = 8.0F, .direction = SmoothingDirection::kFree});
  for (std::size_t i = 0; i < smoothed.points.size(); ++i) {
    CHECK(std::abs(smoothed.points[i].z() - rest.surface.position[i].z()) < 1e-3F);
  }
}

TEST_CASE("the V-cycle does what iteration to the scale does") {
  constexpr double kScale = 6.0;
  constexpr std::size_t kSide = 200;
  for (const double wavelength : {20.0, 32.0, 60.0}) {
    const double height = 0.01 * wavelength;
    const Rest rest = rest_of(wave(kSide, 1.0, Sampling::kJittered, height, wavelength), kScale);
    const auto start = std::chrono::steady_clock::now();
    const VCycle smoothed = cycle(rest, {.scale = kScale});
    const auto between = std::chrono::steady_clock::now();
    const auto iterated = smooth_to_scale(rest.surface.position, rest.surface.normal, rest.graph, kScale,
                                          SmoothingDirection::kAlongNormal, 10'000);
    const auto end = std::chrono::steady_clock::now();
    REQUIRE(iterated.ok());
    const double by_cycle = wave_amplitude(smoothed.points, wavelength, 0.5 * kSide, 4.0 * kScale) / height;
    const double by_steps =
        wave_amplitude(iterated.value().points, wavelength, 0.5 * kSide, 4.0 * kScale) / height;
    MESSAGE("wavelength " << wavelength << ": " << by_cycle << " and " << by_steps << " by "
                          << iterated.value().iterations << " iterations, which take "
                          << std::chrono::duration<double>(end - between) /
                                 std::chrono::duration<double>(between - start)
                          << " times as long");
    CHECK(std::abs(by_cycle - by_steps) < 0.03);
    // What is not the wave: nothing that the cycle leaves or makes.
    CHECK(iterated.value().iterations > 50);
    CHECK(smoothed.bottom_iterations < 30);
  }
}

// Zonal harmonic of degree 8.
double legendre8(double z) {
  const double q = z * z;
  return (6435.0 * q * q * q * q - 12012.0 * q * q * q + 6930.0 * q * q - 1260.0 * q + 35.0) / 128.0;
}

// Its axis, askew to the grid of the coarse levels, which is coarser where it is cut along its planes.
const Vec3d kAxis(0.2673, 0.5345, 0.8018);

struct Harmonic {
  double radius;
  double amplitude;
};

// By least squares of the radius over 1 and P_8.
Harmonic harmonic_of(const Points& points) {
  double n = 0.0, sp = 0.0, spp = 0.0, sr = 0.0, srp = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i].cast<double>();
    const double r = p.norm();
    const double basis = legendre8(p.dot(kAxis) / r);
    n += 1.0;
    sp += basis;
    spp += basis * basis;
    sr += r;
    srp += r * basis;
  }
  const double slope = (n * srp - sp * sr) / (n * spp - sp * sp);
  return {(sr - slope * sp) / n, slope};
}

TEST_CASE(
    "a scale means the same on 20,000 and on 320,000 samples of one object, and samples do not pile up") {
  // Heat flow over time t = s^2 / 2 takes a sphere's radius down to exp(-2 t), and a bump pattern P_l along
  // its normals, whose coordinates are harmonics of degree l - 1 and l + 1, by l / (2 l + 1) exp(-l (l - 1)
  // t) + (l + 1) / (2 l + 1) exp(-(l + 1) (l + 2) t). Spacings are 0.025 and 0.0063. The grid of the coarse
  // levels leaves a pattern of its own on the sphere, which is taken off.
  constexpr double kScale = 0.09;
  constexpr double kTime = 0.5 * kScale * kScale;
  constexpr double kBumps = 0.004;
  const double expected = 8.0 / 17.0 * std::exp(-56.0 * kTime) + 9.0 / 17.0 * std::exp(-90.0 * kTime);
  std::vector<double> left;
  for (const std::size_t count : {20'000U, 320'000U}) {
    const Surface ball = sphere(count, 1.0, Sampling::kRandom);
    const auto harmonic = [&](double bumps) {
      const Rest rest =
          rest_of(displaced(ball, [&](const Vec3d& p) { return bumps * legendre8(p.dot(kAxis) / p.norm()); }),
                  kScale);
      const VCycle smoothed = cycle(rest, {.scale = static_cast<float>(kScale)});
      CHECK(relative_error(static_cast<double>(smoothed.scale), kScale) < 0.01);
      const double kept = nearest_distance(smoothed.points) / nearest_distance(rest.surface.position);
      CHECK(kept >= 0.5);
      MESSAGE(count << " samples: depth " << smoothed.depth << ", nearest distance " << kept
                    << " of what it was");
      return harmonic_of(smoothed.points);
    };
    const Harmonic smooth_ball = harmonic(0.0);
    left.push_back((harmonic(kBumps).amplitude - smooth_ball.amplitude) / kBumps);
    MESSAGE("radius " << smooth_ball.radius << ", of P8 " << left.back() << " left, expected "
                      << std::exp(-2.0 * kTime) << " and " << expected);
    CHECK(std::abs(smooth_ball.radius - std::exp(-2.0 * kTime)) < 0.0015);
    CHECK(std::abs(left.back() - expected) < 0.03);
  }
  CHECK(std::abs(left[0] - left[1]) < 0.03);
}

TEST_CASE("a closed surface keeps its volume under local preservation and under rescaling") {
  // A Gaussian of 0.15 takes 2.2 % off the radius.
  const Surface noisy = with_noise(sphere(30'000, 1.0, Sampling::kRandom), 0.003);
  const Rest rest = rest_of(noisy, 0.15);
  const auto radius = [&](VolumePreservation preserve) {
    return harmonic_of(cycle(rest, {.scale = 0.15F, .preserve = preserve}).points).radius;
  };
  const double plain = radius(VolumePreservation::kNone);
  const double local = radius(VolumePreservation::kLocal);
  const double global = radius(VolumePreservation::kGlobal);
  MESSAGE("radius " << plain << " plain, " << local << " local, " << global << " rescaled");
  // Medians calibrate, and on random samples the mean of the variances is a little more than their median.
  CHECK(std::abs(plain - std::exp(-0.15 * 0.15)) < 0.003);
  CHECK(std::abs(local - 1.0) < 0.004);
  CHECK(std::abs(global - 1.0) < 0.002);
}

TEST_CASE("Psi^-1 is exact for what is quadratic over the parent's plane, wherever samples carry that") {
  const Surface flat = plane(80, 1.0, Sampling::kRandom);
  const Rest rest = rest_of(flat, 20.0);
  REQUIRE(rest.hierarchy.coarse.size() >= 2);
  const auto height = [](const Vec3f& p) {
    const Vec3d q = p.cast<double>() / 40.0;
    return 1.0 + q.x() - 2.0 * q.y() + 3.0 * q.x() * q.x() - q.x() * q.y() + 0.5 * q.y() * q.y();
  };
  const Points* fine = &flat.position;
  for (const CoarseLevel& level : rest.hierarchy.coarse) {
    const std::uint32_t k = level.graph.k;
    std::size_t exact = 0;
    for (std::size_t i = 0; i < fine->size(); ++i) {
      const std::uint32_t parent = level.parent[i];
      double sum = height(level.position[parent]);
      double size = 0.0;
      double own = 1.0;
      for (std::uint32_t j = 0; j < k; ++j) {
        const auto weight = static_cast<double>(level.weights[i * k + j]);
        sum +=
            weight * (height(level.position[level.graph.index(parent, j)]) - height(level.position[parent]));
        size += std::abs(weight);
        own -= weight;
      }
      CHECK(size + std::abs(own) < 3.001);
      if (std::abs(sum - height((*fine)[i])) < 2e-5) ++exact;
    }
    MESSAGE(exact << " of " << fine->size() << " exact");
    CHECK(static_cast<double>(exact) > 0.95 * static_cast<double>(fine->size()));  // the rest at the border
    // Their variance is nothing, then.
    CHECK(std::abs(level.up_variance) < 1e-6 * static_cast<double>(level.measure.spacing));
    fine = &level.position;
  }
}

TEST_CASE("a coarse sample moves as its children move") {
  const Rest rest = rest_of(sphere(5'000, 1.0, Sampling::kRandom), 0.2);
  REQUIRE_FALSE(rest.hierarchy.coarse.empty());
  const CoarseLevel& level = rest.hierarchy.coarse.front();
  std::size_t children = 0;
  for (std::size_t m = 0; m < level.position.size(); ++m) {
    Vec3d mean = Vec3d::Zero();
    for (std::uint32_t c = level.child_first[m]; c < level.child_first[m + 1]; ++c) {
      CHECK(level.parent[level.child[c]] == m);
      mean += rest.surface.position[level.child[c]].cast<double>();
      ++children;
    }
    mean /= static_cast<double>(level.child_first[m + 1] - level.child_first[m]);
    CHECK((mean + level.child_offset[m].cast<double>() - level.position[m].cast<double>()).norm() < 1e-6);
  }
  CHECK(children == rest.surface.size());
}

TEST_CASE("a plane stays flat, and in place along its normals") {
  const Rest rest = rest_of(plane(100, 1.0, Sampling::kRandom), 8.0);
  for (const VolumePreservation preserve : {VolumePreservation::kNone, VolumePreservation::kLocal}) {
    const Points after = cycle(rest, {.scale = 8.0F, .preserve = preserve}).points;
    for (std::size_t i = 0; i < after.size(); ++i) {
      CHECK((after[i] - rest.surface.position[i]).norm() < 1e-5F);
    }
    const Points free =
        cycle(rest, {.scale = 8.0F, .preserve = preserve, .direction = SmoothingDirection::kFree}).points;
    for (std::size_t i = 0; i < free.size(); ++i) CHECK(std::abs(free[i].z()) < 1e-5F);
  }
}

TEST_CASE("the coarsest level's spacing lies between a third and two thirds of the scale") {
  const Rest rest = rest_of(sphere(60'000, 1.0, Sampling::kRandom), 0.5);
  std::uint32_t before = 0;
  for (const float scale : {0.06F, 0.1F, 0.15F, 0.2F, 0.3F, 0.45F}) {
    const VCycle smoothed = cycle(rest, {.scale = scale});
    CHECK(smoothed.coarsest_spacing > scale / 3.0F);
    CHECK(smoothed.coarsest_spacing < 0.9F * scale);  // a grid's levels are more than an octave apart
    CHECK(smoothed.depth >= before);
    CHECK(smoothed.bottom_iterations < 40);
    before = smoothed.depth;
  }
  CHECK(before >= 3);
}

TEST_CASE("what cannot be reached is not claimed") {
  const Rest small = rest_of(sphere(400, 1.0, Sampling::kRegular), 10.0);
  const VCycle far = cycle(small, {.scale = 10.0F, .direction = SmoothingDirection::kFree});
  MESSAGE("scale " << far.scale << " of a unit sphere");
  CHECK(far.scale < 1.0F);
  CHECK(all_finite(far.points));
  // Many iterations on the way: less deep, or more than was asked for, and said so.
  const Rest rest = rest_of(sphere(20'000, 1.0, Sampling::kRandom), 0.2);
  const VCycle busy = cycle(rest, {.scale = 0.2F, .pre_iterations = 100, .post_iterations = 100});
  CHECK(busy.scale == doctest::Approx(0.2).epsilon(0.01));
  CHECK(busy.depth < cycle(rest, {.scale = 0.2F}).depth);
}

TEST_CASE("a scale below the spacing is smoothed on the finest level alone") {
  const Rest rest = rest_of(sphere(20'000, 1.0, Sampling::kRandom), 0.2);
  const VCycle fine = cycle(rest, {.scale = 0.02F});
  CHECK(fine.depth == 0);
  CHECK(fine.bottom_iterations > 0);
  CHECK(fine.scale == doctest::Approx(0.02).epsilon(0.01));
  const VCycle none = cycle(rest, {.scale = 0.0F});
  CHECK(none.points == rest.surface.position);
  CHECK(none.scale == 0.0F);
}

TEST_CASE("V-cycle parameters out of range are refused and named") {
  const auto field_of = [](const VCycleParams& params) { return validate(params).error().field; };
  CHECK(field_of({.scale = -1.0F}) == "scale");
  CHECK(field_of({.scale = std::nanf("")}) == "scale");
  CHECK(field_of({.scale = std::numeric_limits<float>::infinity()}) == "scale");
  CHECK(field_of({.scale = 1.0F, .preserve = VolumePreservation::kTaubin}) == "preserve");
  CHECK(field_of({.scale = 1.0F, .pre_iterations = 101}) == "pre_iterations");
  CHECK(field_of({.scale = 1.0F, .post_iterations = 101}) == "post_iterations");
  CHECK(field_of({.scale = 1.0F, .lambda = 0.71F}) == "lambda");
  CHECK(field_of({.scale = 1.0F, .lambda = 0.0F}) == "lambda");
  const Rest open = rest_of(hemisphere(5'000, 1.0), 0.2);
  const auto result = v_cycle(open.surface.position, open.surface.normal, open.graph, open.hierarchy,
                              {.scale = 0.2F, .preserve = VolumePreservation::kGlobal});
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().field == "preserve");
  const auto hierarchy = build_smoothing_hierarchy(open.surface.position, open.surface.normal, open.graph,
                                                   -1.0F, coarsen_by_voxels);
  REQUIRE_FALSE(hierarchy.ok());
  CHECK(hierarchy.error().field == "scale");
}

TEST_CASE("a coarsener's error comes back") {
  const Surface ball = sphere(2'000, 1.0, Sampling::kRandom);
  const auto failing = [](const Points&, const Points&, const NeighborGraph&) -> Result<Coarsening> {
    return Error{.code = ErrorCode::kInvalidArgument, .message = "no", .field = "ratio"};
  };
  const auto result = build_smoothing_hierarchy(ball.position, ball.normal,
                                                build_neighbor_graph(ball.position, 10), 0.5F, failing);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().field == "ratio");
}

TEST_CASE("a cancelled V-cycle says so, from the start and in between") {
  const Rest rest = rest_of(sphere(60'000, 1.0, Sampling::kRandom), 0.3);
  const ExecutionContext at_once;
  at_once.cancel();
  const VCycleParams params{.scale = 0.3F, .pre_iterations = 100, .post_iterations = 100};
  const auto never = v_cycle(rest.surface.position, {}, rest.graph, rest.hierarchy, params, &at_once);
  REQUIRE_FALSE(never.ok());
  CHECK(never.error().code == ErrorCode::kCancelled);
  const auto unbuilt = build_smoothing_hierarchy(rest.surface.position, rest.surface.normal, rest.graph, 0.3F,
                                                 coarsen_by_voxels, &at_once);
  REQUIRE_FALSE(unbuilt.ok());
  CHECK(unbuilt.error().code == ErrorCode::kCancelled);
  const ExecutionContext later;
  std::thread canceller([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    later.cancel();
  });
  const auto started = std::chrono::steady_clock::now();
  const auto stopped = v_cycle(rest.surface.position, {}, rest.graph, rest.hierarchy, params, &later);
  canceller.join();
  CHECK(std::chrono::steady_clock::now() - started < std::chrono::seconds(2));
  if (!stopped.ok()) CHECK(stopped.error().code == ErrorCode::kCancelled);
}

TEST_CASE("the V-cycle and its hierarchy are the same bytes for any thread count") {
  const Surface noisy = with_noise(sphere(30'000, 1.0, Sampling::kRandom), 0.005);
  for (const VolumePreservation preserve :
       {VolumePreservation::kNone, VolumePreservation::kLocal, VolumePreservation::kGlobal}) {
    const auto run = [&](int threads) {
      Points result;
      with_threads(threads, [&] {
        const Rest rest = rest_of(noisy, 0.15);
        result = cycle(rest, {.scale = 0.15F, .preserve = preserve}).points;
      });
      return result;
    };
    const Points one = run(1);
    CHECK(run(2) == one);
    CHECK(run(8) == one);
  }
}

TEST_CASE("degenerate clouds go through the V-cycle") {
  for (const Points& points :
       {Points{}, identical(1, {1, 2, 3}), identical(300, {1, 2, 3}), collinear(500, {0, 0, 0}, {1, 2, 3}),
        from_list({{0, 0, 0}, {1, 0, 0}}), from_list({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})}) {
    Surface surface{.position = points, .normal = Points(points.size())};
    for (std::size_t i = 0; i < points.size(); ++i) surface.normal.set(i, {0, 0, 1});
    const Rest rest = rest_of(surface, 1.0);
    for (const VolumePreservation preserve : {VolumePreservation::kNone, VolumePreservation::kLocal}) {
      const VCycle result = cycle(rest, {.scale = 1.0F, .preserve = preserve});
      CHECK(result.points.size() == points.size());
      CHECK(all_finite(result.points));
    }
  }
}

}  // namespace
}  // namespace pointwright
