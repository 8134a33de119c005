#include <doctest/doctest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/smoothing/umbrella.h"
#include "tests/support/surfaces.h"
#include "tests/support/wave_amplitude.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kTau = 6.283185307179586;
constexpr std::uint32_t kPlenty = 10'000;  // iterations: more than any scale here needs

struct Run {
  double attenuation;
  std::uint32_t iterations;
};

Run attenuate(Sampling sampling, double spacing, double wavelength, double scale,
              SmoothingDirection direction) {
  constexpr double kWidth = 100.0;
  const double height = 0.01 * wavelength;
  const auto side = static_cast<std::size_t>(kWidth / spacing);
  const Surface surface = wave(side, spacing, sampling, height, wavelength);
  auto result = smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 10),
                                static_cast<float>(scale), direction, kPlenty);
  REQUIRE(result.ok());
  CHECK(relative_error(static_cast<double>(result.value().scale), scale) < 0.001);
  return {wave_amplitude(result.value().points, wavelength, kWidth / 2, 4.0 * scale) / height,
          result.value().iterations};
}

// The standard deviation of the Gaussian that attenuates like this.
double effective_scale(double attenuation, double wavelength) {
  return wavelength / kTau * std::sqrt(-2.0 * std::log(attenuation));
}

TEST_CASE("a wave is attenuated as by a Gaussian of that standard deviation") {
  constexpr double kScale = 4.0;
  for (const Sampling sampling : {Sampling::kJittered, Sampling::kRandom}) {
    for (const SmoothingDirection direction : {SmoothingDirection::kFree, SmoothingDirection::kAlongNormal}) {
      for (const double wavelength : {15.0, 24.0}) {
        const bool is_random = sampling == Sampling::kRandom;
        const bool is_free = direction == SmoothingDirection::kFree;
        if (is_random && is_free && wavelength < 20.0) continue;  // the next test
        const Run run = attenuate(sampling, 1.0, wavelength, kScale, direction);
        const double effective = effective_scale(run.attenuation, wavelength);
        MESSAGE(std::string(is_random ? "random" : "jittered")
                << std::string(is_free ? ", free" : ", along normals") << ", wavelength " << wavelength
                << ": " << run.attenuation << ", effective scale " << effective / kScale);
        // Measured over five seeds: within 0.9 % jittered, within 2.6 % random along the normals, 3.5 % free.
        const double bound = !is_random ? 0.015 : is_free ? 0.04 : 0.03;
        CHECK(relative_error(effective, kScale) < bound);
      }
    }
  }
}

TEST_CASE("free steps on a random sampling approach the Gaussian of a short wave as the density grows") {
  // Samples that drift into clumps have weights with a longer tail than a Gaussian's: mean excess kurtosis
  // 1.1, 0.8 and 0.4 measured at spacings of 2, 1 and 0.5, and with this fourth cumulant exp(-k^2 v/2 + k^4
  // c/24) gives the attenuation of wavelength 15 within 8 %. So the error is the sampling's and goes with it.
  constexpr double kScale = 4.0;
  constexpr double kWavelength = 15.0;
  std::vector<double> error;
  for (const double spacing : {2.0, 1.0, 0.5}) {
    const Run run = attenuate(Sampling::kRandom, spacing, kWavelength, kScale, SmoothingDirection::kFree);
    error.push_back(1.0 - effective_scale(run.attenuation, kWavelength) / kScale);
    MESSAGE("spacing " << spacing << ": effective scale short by " << error.back());
  }
  CHECK(error[0] < 0.14);
  CHECK(error[1] < 0.10);
  CHECK(error[2] < 0.05);
  CHECK(error[2] < 0.7 * error[1]);
}

TEST_CASE("the kernel variance predicts a wave's attenuation on a gradient of density") {
  // Three times as dense at the right edge as at the left; the formula for even samplings, 4 pi s^2 / (lambda
  // (k + 1) h^2) iterations, is off by that factor between the edges.
  constexpr double kWidth = 100.0;
  constexpr double kScale = 4.0;
  test::Random random(11);
  for (const double wavelength : {15.0, 24.0}) {
    for (const SmoothingDirection direction : {SmoothingDirection::kFree, SmoothingDirection::kAlongNormal}) {
      Surface surface{.position = Points(10'000), .normal = Points(10'000)};
      for (std::size_t i = 0; i < surface.size(); ++i) {
        // Density 1 + 2 u over u in [0, 1]: u^2 + u = 2 r.
        const double u = -0.5 + std::sqrt(0.25 + 2.0 * random.uniform());
        const double x = kWidth * (u - 0.5);
        const double height = 0.01 * wavelength;
        const double slope = kTau / wavelength * height * std::cos(kTau * x / wavelength);
        surface.position.set(
            i, Vec3d(x, random.uniform(-0.5, 0.5) * kWidth, height * std::sin(kTau * x / wavelength))
                   .cast<float>());
        surface.normal.set(i, Vec3d(-slope, 0.0, 1.0).normalized().cast<float>());
      }
      surface = coherent(surface);
      const auto result =
          smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 10),
                          kScale, direction, kPlenty);
      REQUIRE(result.ok());
      const double left =
          wave_amplitude(result.value().points, wavelength, kWidth / 2, 4.0 * kScale) / (0.01 * wavelength);
      MESSAGE("wavelength " << wavelength << ": " << left << ", effective scale "
                            << effective_scale(left, wavelength) / kScale);
      CHECK(relative_error(effective_scale(left, wavelength), kScale) < 0.1);
    }
  }
}

