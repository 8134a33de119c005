#include "engine/spatial/radius_graph.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tests/support/all_machines.h"
#include "tests/support/random_points.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

RadiusGraph graph_of(const Points& points, float radius, std::uint32_t limit = 64) {
  auto graph = build_radius_graph(points, {.radius = radius, .limit = limit});
  REQUIRE(graph.ok());
  return std::move(graph).value();
}

struct Expected {
  std::vector<std::uint32_t> list;
  bool cut = false;
};

// All places but the sample's own within the radius, by distance, then index: at most `limit` of them.
Expected brute_force(const Points& points, std::size_t i, float radius, std::uint32_t limit) {
  std::vector<std::pair<float, std::uint32_t>> found;
  for (std::uint32_t j = 0; j < points.size(); ++j) {
    if (points[j] == points[i] || (j > 0 && points[j] == points[j - 1])) continue;
    const Vec3f e = points[i] - points[j];
    const float distance_sq = (e.x() * e.x() + e.y() * e.y()) + e.z() * e.z();
    if (distance_sq <= radius * radius) found.emplace_back(distance_sq, j);
  }
  std::sort(found.begin(), found.end());
  Expected result{.cut = found.size() > limit};
  for (const auto& [distance, j] : found) {
    if (result.list.size() < limit) result.list.push_back(j);
  }
  return result;
}

void check_against_brute_force(const Points& points, float radius, std::uint32_t limit) {
  const RadiusGraph graph = graph_of(points, radius, limit);
  REQUIRE(graph.count() == points.size());
  std::size_t wrong = 0;
  std::size_t cut = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Expected expected = brute_force(points, i, radius, limit);
    wrong += std::ranges::equal(graph.of(i), expected.list) ? 0U : 1U;
    cut += expected.cut ? 1U : 0U;
  }
  CHECK(wrong == 0);
  CHECK(graph.cut_count == cut);
  CHECK(graph.first.back() == graph.neighbors.size());
}

TEST_CASE("the radius graph lists what brute force finds, by distance, then index") {
  const Points points = coherent_random_points(2100, 3);
  for (const float radius : {1e-4F, 0.1F, 0.25F}) {
    CAPTURE(radius);
    check_against_brute_force(points, radius, 64);
  }
}

TEST_CASE("what exceeds the limit is cut to the nearest, and counted") {
  const Points points = coherent_random_points(1500, 4);
  for (const std::uint32_t limit : {1U, 7U, 20U}) {
    CAPTURE(limit);
    check_against_brute_force(points, 0.3F, limit);
  }
  const RadiusGraph all = graph_of(points, 10.0F, 1024);
  CHECK(all.cut_count == points.size());
  CHECK(all.neighbors.size() == points.size() * 1024);
}

TEST_CASE("a neighbour at exactly the radius counts, and ties go by index") {
  const Points lattice = plane(40, 1.0, Sampling::kRegular).position;
  for (const float radius : {1.0F, 2.0F, 3.0F}) {
    CAPTURE(radius);
    check_against_brute_force(lattice, radius, 64);
    check_against_brute_force(lattice, radius, 6);  // cuts among equal distances
  }
  const Points below = moved(plane(40, 1.0, Sampling::kRegular), {0.0, 0.0, 0.0}).position;
  CHECK(graph_of(below, std::nextafter(1.0F, 0.0F)).neighbors.empty());
}

TEST_CASE("duplicates have equal lists and never list each other") {
  Points points = coherent_random_points(900, 5);
  Random random(6);
  for (std::size_t i = 0; i < 300; ++i) points.set(random.below(900), points[random.below(900)]);
  points = coherent(points);
  check_against_brute_force(points, 0.3F, 64);
  check_against_brute_force(points, 0.3F, 3);
  const RadiusGraph graph = graph_of(points, 0.3F);
  CHECK(graph.duplicate_count > 100);
  for (std::size_t i = 1; i < points.size(); ++i) {
    if (points[i] == points[i - 1]) CHECK(std::ranges::equal(graph.of(i), graph.of(i - 1)));
  }
}

TEST_CASE("degenerate clouds have the lists that they can have") {
  CHECK(graph_of(Points{}, 1.0F).count() == 0);
  CHECK(graph_of(identical(1, {1, 2, 3}), 1.0F).of(0).empty());
  const RadiusGraph pile = graph_of(identical(100, {1, 2, 3}), 1.0F);
  CHECK(pile.count() == 100);
  CHECK(pile.neighbors.empty());
  CHECK(pile.duplicate_count == 99);
  const RadiusGraph pair = graph_of(from_list({{0, 0, 0}, {1, 0, 0}}), 1.0F);
  CHECK(pair.of(0).size() == 1);
  CHECK(pair.of(1)[0] == 0);
  CHECK(graph_of(from_list({{0, 0, 0}, {1, 0, 0}}), 0.5F).neighbors.empty());
  // A radius whose square is not finite takes in everything.
  CHECK(graph_of(from_list({{0, 0, 0}, {1, 0, 0}}), std::numeric_limits<float>::max()).of(0).size() == 1);
}

TEST_CASE("radii and limits out of range are refused by name") {
  const Points points = coherent_random_points(10, 1);
  for (const float radius : {0.0F, -1.0F, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    const auto graph = build_radius_graph(points, {.radius = radius});
    REQUIRE_FALSE(graph.ok());
    CHECK(graph.error().code == ErrorCode::kInvalidArgument);
    CHECK(graph.error().field == "radius");
  }
  for (const std::uint32_t limit : {0U, kMaxRadiusNeighbors + 1U}) {
    const auto graph = build_radius_graph(points, {.radius = 1.0F, .limit = limit});
    REQUIRE_FALSE(graph.ok());
    CHECK(graph.error().field == "limit");
    CHECK(graph.error().limit == doctest::Approx(kMaxRadiusNeighbors));
  }
}

TEST_CASE("the radius graph does not depend on threads or instruction sets") {
  const Points points = with_noise(torus(20'003, 1.0, 0.4, Sampling::kRandom), 0.003).position;
  for_all_machines([&] { return graph_of(points, 0.05F, 20); },
                   [](const RadiusGraph& one, const RadiusGraph& other) {
                     CHECK(one.cut_count > 0);
                     CHECK(other.first == one.first);
                     CHECK(other.neighbors == one.neighbors);
                     CHECK(other.cut_count == one.cut_count);
                   });
}

TEST_CASE("a cancelled radius graph is an error") {
  const ExecutionContext context;
  context.cancel();
  const auto graph = build_radius_graph(coherent_random_points(5000, 2), {.radius = 0.1F}, &context);
  REQUIRE_FALSE(graph.ok());
  CHECK(graph.error().code == ErrorCode::kCancelled);
}

}  // namespace
}  // namespace pointwright
