#include "engine/spatial/neighbor_graph.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <string>

#include "engine/core/parallel.h"
#include "tests/support/all_machines.h"
#include "tests/support/random_points.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// The distances from sample i to all distinct positions but its own, ascending.
std::vector<float> brute_force_distances(const Points& points, std::size_t i) {
  std::vector<float> result;
  for (std::size_t j = 0; j < points.size(); ++j) {
    if (points[j] == points[i] || (j > 0 && points[j] == points[j - 1])) continue;
    const Vec3f e = points[i] - points[j];
    result.push_back((e.x() * e.x() + e.y() * e.y()) + e.z() * e.z());
  }
  std::sort(result.begin(), result.end());
  return result;
}

// Every list: the nearest by exact distance, no repeats, never the sample or one that stands where it stands.
std::size_t count_wrong_lists(const Points& points, const NeighborGraph& graph) {
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto expected = brute_force_distances(points, i);
    std::set<std::uint32_t> seen;
    bool right = true;
    float last = 0.0F;
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      const std::uint32_t q = graph.index(i, j);
      const Vec3f e = points[i] - points[q];
      const float distance_sq = (e.x() * e.x() + e.y() * e.y()) + e.z() * e.z();
      right = right && q < points.size() && points[q] != points[i] && seen.insert(q).second &&
              distance_sq == expected[j] && distance_sq >= last;
      if (j > 0 && distance_sq == last) right = right && q > graph.index(i, j - 1);
      last = distance_sq;
    }
    wrong += right ? 0 : 1;
  }
  return wrong;
}

TEST_CASE("the graph lists the neighbours that brute force finds") {
  for (const std::uint32_t k : {1U, 4U, 10U, 32U}) {
    CAPTURE(k);
    const Points points = coherent_random_points(1500, k);
    const NeighborGraph graph = build_neighbor_graph(points, k);
    CHECK(graph.count == 1500);
    CHECK(graph.k == k);
    CHECK(graph.duplicate_count == 0);
    CHECK(count_wrong_lists(points, graph) == 0);
  }
}

TEST_CASE("on a lattice full of ties the lists are still the nearest, in order of index") {
  const Points points = plane(40, 1.0, Sampling::kRegular).position;
  for (const std::uint32_t k : {4U, 6U, 10U}) {
    CAPTURE(k);
    CHECK(count_wrong_lists(points, build_neighbor_graph(points, k)) == 0);
  }
}

TEST_CASE("duplicates share one list and never list each other") {
  Points points = coherent_random_points(800, 21);
  Random random(22);
  for (std::size_t i = 0; i < 300; ++i) points.set(random.below(800), points[random.below(800)]);
  points = coherent(points);
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  CHECK(graph.duplicate_count > 100);
  CHECK(count_wrong_lists(points, graph) == 0);
  std::size_t pairs = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    if (points[i] != points[i - 1]) continue;
    ++pairs;
    for (std::uint32_t j = 0; j < graph.k; ++j) CHECK(graph.index(i, j) == graph.index(i - 1, j));
  }
  CHECK(pairs == graph.duplicate_count);
}

TEST_CASE("duplicates that stand apart in the order count as samples of their own") {
  Points points = coherent_random_points(400, 23);
  for (std::size_t i = 0; i < 100; ++i) points.set(i + 200, points[i]);
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  CHECK(graph.duplicate_count == 0);
  for (std::size_t i = 0; i < 100; ++i) {
    CHECK(graph.index(i, 0) == i + 200);
    CHECK(graph.index(i + 200, 0) == i);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::uint32_t j = 0; j < graph.k; ++j) CHECK(graph.index(i, j) != i);
  }
  CHECK(build_neighbor_graph(coherent(points), 10).duplicate_count == 100);
}

TEST_CASE("a cloud with fewer samples than neighbours asked for lists all the others") {
  for (const std::size_t n : {1U, 2U, 3U, 10U, 11U}) {
    CAPTURE(n);
    const Points points = coherent_random_points(n, n);
    const NeighborGraph graph = build_neighbor_graph(points, 10);
    CHECK(graph.k == std::min<std::size_t>(10, n - 1));
    CHECK(count_wrong_lists(points, graph) == 0);
  }
  CHECK(build_neighbor_graph(Points{}, 10).count == 0);
  CHECK(build_neighbor_graph(coherent_random_points(20, 1), 0).k == 0);
}

TEST_CASE("samples that all stand in one place have no neighbours") {
  const Points points = identical(100, {1, 1, 1});
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  CHECK(graph.k == 0);
  CHECK(graph.duplicate_count == 99);
  for (const float h : local_spacing(points, graph)) CHECK(h == 0.0F);
}

TEST_CASE("a huge pile of identical samples costs no more than other samples") {
  const Surface pile{identical(60'000, {0.1F, 0.2F, 0.3F}), identical(60'000, {0, 0, 1})};
  const Surface rest{coherent_random_points(2000, 31), identical(2000, {0, 0, 1})};
  const Points points = joined({pile, rest}).position;
  const auto start = std::chrono::steady_clock::now();
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  // Milliseconds when the pile enters the tree once; minutes when every search near it visits all of it.
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(3));
  CHECK(graph.k == 10);
  CHECK(graph.duplicate_count == 59'999);
}

TEST_CASE("padding lanes point at sample 0") {
  const Points points = coherent_random_points(21, 5);
  const NeighborGraph graph = build_neighbor_graph(points, 4);
  REQUIRE(graph.lanes.size() == 32 * 4);
  for (std::uint32_t j = 0; j < 4; ++j) {
    for (std::size_t lane = 5; lane < kSimdBlock; ++lane) CHECK(graph.row(1, j)[lane] == 0);
    CHECK(graph.row(1, j)[2] == graph.index(18, j));
  }
}