TEST_CASE("a scale means the same at two densities") {
  const Run coarse = attenuate(Sampling::kRandom, 1.0, 20.0, 4.0, SmoothingDirection::kAlongNormal);
  const Run fine = attenuate(Sampling::kRandom, 0.7, 20.0, 4.0, SmoothingDirection::kAlongNormal);
  CHECK(fine.iterations > 3 * coarse.iterations / 2);
  CHECK(relative_error(fine.attenuation, coarse.attenuation) < 0.04);
}

TEST_CASE("scale 0 and clouds without neighbours stay as they are") {
  const Surface surface = sphere(500, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const auto zero =
      smooth_to_scale(surface.position, surface.normal, graph, 0.0F, SmoothingDirection::kFree, kPlenty);
  REQUIRE(zero.ok());
  CHECK(zero.value().points == surface.position);
  CHECK(zero.value().iterations == 0);
  const Points pile = identical(30, {1, 1, 1});
  const auto same =
      smooth_to_scale(pile, {}, build_neighbor_graph(pile, 10), 1.0F, SmoothingDirection::kFree, kPlenty);
  REQUIRE(same.ok());
  CHECK(same.value().points == pile);
}

TEST_CASE("a scale that is negative or not finite is refused") {
  const Surface surface = sphere(500, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  for (const float scale : {-1.0F, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    const auto result =
        smooth_to_scale(surface.position, surface.normal, graph, scale, SmoothingDirection::kFree, kPlenty);
    REQUIRE_FALSE(result.ok());
    CHECK(result.error().code == ErrorCode::kInvalidArgument);
    CHECK(result.error().field == "scale");
  }
}

TEST_CASE("a closed cloud that is too small for the scale is smoothed as far as it goes, and says how far") {
  // Smoothing ends where a step adds a hundredth of the first one's variance. On an even unit sphere that
  // gain goes as the squared radius, so a radius of 0.1 is left, a diagonal of 0.1 * 2 sqrt 3, and a variance
  // of 1 - 0.1^2.
  for (const std::size_t count : {300U, 1'000U}) {
    const Surface surface = sphere(count, 1.0, Sampling::kRegular);
    const auto result =
        smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 10), 50.0F,
                        SmoothingDirection::kFree, kPlenty);
    REQUIRE(result.ok());
    CHECK(relative_error(static_cast<double>(result.value().scale), std::sqrt(0.5 * 0.99)) < 0.002);
    CHECK(relative_error(static_cast<double>(bounds_of(result.value().points).diagonal()),
                         0.2 * std::sqrt(3.0)) < 0.05);
  }
}

TEST_CASE("a random closed cloud ends further out, as its slowest wave outlives the median") {
  // The gain goes as rate * radius^2, and a slow wave has a lower rate: 0.34 of an even sphere's measured for
  // 1,000 samples. Over twelve clouds the median sample ends at 0.12 to 0.18 from the middle. The graph is
  // one closed class, so all of it goes in time: 0.15 to 0.30 of the diagonal is left after twice the
  // steps.
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Surface surface = sphere(300, 1.0, Sampling::kRandom, seed);
    const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
    const auto result =
        smooth_to_scale(surface.position, surface.normal, graph, 50.0F, SmoothingDirection::kFree, kPlenty);
    REQUIRE(result.ok());
    CHECK(relative_error(static_cast<double>(result.value().scale), std::sqrt(0.5 * 0.975)) < 0.015);
    const float left = bounds_of(result.value().points).diagonal();
    const auto twice =
        smooth(surface.position, {}, graph, {.lambda = 0.5F, .iterations = 2 * result.value().iterations});
    REQUIRE(twice.ok());
    CHECK(bounds_of(twice.value()).diagonal() < 0.31F * left);
  }
}

TEST_CASE("a sheet that is too small for the scale says how far it was smoothed") {
  // Steps along the normals keep linear functions, so the mean of the weights stays on the sample while they
  // spread: they end in the corners, with the variance x (side - x) an axis, 0.41^2 side^2 in the median over
  // the sheet.
  for (const std::size_t side : {12U, 24U}) {
    const Surface surface = plane(side, 1.0, Sampling::kJittered);
    const auto result =
        smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 10), 1e4F,
                        SmoothingDirection::kAlongNormal, kPlenty);
    REQUIRE(result.ok());
    MESSAGE("side " << side << ": reached " << result.value().scale);
    CHECK(relative_error(static_cast<double>(result.value().scale), 0.41 * static_cast<double>(side)) < 0.08);
  }
}

