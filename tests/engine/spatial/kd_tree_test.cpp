#include "engine/spatial/kd_tree.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <numeric>

#include "tests/support/random_points.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// side^3 whole-numbered points: every distance has ties, and squares are exact in float.
Points lattice(int side) {
  Points points(static_cast<std::size_t>(side * side * side));
  std::size_t i = 0;
  for (int z = 0; z < side; ++z) {
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        points.set(i++, {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
      }
    }
  }
  return coherent(points);
}

// Everything by distance, then index. The same float operations in the same order as a left-to-right sum.
std::vector<Neighbor> brute_force(const Points& points, const Vec3f& query) {
  std::vector<Neighbor> all;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Vec3f e = query - points[i];
    all.push_back({i, (e.x() * e.x() + e.y() * e.y()) + e.z() * e.z()});
  }
  std::sort(all.begin(), all.end());
  return all;
}

bool same(const std::vector<Neighbor>& found, const std::vector<Neighbor>& expected, std::size_t count) {
  if (found.size() != std::min(count, expected.size())) return false;
  for (std::size_t j = 0; j < found.size(); ++j) {
    if (found[j].index != expected[j].index || found[j].distance_sq != expected[j].distance_sq) return false;
  }
  return true;
}

TEST_CASE("the nearest one is the same from wherever the search starts, ties included") {
  const Points points = lattice(6);
  const KdTree tree(points);
  std::vector<Neighbor> found;
  for (const Vec3f& query : {Vec3f(2.5F, 2.5F, 2.5F), Vec3f(0.1F, 4.9F, 3.0F), Vec3f(-7.0F, 2.0F, 2.5F)}) {
    tree.nearest(query, 1, found);
    for (std::uint32_t start = 0; start < points.size(); ++start)
      CHECK(tree.nearest_from(query, start) == found.front().index);
  }
}