TEST_CASE("the graph does not depend on the threads") {
  const Points points = coherent_random_points(20'000, 6);
  NeighborGraph one;
  with_threads(1, [&] { one = build_neighbor_graph(points, 10); });
  for (const int threads : {2, 8}) {
    with_threads(threads, [&] { CHECK(build_neighbor_graph(points, 10).lanes == one.lanes); });
  }
}

TEST_CASE("clouds that fill their boxes in every way have the lists of brute force") {
  // Around whole blocks of samples, and around whole blocks of those.
  for (const std::size_t n : {15U, 16U, 17U, 32U, 33U, 255U, 256U, 257U, 4097U}) {
    CAPTURE(n);
    const Points points = coherent_random_points(n, n);
    CHECK(count_wrong_lists(points, build_neighbor_graph(points, 8)) == 0);
  }
  // Lists longer than a block, and nearly as long as the cloud.
  const Points few = coherent_random_points(300, 12);
  for (const std::uint32_t k : {17U, 48U, 100U, 298U, 299U}) {
    CAPTURE(k);
    CHECK(count_wrong_lists(few, build_neighbor_graph(few, k)) == 0);
  }
}

TEST_CASE("outliers, clusters, lines and any order have the lists of brute force") {
  Random random(13);
  Points clusters(2000);
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    const double size = std::pow(10.0, -static_cast<double>(i % 5));
    const Vec3d center = 10.0 * Vec3d(static_cast<double>(i % 7), static_cast<double>(i % 3), 0.0);
    clusters.set(i, (center + size * random.direction()).cast<float>());
  }
  Points outliers = coherent_random_points(2000, 14);
  for (std::size_t i = 0; i < 2000; i += 97) outliers.set(i, (1000.0 * random.direction()).cast<float>());
  outliers = coherent(outliers);
  Points unordered = coherent_random_points(2000, 15);
  for (std::size_t i = 0; i < 1000; ++i) {
    const Vec3f here = unordered[i];
    const std::size_t other = random.below(2000);
    unordered.set(i, unordered[other]);
    unordered.set(other, here);
  }
  for (const Points& points : {coherent(clusters), outliers, unordered, collinear(1500, {0, 0, 0}, {1, 2, 3}),
                               moved(sphere(1500, 1.0, Sampling::kRandom), {1e6, -1e6, 1e6}).position,
                               parallel_sheets(25, 1.0, 0.1, Sampling::kJittered).position}) {
    CHECK(count_wrong_lists(points, build_neighbor_graph(points, 10)) == 0);
  }
}

TEST_CASE("every instruction set finds the same graph") {
  Points points = with_noise(torus(20'003, 1.0, 0.4, Sampling::kRandom), 0.003).position;
  for (std::size_t i = 0; i < 2000; ++i) points.set(7 * i + 1, points[7 * i]);
  points = coherent(points);
  for_all_machines([&] { return build_neighbor_graph(points, 10).lanes; },
                   [](const auto& one, const auto& other) { CHECK(other == one); });
}

TEST_CASE("a cancelled graph returns at once") {
  const ExecutionContext context;
  context.cancel();
  const Points points = coherent_random_points(60'000, 7);
  const auto start = std::chrono::steady_clock::now();
  (void)build_neighbor_graph(points, 32, &context);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(1));
}

TEST_CASE("local spacing is the square root of the area per sample") {
  struct Case {
    std::string name;
    Sampling sampling;
    double tolerance;
  };
  // The median over many samples, away from the border. On a lattice r_10 is always 2 h, which is 9 % too
  // much; of random samples the median of r_k^2 is (k - 1/3) h^2 / pi, which makes h 4 % too small.
  for (const Case& c :
       {Case{"regular", Sampling::kRegular, 0.10}, Case{"jittered", Sampling::kJittered, 0.04},
        Case{"random", Sampling::kRandom, 0.06}}) {
    for (const double spacing : {0.01, 3.0}) {
      CAPTURE(c.name);
      CAPTURE(spacing);
      const Points points = plane(80, spacing, c.sampling).position;
      const std::vector<float> all = local_spacing(points, build_neighbor_graph(points, 10));
      std::vector<float> inner;
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i].cwiseAbs().maxCoeff() < static_cast<float>(36.0 * spacing)) inner.push_back(all[i]);
      }
      const auto middle = inner.begin() + static_cast<std::ptrdiff_t>(inner.size() / 2);
      std::nth_element(inner.begin(), middle, inner.end());
      CHECK(relative_error(static_cast<double>(*middle), spacing) < c.tolerance);
    }
  }
}

TEST_CASE("local spacing follows the density, whatever k") {
  // Half the spacing right of x = 0: the medians of the halves differ by two.
  const Points sparse = moved(plane(40, 2.0, Sampling::kJittered), {-60.0, 0.0, 0.0}).position;
  const Points dense = moved(plane(80, 1.0, Sampling::kJittered), {60.0, 0.0, 0.0}).position;
  for (const std::uint32_t k : {6U, 10U, 16U}) {
    CAPTURE(k);
    double mean[2];
    int side = 0;
    for (const Points& points : {sparse, dense}) {
      const auto spacing = local_spacing(points, build_neighbor_graph(points, k));
      double sum = 0.0;
      for (const float h : spacing) sum += static_cast<double>(h);
      mean[side++] = sum / static_cast<double>(spacing.size());
    }
    CHECK(relative_error(mean[0] / mean[1], 2.0) < 0.05);
  }
}

}  // namespace
}  // namespace pointwright