TEST_CASE("at the limit of iterations smoothing ends, and says how far it came") {
  const Surface surface = sphere(300, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const auto to_scale = [&](float scale, std::uint32_t limit) {
    auto result = smooth_to_scale(surface.position, surface.normal, graph, scale,
                                  SmoothingDirection::kAlongNormal, limit);
    REQUIRE(result.ok());
    return std::move(result).value();
  };
  const ScaledSmoothing few = to_scale(1e4F, 10);
  CHECK(few.iterations == 10);
  const ScaledSmoothing more = to_scale(1e4F, 40);
  CHECK(more.iterations == 40);
  CHECK(more.scale > 1.5F * few.scale);
  CHECK(more.scale < 1e4F);
  // The scale that it says is the one that would have been met in as many steps.
  const ScaledSmoothing met = to_scale(few.scale, kPlenty);
  CHECK(met.iterations == 10);
  CHECK(met.scale == doctest::Approx(static_cast<double>(few.scale)).epsilon(1e-3));
  const ScaledSmoothing none = to_scale(1.0F, 0);
  CHECK(none.points == surface.position);
  CHECK(none.scale == 0.0F);
}

TEST_CASE("along the normals no scale beyond the object's size is reported") {
  // Steps along the normals add variance for ever; no weights about a point of a sphere that stay on it have
  // more than radius^2 an axis. At most a few bounded samples more than half end it.
  for (const std::size_t count : {300U, 1'000U}) {
    for (const Sampling sampling : {Sampling::kRegular, Sampling::kRandom}) {
      const Surface surface = sphere(count, 2.0, sampling);
      const auto result =
          smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 10), 1e4F,
                          SmoothingDirection::kAlongNormal, kPlenty);
      REQUIRE(result.ok());
      MESSAGE(count << " samples: scale " << result.value().scale << " after " << result.value().iterations);
      CHECK(result.value().scale <= 2.0F);
      CHECK(result.value().scale > 1.9F);
      CHECK(result.value().iterations < kPlenty);
    }
  }
}

TEST_CASE("clusters that do not join are smoothed as far as they reach, and say so") {
  // Twelve samples each within 0.01, all ten neighbours among them: no step leaves a cluster.
  test::Random random(5);
  Surface surface;
  constexpr std::size_t kClusters = 400;
  surface.position.resize(12 * kClusters);
  surface.normal.resize(12 * kClusters);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const std::size_t cluster = i / 12;
    const Vec3d corner(static_cast<double>(cluster % 20), static_cast<double>(cluster / 20), 0.0);
    surface.position.set(
        i, (corner + 0.005 * Vec3d(random.uniform(-1, 1), random.uniform(-1, 1), 0)).cast<float>());
    surface.normal.set(i, {0, 0, 1});
  }
  surface = coherent(surface);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  for (const SmoothingDirection direction : {SmoothingDirection::kFree, SmoothingDirection::kAlongNormal}) {
    const auto result = smooth_to_scale(surface.position, surface.normal, graph, 1.0F, direction, kPlenty);
    REQUIRE(result.ok());
    MESSAGE("scale " << result.value().scale << " after " << result.value().iterations);
    CHECK(result.value().scale > 0.001F);
    CHECK(result.value().scale <= 0.005F);
    CHECK(result.value().iterations < kPlenty);
  }
}

TEST_CASE("a cancel from elsewhere ends the smoothing") {
  const Surface surface = plane(120, 1.0, Sampling::kJittered);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const ExecutionContext context;
  std::chrono::steady_clock::time_point cancelled_at;
  std::thread canceller([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    cancelled_at = std::chrono::steady_clock::now();
    context.cancel();
  });
  const auto result = smooth_to_scale(surface.position, surface.normal, graph, 40.0F,
                                      SmoothingDirection::kFree, kPlenty, &context);
  const auto ended_at = std::chrono::steady_clock::now();
  canceller.join();
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kCancelled);
  CHECK(ended_at - cancelled_at < std::chrono::seconds(1));
}

TEST_CASE("smoothing to a scale gives the same bytes for any thread count") {
  const Surface surface = with_noise(sphere(8'000, 1.0, Sampling::kRandom), 0.01);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const auto run = [&](int threads) {
    Points points;
    with_threads(threads, [&] {
      points = smooth_to_scale(surface.position, surface.normal, graph, 0.1F,
                               SmoothingDirection::kAlongNormal, kPlenty)
                   .value()
                   .points;
    });
    return points;
  };
  const Points one = run(1);
  CHECK(run(2) == one);
  CHECK(run(8) == one);
}

}  // namespace
}  // namespace pointwright
