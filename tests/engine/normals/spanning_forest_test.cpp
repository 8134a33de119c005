#include "engine/normals/spanning_forest.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "engine/normals/estimation.h"
#include "tests/support/all_machines.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

struct Edge {
  std::uint32_t weight = 0;
  // Among equal weights: region by region, the edges that leave it before those inside.
  std::size_t region = 0;
  bool inside = false;
  std::size_t sequence = 0;
  std::uint32_t a = 0, b = 0;
  bool opposed = false;

  [[nodiscard]] auto key() const { return std::tuple(weight, region, inside, sequence); }
};

Edge weighed(const Points& points, const Points& normals, std::uint32_t a, std::uint32_t b) {
  const Vec3f e = points[b] - points[a];
  const auto dot = [](const Vec3f& u, const Vec3f& v) {
    return u.x() * v.x() + u.y() * v.y() + u.z() * v.z();
  };
  const float along = dot(e, normals[a]) * dot(e, normals[b]);
  const float agreement = dot(normals[a], normals[b]) - 2.0F * along / std::max(dot(e, e), 1e-30F);
  const float weight = std::sqrt(std::clamp(1.0F - std::abs(agreement), 0.0F, 1.0F)) * 2047.0F;
  return {.weight = static_cast<std::uint32_t>(weight), .a = a, .b = b, .opposed = agreement < 0.0F};
}

// Kruskal's algorithm on all edges at once, in one order; sides by walking the tree from each first sample.
SidedForest reference_forest(const Points& points, const NeighborGraph& graph, const Points& normals) {
  const auto n = static_cast<std::uint32_t>(points.size());
  const auto lists = [&](std::uint32_t i, std::uint32_t neighbor) {
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      if (graph.index(i, j) == neighbor) return true;
    }
    return false;
  };
  std::vector<Edge> edges;
  for (std::uint32_t i = 0; i < n; ++i) {
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::size_t sequence) {
      Edge edge = weighed(points, normals, a, b);
      edge.region = i / kSpanRegion;
      edge.inside = a / kSpanRegion == b / kSpanRegion;
      edge.sequence = sequence;
      edges.push_back(edge);
    };
    if (i > 0 && points[i] == points[i - 1]) add(i - 1, i, i % kSpanRegion == 0 ? 0 : i);
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      const std::uint32_t b = graph.index(i, j);
      if (i > b && lists(b, i)) continue;
      const bool inside = i / kSpanRegion == b / kSpanRegion;
      // Duplicates come first; edges that leave a region by rows of the graph, those inside by samples.
      add(i, b,
          n + (inside ? std::size_t{i} * graph.k + j
                      : (i / kSimdBlock * graph.k + j) * kSimdBlock + i % kSimdBlock));
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) { return x.key() < y.key(); });

  std::vector<std::uint32_t> set(n);
  std::iota(set.begin(), set.end(), 0U);
  const auto find = [&](std::uint32_t i) {
    while (set[i] != i) i = set[i] = set[set[i]];
    return i;
  };
  std::vector<std::vector<std::pair<std::uint32_t, bool>>> tree(n);
  for (const Edge& edge : edges) {
    if (find(edge.a) == find(edge.b)) continue;
    set[find(edge.a)] = find(edge.b);
    tree[edge.a].emplace_back(edge.b, edge.opposed);
    tree[edge.b].emplace_back(edge.a, edge.opposed);
  }
  SidedForest forest{.root = std::vector<std::uint32_t>(n, n), .opposed = std::vector<std::uint8_t>(n, 0)};
  for (std::uint32_t first = 0; first < n; ++first) {
    if (forest.root[first] != n) continue;
    forest.root[first] = first;
    std::vector<std::uint32_t> stack{first};
    while (!stack.empty()) {
      const std::uint32_t i = stack.back();
      stack.pop_back();
      for (const auto& [to, opposed] : tree[i]) {
        if (forest.root[to] != n) continue;
        forest.root[to] = first;
        forest.opposed[to] = static_cast<std::uint8_t>(forest.opposed[i] ^ (opposed ? 1U : 0U));
        stack.push_back(to);
      }
    }
  }
  return forest;
}

Points random_normals(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Points normals(count);
  for (std::size_t i = 0; i < count; ++i) normals.set(i, random.direction().cast<float>());
  return normals;
}

// The trees of many regions are those of one: on noise, where nearly every cycle is inconsistent and another
// tree means other sides; on surfaces, in pieces, and with duplicates across the borders of regions.
void check_against_reference(const Points& points, const Points& normals, std::uint32_t k = 10) {
  const NeighborGraph graph = build_neighbor_graph(points, k);
  const SidedForest expected = reference_forest(points, graph, normals);
  const SidedForest found = span_normals(points, graph, normals);
  CHECK(found.root == expected.root);
  CHECK(found.opposed == expected.opposed);
}

TEST_CASE("regions spanned at the same time make the forest of one Kruskal run over all edges") {
  SUBCASE("random normals, several regions") {
    const Points points = torus(40'000, 1.0, 0.4, Sampling::kRandom).position;
    check_against_reference(points, random_normals(points.size(), 1));
    check_against_reference(points, random_normals(points.size(), 2), 17);
  }
  SUBCASE("estimated normals of a noisy surface") {
    const Points points = with_noise(torus(40'000, 1.0, 0.4, Sampling::kRandom), 0.01).position;
    Points normals;
    estimate_normals(points, build_neighbor_graph(points, 10), {}, normals);
    check_against_reference(points, normals);
  }
  SUBCASE("equal weights everywhere") {
    const Surface flat = plane(150, 1.0, Sampling::kRegular);
    check_against_reference(flat.position, scrambled_signs(flat.normal, 3));
  }
  SUBCASE("many components") {
    std::vector<Surface> parts;
    for (std::size_t part = 0; part < 60; ++part) {
      parts.push_back(moved(sphere(20 + 13 * part, 0.4, Sampling::kRandom, part),
                            {static_cast<double>(part % 8), static_cast<double>(part / 8), 0.0}));
    }
    const Points points = joined(parts).position;
    check_against_reference(points, random_normals(points.size(), 4));
  }
  SUBCASE("duplicates with normals of their own") {
    const Surface ball = sphere(6'000, 1.0, Sampling::kRandom);
    const Points points = joined({ball, ball, ball}).position;
    check_against_reference(points, random_normals(points.size(), 5));
  }
  SUBCASE("few samples") {
    for (const std::size_t n : {1U, 2U, 3U, 17U}) {
      const Points points = sphere(n, 1.0, Sampling::kRandom).position;
      check_against_reference(points, random_normals(n, n));
    }
    check_against_reference(identical(40, {1, 2, 3}), random_normals(40, 6));
  }
}

TEST_CASE("the forest does not depend on threads or instruction sets") {
  const Points points = torus(40'003, 1.0, 0.4, Sampling::kRandom).position;
  const Points normals = random_normals(points.size(), 7);
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  for_all_machines([&] { return span_normals(points, graph, normals); },
                   [](const SidedForest& one, const SidedForest& other) {
                     CHECK(other.root == one.root);
                     CHECK(other.opposed == one.opposed);
                   });
}

TEST_CASE("a cancelled forest is empty") {
  const Points points = sphere(1000, 1.0, Sampling::kRandom).position;
  const ExecutionContext context;
  context.cancel();
  CHECK(
      span_normals(points, build_neighbor_graph(points, 10), random_normals(1000, 8), &context).root.empty());
}

}  // namespace
}  // namespace pointwright
