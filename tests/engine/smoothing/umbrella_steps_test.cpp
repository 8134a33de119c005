#include "engine/smoothing/umbrella_steps.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// Everyone lists sample 0, and then those that follow: a list as long as the cloud beside short ones.
NeighborGraph hub_graph(std::size_t count, std::uint32_t k) {
  NeighborGraph graph;
  graph.count = count;
  graph.k = k;
  graph.lanes.assign(padded_to_block(count) * k, 0U);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::uint32_t j = 1; j < k; ++j) graph.index(i, j) = static_cast<std::uint32_t>((i + j) % count);
  }
  return graph;
}

TEST_CASE("reverse neighbours are the neighbour relation transposed, hubs included") {
  const Surface ball = sphere(1'003, 1.0, Sampling::kRandom);
  for (const NeighborGraph& graph :
       {build_neighbor_graph(ball.position, 10), hub_graph(500, 4), hub_graph(17, 2)}) {
    const ReverseNeighbors reverse = reverse_neighbors(graph);
    std::vector<std::vector<std::uint32_t>> expected(graph.count);
    for (std::uint32_t i = 0; i < graph.count; ++i) {
      for (std::uint32_t j = 0; j < graph.k; ++j) expected[graph.index(i, j)].push_back(i);
    }
    std::size_t rest = 0;
    for (std::uint32_t i = 0; i < graph.count; ++i) {
      std::vector<std::uint32_t> listers;
      const std::size_t slice = i / kReverseLanes;
      for (std::uint32_t row = reverse.slice_first[slice]; row < reverse.slice_first[slice + 1]; ++row) {
        const std::uint32_t lister = reverse.rows[row * kReverseLanes + i % kReverseLanes];
        if (lister != reverse.nothing) listers.push_back(lister);
      }
      if (rest < reverse.rest_sample.size() && reverse.rest_sample[rest] == i) {
        listers.insert(listers.end(), reverse.rest.begin() + reverse.rest_first[rest],
                       reverse.rest.begin() + reverse.rest_first[rest + 1]);
        ++rest;
      }
      CHECK(listers == expected[i]);
    }
    CHECK(rest == reverse.rest_sample.size());
    // Slices are bounded, however long a list is.
    CHECK(reverse.rows.size() <= 2 * graph.k * padded_to_block(graph.count));
  }
}

TEST_CASE("a compensated step over a hub gives every neighbour its share") {
  const Surface ball = sphere(500, 1.0, Sampling::kRandom);
  const NeighborGraph graph = hub_graph(500, 4);
  Packed points(ball.position);
  Packed change(ball.size());
  compensated_step({.graph = &graph}, reverse_neighbors(graph), 0.4F, points, change);
  std::vector<Vec3d> expected(500);
  for (std::size_t i = 0; i < 500; ++i) expected[i] = ball.position[i].cast<double>();
  for (std::size_t i = 0; i < 500; ++i) {
    Vec3d sum = Vec3d::Zero();
    for (std::uint32_t j = 0; j < 4; ++j) {
      sum += (ball.position[graph.index(i, j)] - ball.position[i]).cast<double>();
    }
    expected[i] += 0.1 * sum;
    for (std::uint32_t j = 0; j < 4; ++j) expected[graph.index(i, j)] -= 0.025 * sum;
  }
  for (std::size_t i = 0; i < 500; ++i) CHECK((points[i].cast<double>() - expected[i]).norm() < 2e-5);
}

TEST_CASE("steps carry along the second moment of their weights") {
  // Against the weights themselves, as a matrix, after five steps.
  constexpr std::size_t kCount = 60;
  constexpr double kLambda = 0.5;
  const Surface ball = sphere(kCount, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(ball.position, 6);
  Eigen::MatrixXd step = (1.0 - kLambda) * Eigen::MatrixXd::Identity(kCount, kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    for (std::uint32_t j = 0; j < 6; ++j) {
      step(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(graph.index(i, j))) += kLambda / 6.0;
    }
  }
  Eigen::MatrixXd weights = Eigen::MatrixXd::Identity(kCount, kCount);
  const Packed rest(ball.position);
  Packed now = rest;
  Packed next(kCount);
  for (int n = 0; n < 5; ++n) {
    spread_step(graph, static_cast<float>(kLambda), rest, now, next);
    std::swap(now, next);
    weights = step * weights;
  }
  for (std::size_t i = 0; i < kCount; ++i) {
    double moment = 0.0;
    Vec3d mean = Vec3d::Zero();
    for (std::size_t m = 0; m < kCount; ++m) {
      const double w = weights(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(m));
      moment += w * (ball.position[m] - ball.position[i]).cast<double>().squaredNorm();
      mean += w * ball.position[m].cast<double>();
    }
    CHECK(relative_error(static_cast<double>(now.data()[i][3]), moment) < 1e-5);
    CHECK((now[i].cast<double>() - mean).norm() < 1e-6);
  }
}

TEST_CASE("steps give the same bytes for any thread count") {
  const Surface ball = sphere(20'000, 1.0, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(ball.position, 10);
  const ReverseNeighbors listers = reverse_neighbors(graph);
  const auto run = [&](int threads) {
    Points result;
    with_threads(threads, [&] {
      Packed points(ball.position);
      Packed other(ball.size());
      for (int n = 0; n < 3; ++n) compensated_step({.graph = &graph}, listers, 0.5F, points, other);
      plain_step({.graph = &graph}, 0.5F, points, other);
      result = other.unpacked();
    });
    return result;
  };
  const Points one = run(1);
  CHECK(run(2) == one);
  CHECK(run(8) == one);
}

}  // namespace
}  // namespace pointwright
