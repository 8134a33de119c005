#include "engine/spatial/coherent_order.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <numeric>

#include "engine/core/parallel.h"
#include "tests/support/random_points.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

std::vector<std::uint32_t> random_permutation(std::size_t count, std::uint64_t seed) {
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0U);
  Random random(seed);
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
  return order;
}

bool is_permutation_of_all(std::vector<std::uint32_t> order) {
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (order[i] != i) return false;
  }
  return true;
}

TEST_CASE("the order is a permutation") {
  CHECK(is_permutation_of_all(coherent_order(random_points(30'000, 3))));
}

TEST_CASE("neighbours in the order are neighbours in space") {
  // On a Morton curve through N points of a cube the mean hop is a few times N^(-1/3); random order has 1.3.
  const Points points = coherent(random_points(30'000, 3));
  double sum = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i)
    sum += static_cast<double>((points[i] - points[i - 1]).norm());
  CHECK(sum / 30'000.0 < 4.0 * 2.0 / std::cbrt(30'000.0));
}

TEST_CASE("exact duplicates are adjacent and in their old order") {
  Points points = random_points(5000, 4);
  Random random(9);
  std::vector<std::size_t> copies;
  for (int c = 0; c < 500; ++c) {
    const std::size_t to = random.below(5000);
    points.set(to, points[random.below(5000)]);
  }
  // Points that share a Morton cell with others, and still are different.
  for (std::size_t i = 0; i < 200; ++i) {
    points.set(i, {0.25F + static_cast<float>(i % 5) * 1e-7F, 0.25F, 0.25F});
  }
  const auto order = coherent_order(points);
  CHECK(is_permutation_of_all(order));
  const auto key = [](const Vec3f& p) { return std::tuple(p.x(), p.y(), p.z()); };
  std::vector<std::tuple<float, float, float>> runs;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && points[order[i]] == points[order[i - 1]]) {
      CHECK(order[i] > order[i - 1]);
    } else {
      runs.push_back(key(points[order[i]]));
    }
  }
  std::sort(runs.begin(), runs.end());
  CHECK(std::adjacent_find(runs.begin(), runs.end()) == runs.end());
}

TEST_CASE("the positions come in the same order whatever the order of the input") {
  Points points = random_points(20'000, 6);
  for (std::size_t i = 0; i < 1000; ++i) points.set(i, points[i + 1000]);
  const Points once = coherent(points);
  CHECK(coherent(reordered(points, random_permutation(20'000, 1))) == once);
  CHECK(coherent(reordered(points, random_permutation(20'000, 2))) == once);
}

TEST_CASE("points in coherent order stay as they are") {
  const Points points = coherent(random_points(20'000, 7));
  const auto order = coherent_order(points);
  CHECK(std::is_sorted(order.begin(), order.end()));
}

TEST_CASE("the order does not depend on the threads") {
  const Points points = random_points(150'000, 8);
  std::vector<std::uint32_t> one;
  with_threads(1, [&] { one = coherent_order(points); });
  for (const int threads : {2, 8}) with_threads(threads, [&] { CHECK(coherent_order(points) == one); });
}

TEST_CASE("degenerate sets have an order too") {
  CHECK(coherent_order(Points{}).empty());
  CHECK(coherent_order(identical(1, {1, 2, 3})) == std::vector<std::uint32_t>{0});
  const auto same = coherent_order(identical(5000, {1, 2, 3}));
  CHECK(is_permutation_of_all(same));
  CHECK(std::is_sorted(same.begin(), same.end()));  // ties by old index
  Points line(100);
  for (std::size_t i = 0; i < 100; ++i) line.set(i, {0.0F, static_cast<float>((i * 37) % 100), 0.0F});
  const Points ordered = reordered(line, coherent_order(line));
  for (std::size_t i = 0; i < 100; ++i) CHECK(ordered[i].y() == static_cast<float>(i));
}

TEST_CASE("extents at both ends of the range of floats have an order") {
  for (const float size : {1e-30F, 1e-6F, 1e9F}) {
    CAPTURE(size);
    Points points = random_points(1000, 12);
    for (std::size_t i = 0; i < 1000; ++i) points.set(i, size * points[i]);
    CHECK(is_permutation_of_all(coherent_order(points)));
  }
}

}  // namespace
}  // namespace pointwright
