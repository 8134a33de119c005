#include "tests/support/surface_distance.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// Points at this height over the middle of a plane of side x side samples.
Points above(std::size_t side, double height) {
  const Surface lifted = moved(plane(side, 0.01, Sampling::kRandom, 5), {0.0, 0.0, height});
  return lifted.position;
}

TEST_CASE("distances are summed up as mean, root mean square and maximum") {
  const DistanceSummary summary = summarized({3.0, 0.0, 4.0, 1.0});
  CHECK(summary.mean == 2.0);
  CHECK(summary.rms == std::sqrt(26.0 / 4.0));
  CHECK(summary.max == 4.0);
  CHECK(summarized({}).max == 0.0);
}

TEST_CASE("a known surface is asked as it is") {
  const Surface surface = sphere(1'000, 1.5, Sampling::kRandom);
  const auto distance = distances_to(surface.position, [](const Vec3d& p) { return 1.0 - p.norm(); });
  for (const double d : distance) CHECK(d == doctest::Approx(0.5).epsilon(1e-6));
}

// Distances of the originals to samples that stand for them.
std::vector<double> disc_distances(const Surface& originals, const Points& samples) {
  const Discs discs = discs_over(samples, originals.position, originals.normal);
  return distances_to_discs(originals.position, originals.normal, samples, discs);
}

TEST_CASE("from a plane both measures are the height, on whatever side its normals are") {
  Surface surface = plane(60, 0.01, Sampling::kRandom);
  surface.normal = scrambled_signs(surface.normal, 3);
  for (const double height : {0.0, 0.003, -0.02}) {
    const Points others = above(20, height);
    const double exact = std::abs(static_cast<double>(static_cast<float>(height)));
    for (const double d : disc_distances(surface, others)) CHECK(std::abs(d - exact) < 1e-9);
    for (const double d : distances_to_quadratic_fit(others, surface.position)) {
      CHECK(std::abs(d - exact) < 1e-9);
    }
  }
}

TEST_CASE("samples of one face of a cube are not held against its others") {
  const Surface surface = cube(60, 1.0);
  const Surface sparse = cube(7, 1.0, 9);
  const Discs own = discs_over(sparse.position, surface.position, surface.normal);
  const Discs exact{sparse.normal, own.radius};
  const auto distance = distances_to_discs(surface.position, surface.normal, sparse.position, exact);
  CHECK(summarized(distance).mean < 1e-9);
}

TEST_CASE("an uneven set has no holes") {
  // Dense on one half of a plane, sparse on the other, a step of the height between them.
  const Surface surface = plane(100, 0.01, Sampling::kRandom);
  std::vector<Vec3f> places;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if (surface.position[i].x() < 0.0F || i % 50 == 0) places.push_back(surface.position[i]);
  }
  const Points samples = from_list(places);
  const Discs discs = discs_over(samples, surface.position, surface.normal);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const bool reached = [&] {
      for (std::size_t j = 0; j < samples.size(); ++j) {
        const auto away = static_cast<double>((surface.position[i] - samples[j]).norm());
        if (away < discs.radius[j] || away == 0.0) return true;
      }
      return false;
    }();
    REQUIRE(reached);
  }
}

TEST_CASE("tangent planes of a sphere lie outside of it by half the squared distance to their samples") {
  // n_j . (p - q_j) = -|p - q_j|^2 / 2 R for p and q_j on the sphere, so the blend is known.
  const double radius = 2.0;
  const Surface coarse = sphere(300, radius, Sampling::kRandom);
  const Surface dense = sphere(2'001, radius, Sampling::kRandom, 9);
  const Discs discs{coarse.normal, discs_over(coarse.position, dense.position, dense.normal).radius};
  const auto found = distances_to_discs(dense.position, dense.normal, coarse.position, discs);
  for (std::size_t i = 0; i < dense.size(); ++i) {
    double sum = 0.0;
    double weights = 0.0;
    for (std::size_t j = 0; j < coarse.size(); ++j) {
      const auto square = static_cast<double>((dense.position[i] - coarse.position[j]).squaredNorm());
      const double reach = discs.radius[j] * discs.radius[j];
      if (square >= reach) continue;
      const double facing = 1.0 - square / (2.0 * radius * radius);
      const double weight = std::pow(1.0 - square / reach, 4) / reach * facing * facing;
      sum += weight * square / (2.0 * radius);
      weights += weight;
    }
    REQUIRE(found[i] == doctest::Approx(sum / weights).epsilon(1e-3));
  }
}

TEST_CASE("a quadratic fit is on the sphere to fourth order, and as far off it as the query is") {
  const double radius = 1.0;
  double error[2] = {};
  for (const int finer : {0, 1}) {
    const Surface dense = sphere(finer != 0 ? 16'000 : 4'000, radius, Sampling::kRegular);
    for (const double offset : {0.0, 0.004, -0.004}) {
      const Surface queries = sphere(3'001, radius + offset, Sampling::kRandom);
      for (const double d : distances_to_quadratic_fit(queries.position, dense.position)) {
        error[finer] = std::max(error[finer], std::abs(d - std::abs(offset)));
      }
    }
  }
  CHECK(error[0] < 2e-4);
  CHECK(error[1] < error[0] / 8.0);  // to floats: 16 in exact numbers
}

TEST_CASE("few samples, samples in a line and in one place have distances") {
  const Vec3f up{0.0F, 0.0F, 1.0F};
  const Points query = identical(1, {0.5F, 0.0F, 2.0F});
  const Surface original{query, identical(1, up)};
  for (const std::size_t copies : {1, 40}) {
    CHECK(disc_distances(original, identical(copies, {0.0F, 0.0F, 0.0F}))[0] == doctest::Approx(2.0));
    CHECK(disc_distances(original, identical(copies, query[0]))[0] == 0.0);
  }
  // A disc that only planes at a right angle reach.
  const Discs upright{identical(1, {1.0F, 0.0F, 0.0F}), {5.0}};
  CHECK(distances_to_discs(query, identical(1, up), identical(1, {0.0F, 0.0F, 0.0F}), upright)[0] == 0.5);
  CHECK(distances_to_quadratic_fit(query, identical(40, {0.5F, 0.0F, 0.0F}))[0] == doctest::Approx(2.0));
  CHECK(distances_to_quadratic_fit(query, identical(1, {0.5F, 0.0F, 0.0F}))[0] == doctest::Approx(2.0));
  const Points line = collinear(50, {0.5F, 0.0F, -1.0F}, {0.5F, 0.0F, 1.0F});
  CHECK(std::isfinite(distances_to_quadratic_fit(query, line)[0]));
  const Points triangle = from_list({{0.0F, 0.0F, 1.0F}, {1.0F, 0.0F, 1.0F}, {0.0F, 1.0F, 1.0F}});
  CHECK(distances_to_quadratic_fit(query, triangle)[0] == doctest::Approx(1.0));
  CHECK(disc_distances({}, triangle).empty());
}

TEST_CASE("distances do not depend on the number of threads") {
  const Surface dense = torus(5'000, 1.0, 0.4, Sampling::kRandom);
  const Surface coarse = torus(700, 1.0, 0.4, Sampling::kRandom, 2);
  const auto discs = disc_distances(dense, coarse.position);
  const auto fits = distances_to_quadratic_fit(coarse.position, dense.position);
  with_threads(1, [&] {
    CHECK(disc_distances(dense, coarse.position) == discs);
    CHECK(distances_to_quadratic_fit(coarse.position, dense.position) == fits);
  });
}

}  // namespace
}  // namespace pointwright