TEST_CASE("the nearest points are those that brute force finds") {
  const Points points = coherent_random_points(3000, 1);
  const KdTree tree(points);
  CHECK(tree.size() == 3000);
  Random random(2);
  std::vector<Neighbor> found;
  std::size_t wrong = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3f query = (2.0 * random.uniform() * random.direction()).cast<float>();
    const auto expected = brute_force(points, query);
    for (const std::size_t k : {1U, 10U, 64U, 65U, 200U}) {
      tree.nearest(query, k, found);
      wrong += same(found, expected, k) ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("on a lattice ties are broken by index, also at the last place") {
  const Points points = lattice(12);
  const KdTree tree(points);
  std::vector<Neighbor> found;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < points.size(); i += 7) {
    const auto expected = brute_force(points, points[i]);
    for (const std::size_t k : {1U, 4U, 9U, 11U, 30U}) {
      tree.nearest(points[i], k, found);
      wrong += same(found, expected, k) ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("more neighbours than points gives all points") {
  const Points points = coherent_random_points(20, 3);
  const KdTree tree(points);
  std::vector<Neighbor> found;
  tree.nearest({0, 0, 0}, 1000, found);
  CHECK(same(found, brute_force(points, {0, 0, 0}), 1000));
  tree.nearest({0, 0, 0}, 0, found);
  CHECK(found.empty());
}

TEST_CASE("a search in an empty tree finds nothing") {
  const KdTree tree(Points{});
  std::vector<Neighbor> found{{1, 1.0F}};
  CHECK(tree.size() == 0);
  tree.nearest({0, 0, 0}, 5, found);
  CHECK(found.empty());
  found = {{1, 1.0F}};
  CHECK_FALSE(tree.within({0, 0, 0}, 5.0F, 10, found));
  CHECK(found.empty());
}

TEST_CASE("a tree over a subset answers with the indices of all points") {
  const Points points = coherent_random_points(2000, 4);
  std::vector<std::uint32_t> subset;
  for (std::uint32_t i = 1; i < 2000; i += 3) subset.push_back(i);
  const KdTree tree(points, subset);
  CHECK(tree.size() == subset.size());
  std::vector<Neighbor> found;
  for (std::size_t q = 0; q < 2000; q += 50) {
    auto expected = brute_force(points, points[q]);
    std::erase_if(expected, [](const Neighbor& n) { return n.index % 3 != 1; });
    tree.nearest(points[q], 8, found);
    CHECK(same(found, expected, 8));
    tree.within(points[q], 0.2F, 1000, found);
    std::erase_if(expected, [](const Neighbor& n) { return n.distance_sq > 0.2F * 0.2F; });
    CHECK(same(found, expected, 1000));
  }
}

TEST_CASE("a tree over no point at all is empty") {
  const KdTree tree(coherent_random_points(100, 4), {});
  CHECK(tree.size() == 0);
  std::vector<Neighbor> found;
  tree.nearest({0, 0, 0}, 5, found);
  CHECK(found.empty());
}

TEST_CASE("ties are broken by the index of all points, not by the place in the subset") {
  const Points points = lattice(6);
  std::vector<std::uint32_t> subset;
  for (std::uint32_t i = static_cast<std::uint32_t>(points.size()); i-- > 0;) subset.push_back(i);
  const KdTree tree(points, subset);
  std::vector<Neighbor> found;
  for (std::size_t q = 0; q < points.size(); q += 5) {
    tree.nearest(points[q], 5, found);
    CHECK(same(found, brute_force(points, points[q]), 5));
  }
}

TEST_CASE("a radius search includes its border and says where the limit cut") {
  const Points points = lattice(9);
  const KdTree tree(points);
  std::vector<Neighbor> found;
  const Vec3f middle{4, 4, 4};
  const auto all = brute_force(points, middle);
  for (const float radius : {0.0F, 1.0F, 2.0F, 3.0F, 100.0F}) {
    CAPTURE(radius);
    auto expected = all;
    std::erase_if(expected, [radius](const Neighbor& n) { return n.distance_sq > radius * radius; });
    CHECK_FALSE(tree.within(middle, radius, points.size(), found));
    CHECK(same(found, expected, points.size()));
    CHECK_FALSE(tree.within(middle, radius, expected.size(), found));  // exactly at the limit: nothing is cut
    CHECK(same(found, expected, expected.size()));
    CHECK(tree.within(middle, radius, expected.size() - 1, found));
    CHECK(same(found, expected, expected.size() - 1));
  }
  CHECK_FALSE(tree.within(middle, -1.0F, 10, found));
  CHECK(found.empty());
  CHECK_FALSE(tree.within(middle, std::numeric_limits<float>::quiet_NaN(), 10, found));
  CHECK(found.empty());
  CHECK_FALSE(tree.within(middle, std::numeric_limits<float>::max(), points.size(), found));
  CHECK(found.size() == points.size());
}

// Seven copies of a box's corners, each farther out than the last. To a query in the middle the eight nearest
// are equally far, and each is the corner of the tree's box around its octant, so that the distances to the
// boxes are those of the points but for the rounding on the way down.
Points nested_corners(const Vec3f& corner) {
  std::vector<Vec3f> list;
  for (int copy = 1; copy <= 7; ++copy) {
    const Vec3f p = corner * static_cast<float>(copy);
    for (unsigned octant = 0; octant < 8; ++octant) {
      list.push_back({(octant & 1U) != 0 ? p.x() : -p.x(), (octant & 2U) != 0 ? p.y() : -p.y(),
                      (octant & 4U) != 0 ? p.z() : -p.z()});
    }
  }
  return from_list(list);
}

TEST_CASE("no tie is missed where the distance to a box is rounded beyond that of the point in its corner") {
  std::vector<Neighbor> found;
  const Points points = nested_corners({0x1.56686cp-1F, 0x1.d63456p-1F, 0x1.7a5b44p-1F});
  const auto expected = brute_force(points, {0, 0, 0});
  REQUIRE(expected[0].distance_sq == expected[7].distance_sq);
  const KdTree tree(points);
  for (std::size_t k = 1; k <= 8; ++k) {
    tree.nearest({0, 0, 0}, k, found);
    CHECK(same(found, expected, k));
  }
  // The same of a radius whose square is just what the eight are away.
  const Points others = nested_corners({0x1.809b94p-1F, 0x1.bae07p-1F, 0x1.84951cp-1F});
  const auto within = brute_force(others, {0, 0, 0});
  constexpr float kRadius = 0x1.5fcd5ep+0F;
  REQUIRE(kRadius * kRadius == within[7].distance_sq);
  CHECK_FALSE(KdTree(others).within({0, 0, 0}, kRadius, 20, found));
  CHECK(same(found, within, 8));
}

TEST_CASE("a tree of identical points works and is quick") {
  const auto start = std::chrono::steady_clock::now();
  const KdTree tree(identical(100'000, {3, 3, 3}));
  std::vector<Neighbor> found;
  for (int i = 0; i < 50; ++i) tree.nearest({3, 3, 3}, 10, found);
  CHECK(found.size() == 10);
  CHECK(found[9].distance_sq == 0.0F);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::minutes(1));
}

TEST_CASE("a moved tree keeps its points") {
  KdTree first(coherent_random_points(100, 5));
  KdTree second = std::move(first);
  std::vector<Neighbor> found;
  second.nearest({0, 0, 0}, 3, found);
  CHECK(found.size() == 3);
}

}  // namespace
}  // namespace pointwright
