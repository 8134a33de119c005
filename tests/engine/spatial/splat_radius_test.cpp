#include "engine/spatial/splat_radius.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/core/parallel.h"
#include "engine/spatial/kd_tree.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

std::vector<float> radii_of(const Surface& surface) {
  return splat_radii(surface.position, surface.normal, build_neighbor_graph(surface.position, 10));
}

double mean(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// The part of `places` that no disc covers.
double uncovered(const Surface& surface, const std::vector<float>& radius, const Points& places) {
  const KdTree tree(surface.position);
  std::vector<Neighbor> near;
  std::size_t open = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    tree.nearest(places[i], 32, near);
    const bool covered = std::any_of(near.begin(), near.end(), [&](const Neighbor& neighbor) {
      return (places[i] - surface.position[neighbor.index]).norm() <= radius[neighbor.index];
    });
    open += covered ? 0 : 1;
  }
  return static_cast<double>(open) / static_cast<double>(places.size());
}

TEST_CASE(
    "on a square lattice the radius is that of the closest or the diagonal neighbours, also at the rim") {
  const Surface lattice = plane(40, 0.5, Sampling::kRegular);
  const auto radius = radii_of(lattice);
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    const Vec3f p = lattice.position[i];
    const bool inside = std::max(std::abs(p.x()), std::abs(p.y())) < 9.0F;
    // Where the tangents lie along the lattice, a half-open quadrant may hold a diagonal neighbour alone.
    if (inside) CHECK(radius[i] >= 0.899F * 0.5F);
    if (inside) CHECK(radius[i] <= 0.901F * 0.5F * std::sqrt(2.0F));
    // A corner's tenth neighbour is three spacings away; half of it counts.
    CHECK(radius[i] <= 0.9F * 1.51F * 0.5F);
  }
}

TEST_CASE("the discs of randomly sampled surfaces close them, at any density") {
  for (const std::size_t count : {5'000U, 40'000U}) {
    const Surface random = sphere(count, 1.0, Sampling::kRandom, 3);
    const Surface places = sphere(100'000, 1.0, Sampling::kRegular);
    const auto radius = radii_of(random);
    const double spacing = std::sqrt(4.0 * 3.14159265358979 / static_cast<double>(count));
    CHECK(uncovered(random, radius, places.position) < 1e-3);
    // One radius for all samples leaves more than fifty times as much open at the same mean.
    const std::vector<float> same(count, static_cast<float>(mean(radius)));
    CHECK(uncovered(random, same, places.position) > 50 * uncovered(random, radius, places.position));
    CHECK(mean(radius) < 1.6 * spacing);
  }
}

TEST_CASE("the discs of each side close a thin sheet, however near the other side lies") {
  constexpr std::size_t kSide = 150;
  for (const double gap : {0.1, 0.5, 1.0}) {
    const Surface sheets = parallel_sheets(kSide, 1.0, gap, Sampling::kRandom, 7);
    const auto radius = radii_of(sheets);
    std::vector<Vec3f> top;
    std::vector<float> top_radius;
    for (std::size_t i = 0; i < sheets.size(); ++i) {
      if (sheets.normal[i].z() < 0.0F) continue;
      top.push_back(sheets.position[i]);
      top_radius.push_back(radius[i]);
    }
    REQUIRE(top.size() == kSide * kSide);
    // Inside, where no rim is near.
    std::vector<Vec3f> places;
    const Surface fine = plane(2 * (kSide - 12), 0.5, Sampling::kRegular);
    for (std::size_t i = 0; i < fine.size(); ++i) {
      places.push_back(fine.position[i] + Vec3f(0.0F, 0.0F, static_cast<float>(0.5 * gap)));
    }
    CHECK(uncovered({.position = from_list(top), .normal = {}}, top_radius, from_list(places)) < 1e-3);
    CHECK(mean(top_radius) < 1.6);
  }
}

TEST_CASE("an outlier gets no larger disc than three times the median around it") {
  const Surface ball = sphere(5'000, 1.0, Sampling::kRegular);
  const float usual = static_cast<float>(mean(radii_of(ball)));
  const Surface outlier{.position = from_list({Vec3f(0, 0, 9)}), .normal = from_list({Vec3f(0, 0, 1)})};
  const Surface both = joined({ball, outlier});
  const auto radius = radii_of(both);
  for (std::size_t i = 0; i < both.size(); ++i) CHECK(radius[i] < 4.0F * usual);
}

TEST_CASE("degenerate sets: none, one, identical, collinear, normals of length zero") {
  CHECK(radii_of({}).empty());
  for (const Points& points : {from_list({Vec3f(1, 2, 3)}), identical(20, Vec3f(1, 2, 3))}) {
    const Surface surface{.position = points, .normal = Points(points.size())};
    for (const float value : radii_of(surface)) CHECK(value == 0.0F);
  }
  const Points line = collinear(50, Vec3f(0, 0, 0), Vec3f(49, 0, 0));
  for (const float value : radii_of({.position = line, .normal = Points(line.size())})) {
    CHECK(std::isfinite(value));
    CHECK(value > 0.0F);
  }
}

TEST_CASE("splat radii are the same with 1, 2 and 8 threads") {
  const Surface random = torus(20'000, 1.0, 0.3, Sampling::kRandom, 5);
  const NeighborGraph graph = build_neighbor_graph(random.position, 10);
  std::vector<std::vector<float>> results;
  for (const int threads : {1, 2, 8}) {
    with_threads(threads, [&] { results.push_back(splat_radii(random.position, random.normal, graph)); });
  }
  CHECK(results[0] == results[1]);
  CHECK(results[0] == results[2]);
}

}  // namespace
}  // namespace pointwright
