#include <doctest/doctest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>

#include "engine/core/parallel.h"
#include "engine/smoothing/umbrella.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kTau = 6.283185307179586;

// Amplitude of sin(2 pi x / wavelength) in the heights, by least squares, without a margin along the border.
double amplitude(const Points& points, double wavelength, double half, double margin) {
  double product = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i].cast<double>();
    if (std::abs(p.x()) > half - margin || std::abs(p.y()) > half - margin) continue;
    const double wave_here = std::sin(kTau * p.x() / wavelength);
    product += wave_here * p.z();
    square += wave_here * wave_here;
  }
  return product / square;
}

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
                                static_cast<float>(scale), direction);
  REQUIRE(result.ok());
  CHECK(relative_error(static_cast<double>(result.value().scale), scale) < 0.001);
  return {amplitude(result.value().points, wavelength, kWidth / 2, 4.0 * scale) / height,
          result.value().iterations};
}

TEST_CASE("a wave is attenuated as by a Gaussian of that standard deviation") {
  for (const Sampling sampling : {Sampling::kJittered, Sampling::kRandom}) {
    for (const SmoothingDirection direction : {SmoothingDirection::kFree, SmoothingDirection::kAlongNormal}) {
      for (const double wavelength : {15.0, 24.0}) {
        constexpr double kScale = 4.0;
        const Run run = attenuate(sampling, 1.0, wavelength, kScale, direction);
        const double expected = std::exp(-0.5 * kTau * kTau * kScale * kScale / (wavelength * wavelength));
        const double effective = std::sqrt(std::log(run.attenuation) / std::log(expected));
        MESSAGE(std::string(sampling == Sampling::kRandom ? "random" : "jittered")
                << std::string(direction == SmoothingDirection::kFree ? ", free" : ", along normals")
                << ", wavelength " << wavelength << ": " << run.attenuation << ", expected " << expected
                << ", effective scale " << effective);
        // The amplitude within ten per cent where the wave is long. Where only a quarter of it is left,
        // clumps, which smooth less than the median, keep a little more of it: the scale is within nine per
        // cent still.
        CHECK(relative_error(effective, 1.0) < 0.1);
        if (wavelength > 20.0) CHECK(relative_error(run.attenuation, expected) < 0.10);
      }
    }
  }
}

TEST_CASE("a scale means the same at two densities") {
  const Run coarse = attenuate(Sampling::kRandom, 1.0, 20.0, 4.0, SmoothingDirection::kAlongNormal);
  const Run fine = attenuate(Sampling::kRandom, 0.7, 20.0, 4.0, SmoothingDirection::kAlongNormal);
  CHECK(fine.iterations > 3 * coarse.iterations / 2);
  CHECK(relative_error(fine.attenuation, coarse.attenuation) < 0.08);
}

TEST_CASE("scale 0 and clouds without neighbours stay as they are") {
  const Surface surface = sphere(500, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const auto zero = smooth_to_scale(surface.position, surface.normal, graph, 0.0F, SmoothingDirection::kFree);
  REQUIRE(zero.ok());
  CHECK(zero.value().points == surface.position);
  CHECK(zero.value().iterations == 0);
  const Points pile = identical(30, {1, 1, 1});
  const auto same =
      smooth_to_scale(pile, {}, build_neighbor_graph(pile, 10), 1.0F, SmoothingDirection::kFree);
  REQUIRE(same.ok());
  CHECK(same.value().points == pile);
}

TEST_CASE("a scale that is negative or not finite is refused") {
  const Surface surface = sphere(500, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  for (const float scale : {-1.0F, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    const auto result =
        smooth_to_scale(surface.position, surface.normal, graph, scale, SmoothingDirection::kFree);
    REQUIRE_FALSE(result.ok());
    CHECK(result.error().code == ErrorCode::kInvalidArgument);
    CHECK(result.error().field == "scale");
  }
}

TEST_CASE("a cloud that is too small for the scale is smoothed as far as it goes, and says how far") {
  const Surface surface = sphere(300, 1.0, Sampling::kRandom);
  const auto result =
      smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 10), 50.0F,
                      SmoothingDirection::kFree);
  REQUIRE(result.ok());
  CHECK(result.value().iterations < 1000);
  // All samples in one place: the variance of a unit sphere is 1, half of it an axis of a surface.
  CHECK(relative_error(static_cast<double>(result.value().scale), std::sqrt(0.5)) < 0.1);
  // From 3.5: what is left is a strand that the directed graph contracts last (0.66 measured).
  CHECK(bounds_of(result.value().points).diagonal() < 0.8F);
}

TEST_CASE("a scale that needs too many iterations is refused with the greatest that can be had") {
  const Surface surface = plane(12, 1.0, Sampling::kJittered);
  const auto result =
      smooth_to_scale(surface.position, surface.normal, build_neighbor_graph(surface.position, 4), 1e4F,
                      SmoothingDirection::kAlongNormal);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kInvalidArgument);
  CHECK(result.error().field == "scale");
  REQUIRE(result.error().limit.has_value());
  CHECK(*result.error().limit > 10.0);
  CHECK(*result.error().limit < 1e4);
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
  const auto result =
      smooth_to_scale(surface.position, surface.normal, graph, 40.0F, SmoothingDirection::kFree, &context);
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
      points =
          smooth_to_scale(surface.position, surface.normal, graph, 0.1F, SmoothingDirection::kAlongNormal)
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
