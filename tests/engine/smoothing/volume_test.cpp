// Figure 1: what the controls of shrinkage keep, on a noisy surface with a thin part.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/smoothing/global_volume.h"
#include "engine/smoothing/umbrella.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kPi = std::numbers::pi;

// Of a surface whose cross-sections along x are stars, from all its samples: pi times the integral of r^2.
// Independent of normals, areas and the sampling.
double volume_along_x(const Points& points) {
  std::vector<std::pair<double, double>> slices;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i].cast<double>();
    slices.emplace_back(p.x(), p.y() * p.y() + p.z() * p.z());
  }
  std::sort(slices.begin(), slices.end());
  double sum = 0.0;
  for (std::size_t i = 1; i < slices.size(); ++i) {
    sum += 0.5 * (slices[i].second + slices[i - 1].second) * (slices[i].first - slices[i - 1].first);
  }
  return kPi * sum;
}

// Two unit balls at x = -1.6 and 1.6 and a bar of radius 0.15 between them, evenly sampled.
struct Dumbbell {
  static constexpr double kCenter = 1.6;
  static constexpr double kBar = 0.15;

  static double radius(double x) {
    const double from_center = std::abs(x) - kCenter;
    const double ball_sq = std::max(0.0, 1.0 - from_center * from_center);
    if (from_center >= 0.0) return std::sqrt(ball_sq);
    return std::pow(std::pow(ball_sq, 4.0) + std::pow(kBar, 8.0), 0.125);
  }
};

Surface dumbbell(std::size_t count) {
  // By arc length: the profile's ends are vertical.
  constexpr std::size_t kSteps = 200'000;
  constexpr double kEnd = Dumbbell::kCenter + 1.0;
  const auto place = [](double t) { return -kEnd * std::cos(kPi * t); };
  std::vector<double> area(kSteps + 1, 0.0);
  for (std::size_t i = 1; i <= kSteps; ++i) {
    const double x0 = place(static_cast<double>(i - 1) / kSteps);
    const double x1 = place(static_cast<double>(i) / kSteps);
    const double r0 = Dumbbell::radius(x0);
    const double r1 = Dumbbell::radius(x1);
    area[i] = area[i - 1] + kPi * (r0 + r1) * std::hypot(x1 - x0, r1 - r0);
  }
  Surface surface{.position = Points(count), .normal = Points(count)};
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = area.back() * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const auto at =
        static_cast<std::size_t>(std::lower_bound(area.begin(), area.end(), wanted) - area.begin());
    const double x = place(static_cast<double>(at) / kSteps);
    const double slope = (Dumbbell::radius(x + 1e-6) - Dumbbell::radius(x - 1e-6)) / 2e-6;
    const double angle = kPi * (3.0 - std::sqrt(5.0)) * static_cast<double>(i);
    const Vec3d out(0.0, std::cos(angle), std::sin(angle));
    surface.position.set(i, (Vec3d(x, 0, 0) + Dumbbell::radius(x) * out).cast<float>());
    surface.normal.set(i, (out - Vec3d(slope, 0, 0)).normalized().cast<float>());
  }
  return coherent(surface);
}

double bar_radius(const Points& points) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i].cast<double>();
    if (std::abs(p.x()) > 0.3) continue;
    sum += std::hypot(p.y(), p.z());
    count += 1.0;
  }
  return sum / count;
}

// Of the balls, across the bar's axis.
double ball_radius(const Points& points) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i].cast<double>();
    if (std::abs(std::abs(p.x()) - Dumbbell::kCenter) > 0.1) continue;
    sum += std::hypot(p.y(), p.z());
    count += 1.0;
  }
  return sum / count;
}

Points smoothed(const Surface& surface, const NeighborGraph& graph, const UmbrellaParams& params) {
  auto result = smooth(surface.position, surface.normal, graph, params);
  REQUIRE(result.ok());
  return std::move(result).value();
}

TEST_CASE("Figure 1: a hundred iterations on a noisy dumbbell under each control of shrinkage") {
  // Spacing 0.02: a hundred plain steps have s^2 = 100 (k + 1) h^2 lambda / 4 pi, s = 0.13, and take a bar of
  // radius r down by exp(-s^2 / 2 r^2), here to 0.68. A compensated one is taken down by exp(-n lambda mu^2),
  // mu = s^2 / 2 r^2 / n lambda: to 0.997.
  const Surface noisy = with_noise(dumbbell(60'000), 0.003);
  const NeighborGraph graph = build_neighbor_graph(noisy.position, 10);
  const double volume = volume_along_x(noisy.position);
  const double bar = bar_radius(noisy.position);
  const double ball = ball_radius(noisy.position);
  struct Change {
    double volume, bar, ball;
  };
  const auto change = [&](VolumePreservation preserve) {
    const Points after = smoothed(noisy, graph, {.preserve = preserve, .iterations = 100});
    const Change result{volume_along_x(after) / volume - 1.0, bar_radius(after) / bar - 1.0,
                        ball_radius(after) / ball - 1.0};
    MESSAGE("volume " << 100.0 * result.volume << " %, bar " << 100.0 * result.bar << " %, balls "
                      << 100.0 * result.ball << " %");
    return result;
  };
  const Change none = change(VolumePreservation::kNone);
  CHECK(none.volume < -0.02);
  CHECK(none.bar < -0.25);
  const Change global = change(VolumePreservation::kGlobal);
  CHECK(std::abs(global.volume) < 0.003);
  CHECK(global.bar < -0.25);  // the whole is scaled: that does not bring a thin part back
  CHECK(global.ball > none.ball + 0.005);
  const Change local = change(VolumePreservation::kLocal);
  CHECK(std::abs(local.volume) < 0.003);
  CHECK(std::abs(local.bar) < 0.01);
  CHECK(std::abs(local.ball) < 0.003);
  const Change taubin = change(VolumePreservation::kTaubin);
  CHECK(std::abs(taubin.volume) < 0.005);
  CHECK(std::abs(taubin.bar) < 0.03);
}

TEST_CASE("global rescaling keeps the volume of a noisy sphere over a thousand iterations") {
  // Plain, a thousand steps take 30 % of it.
  for (const Sampling sampling : {Sampling::kRegular, Sampling::kRandom}) {
    for (const SmoothingDirection direction : {SmoothingDirection::kFree, SmoothingDirection::kAlongNormal}) {
      Surface noisy = moved(with_noise(sphere(20'000, 1.0, sampling), 0.005), {3.0, 0.0, 0.0});
      // The sides of the normals do not matter as long as they agree.
      for (std::size_t i = 0; i < noisy.size(); ++i) noisy.normal.set(i, -noisy.normal[i]);
      const NeighborGraph graph = build_neighbor_graph(noisy.position, 10);
      const std::uint32_t iterations = direction == SmoothingDirection::kFree ? 1000 : 100;
      const Points plain = smoothed(noisy, graph, {.direction = direction, .iterations = iterations});
      const Points kept = smoothed(
          noisy, graph,
          {.preserve = VolumePreservation::kGlobal, .direction = direction, .iterations = iterations});
      const double before = volume_along_x(noisy.position);
      MESSAGE("volume change " << 100.0 * (volume_along_x(plain) / before - 1.0) << " % without, "
                               << 100.0 * (volume_along_x(kept) / before - 1.0) << " % with rescaling");
      CHECK(volume_along_x(plain) < 0.96 * before);
      CHECK(relative_error(volume_along_x(kept), before) < 0.01);
    }
  }
}

TEST_CASE("global rescaling is a scaling of the plain result") {
  const Surface surface = torus(6'000, 1.0, 0.4, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const Points plain = smoothed(surface, graph, {.iterations = 25});
  const Points kept = smoothed(surface, graph, {.preserve = VolumePreservation::kGlobal, .iterations = 25});
  const double factor = static_cast<double>((kept[1] - kept[0]).norm() / (plain[1] - plain[0]).norm());
  CHECK(factor > 1.0);
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const Vec3d expected = factor * (plain[i] - plain[0]).cast<double>();
    CHECK(((kept[i] - kept[0]).cast<double>() - expected).norm() < 2e-5);
  }
}

TEST_CASE("global rescaling refuses what encloses no volume, and says why") {
  const auto error_of = [](const Surface& surface) {
    const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
    const auto result = smooth(surface.position, surface.normal, graph,
                               {.preserve = VolumePreservation::kGlobal, .iterations = 3});
    REQUIRE_FALSE(result.ok());
    CHECK(result.error().code == ErrorCode::kInvalidArgument);
    CHECK(result.error().field == "preserve");
    return result.error();
  };
  const Error open = error_of(hemisphere(3'000, 1.0));
  REQUIRE(open.actual.has_value());
  CHECK(relative_error(*open.actual, 0.5) < 0.05);
  CHECK(*open.limit < 0.2);
  CHECK_FALSE(error_of(plane(40, 1.0, Sampling::kJittered)).message.empty());
  // Nothing to smooth is nothing to keep.
  const Points pile = identical(20, {1, 2, 3});
  CHECK(smooth(pile, Points(20), build_neighbor_graph(pile, 10), {.preserve = VolumePreservation::kGlobal})
            .ok());
}

TEST_CASE("a small hole does not keep a surface from being rescaled") {
  // A cap of a fiftieth of the sphere is missing: the area vectors add up to about 0.02.
  const Surface whole = sphere(20'000, 1.0, Sampling::kRegular);
  std::vector<std::uint32_t> rest;
  for (std::uint32_t i = 0; i < whole.size(); ++i) {
    if (whole.position[i].z() < 0.96F) rest.push_back(i);
  }
  const Surface open{reordered(whole.position, rest), reordered(whole.normal, rest)};
  const NeighborGraph graph = build_neighbor_graph(open.position, 10);
  const Points kept = smoothed(open, graph, {.preserve = VolumePreservation::kGlobal, .iterations = 50});
  // All but the samples near the hole, which fall back from it.
  double radius = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (open.position[i].z() > 0.7F) continue;
    radius += static_cast<double>(kept[i].norm());
    count += 1.0;
  }
  CHECK(relative_error(radius / count, 1.0) < 0.01);
}

TEST_CASE("Taubin's steps take waves down by their transfer function") {
  // Plain steps measure the umbrella's eigenvalue of the wave: 1 - lambda k a step.
  constexpr double kWavelength = 16.0;
  const Surface surface = wave(160, 1.0, Sampling::kJittered, 0.1, kWavelength);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const auto amplitude = [&](const Points& points) {
    double product = 0.0;
    double square = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3d p = points[i].cast<double>();
      if (std::abs(p.x()) > 56.0 || std::abs(p.y()) > 56.0) continue;
      const double here = std::sin(2.0 * kPi * p.x() / kWavelength);
      product += here * p.z();
      square += here * here;
    }
    return product / square;
  };
  const double start = amplitude(surface.position);
  constexpr double kLambda = 0.5;
  constexpr std::uint32_t kIterations = 20;
  const Points plain = smoothed(surface, graph, {.iterations = kIterations});
  const double eigenvalue = (1.0 - std::pow(amplitude(plain) / start, 1.0 / kIterations)) / kLambda;
  for (const float pass_band : {0.02F, 0.05F, 0.1F}) {
    const auto mu = static_cast<double>(taubin_mu(0.5F, pass_band));
    CHECK(relative_error(1.0 / kLambda + 1.0 / mu, static_cast<double>(pass_band)) < 1e-4);
    const Points after = smoothed(
        surface, graph,
        {.preserve = VolumePreservation::kTaubin, .iterations = kIterations, .pass_band = pass_band});
    const double expected = std::pow((1.0 - kLambda * eigenvalue) * (1.0 - mu * eigenvalue), kIterations);
    MESSAGE("pass band " << pass_band << ": " << amplitude(after) / start << ", expected " << expected);
    CHECK(relative_error(amplitude(after) / start, expected) < 0.03);
  }
}

TEST_CASE("pass bands out of range and diverging pairs of steps are refused") {
  const auto field_of = [](const UmbrellaParams& params) { return validate(params).error().field; };
  CHECK(field_of({.pass_band = 0.0F}) == "pass_band");
  CHECK(field_of({.pass_band = 0.21F}) == "pass_band");
  CHECK(field_of({.pass_band = std::nanf("")}) == "pass_band");
  CHECK(field_of({.preserve = VolumePreservation::kTaubin, .lambda = 0.7F}) == "lambda");
  CHECK(validate(UmbrellaParams{.preserve = VolumePreservation::kTaubin, .lambda = 0.65F}).ok());
  CHECK(validate(UmbrellaParams{.preserve = VolumePreservation::kLocal, .lambda = 0.7F}).ok());
}

TEST_CASE("every control of shrinkage gives the same bytes for any thread count") {
  const Surface surface = with_noise(sphere(10'000, 1.0, Sampling::kRandom), 0.01);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  for (const VolumePreservation preserve : {VolumePreservation::kNone, VolumePreservation::kLocal,
                                            VolumePreservation::kGlobal, VolumePreservation::kTaubin}) {
    const auto run = [&](int threads) {
      Points result;
      with_threads(threads,
                   [&] { result = smoothed(surface, graph, {.preserve = preserve, .iterations = 12}); });
      return result;
    };
    const Points one = run(1);
    CHECK(run(2) == one);
    CHECK(run(8) == one);
  }
}

TEST_CASE("controls of shrinkage survive degenerate clouds") {
  for (const Points& points :
       {identical(50, {1, 2, 3}), collinear(100, {0, 0, 0}, {1, 2, 3}), from_list({{0, 0, 0}, {1, 0, 0}}),
        from_list({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})}) {
    const NeighborGraph graph = build_neighbor_graph(points, 10);
    Points normals(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) normals.set(i, {0, 0, 1});
    const auto taubin =
        smooth(points, {}, graph, {.preserve = VolumePreservation::kTaubin, .iterations = 20});
    REQUIRE(taubin.ok());
    CHECK(all_finite(taubin.value()));
    const auto global =
        smooth(points, normals, graph, {.preserve = VolumePreservation::kGlobal, .iterations = 20});
    if (global.ok()) {
      CHECK(all_finite(global.value()));
    } else {
      CHECK(global.error().field == "preserve");
    }
  }
}

}  // namespace
}  // namespace pointwright
