// Rows of neighbours after samples have been inserted, patches at rest and weights of zombies.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/resampling/resampling_support.h"
#include "tests/support/pulled_plane.h"

namespace pointwright {
namespace {

struct Rows {
  double children = 0.0;  // mean share of the true nearest ones
  double parents = 0.0;
  double around = 0.0;
  std::size_t repeated = 0;
  std::size_t untouched = 0;
  std::size_t changed = 0;  // of the untouched
};

template <typename Scene>
Rows rows_of(const Scene& scene, const ResampledEdit& edit) {
  const NeighborGraph& before = *scene.sampling->graph;
  const NeighborGraph& after = *edit.sampling->graph;
  const std::size_t n = before.count;
  std::vector<std::uint8_t> split(n, 0);
  for (std::size_t i = n; i < after.count; ++i) split[edit.sampling->parent[i]] = 1;  // ids are numbers
  const Points& p = edit.surface.finest().position;
  const KdTree tree(p);
  Rows rows;
  std::array<double, 3> sum{};
  std::array<std::size_t, 3> count{};
  std::vector<Neighbor> found;
  for (std::size_t i = 0; i < after.count; ++i) {
    std::size_t kind = 0;
    if (i < n) {
      bool near = false;
      for (std::uint32_t j = 0; j < before.k; ++j) near = near || split[before.index(i, j)] != 0;
      if (split[i] == 0 && !near) {
        ++rows.untouched;
        for (std::uint32_t j = 0; j < before.k; ++j)
          rows.changed += before.index(i, j) == after.index(i, j) ? 0U : 1U;
        continue;
      }
      kind = split[i] != 0 ? 1 : 2;
    }
    tree.nearest(p[i], after.k + 1, found);
    std::vector<std::uint32_t> row;
    for (std::uint32_t j = 0; j < after.k; ++j) row.push_back(after.index(i, j));
    std::size_t common = 0;
    for (const Neighbor& near : found)
      common += std::find(row.begin(), row.end(), near.index) != row.end() ? 1U : 0U;
    std::sort(row.begin(), row.end());
    rows.repeated += std::adjacent_find(row.begin(), row.end()) != row.end() ? 1U : 0U;
    sum[kind] += static_cast<double>(common) / static_cast<double>(after.k);
    ++count[kind];
  }
  for (std::size_t kind = 0; kind < 3; ++kind) REQUIRE(count[kind] > 0);
  rows.children = sum[0] / static_cast<double>(count[0]);
  rows.parents = sum[1] / static_cast<double>(count[1]);
  rows.around = sum[2] / static_cast<double>(count[2]);
  MESSAGE("share of the true neighbours: children " << rows.children << ", parents " << rows.parents
                                                    << ", around them " << rows.around << "; repeated "
                                                    << rows.repeated);
  return rows;
}

TEST_CASE("rows of neighbours are updated where samples were inserted") {
  const test::PulledPlane scene = test::pulled_plane(100);
  const Rows rows = rows_of(scene, test::resampled(scene));
  CHECK(rows.children > 0.97);
  CHECK(rows.parents > 0.98);
  CHECK(rows.around > 0.95);
  CHECK(rows.repeated == 0);
  CHECK(rows.untouched > 100);
  CHECK(rows.changed == 0);
}

TEST_CASE("rows of neighbours on a curved surface, for few and many of them") {
  for (const std::uint32_t k : {8U, 10U, 16U, 24U, 32U}) {
    CAPTURE(k);
    const test::Surface sphere = test::sphere(5'000, 1.0, test::Sampling::kRegular);
    test::EditScene scene = test::scene_of(
        {.levels = {test::level_of(sphere)}, .detail = {}},
        [](const Vec3f& p) { return p.z() < 0.0F   ? 1
                                    : p.z() > 0.9F ? 2
                                                   : 0; },
        test::resampling_by(Translation{.vector = Vec3d(0.0, 0.0, 2.0)}));
    scene = test::scene_with(scene.surface, test::to_cloud(sphere.position), scene.regions, scene.params, k);
    const Rows rows = rows_of(scene, test::resampled(scene));
    CHECK(rows.children > 0.95);
    CHECK(rows.parents > 0.97);
    CHECK(rows.around > 0.92);
    CHECK(rows.repeated == 0);
    CHECK(rows.changed == 0);
  }
}

// How far points of the patch are from a surface, at three quarters of a spacing from the sample.
template <typename Distance>
double patch_error(const test::Surface& surface, double spacing, const Distance& distance) {
  const Level level = test::level_of(surface);
  const NeighborGraph graph = build_neighbor_graph(level.position, 10);
  std::vector<double> error;
  for (std::size_t i = 0; i < level.position.size(); i += 7) {
    const RestPatch patch = rest_patch(level, graph, static_cast<std::uint32_t>(i));
    REQUIRE(patch.point(0.0F, 0.0F) == level.position[i]);
    for (int turn = 0; turn < 8; ++turn) {
      const double angle = 0.25 * std::numbers::pi * turn;
      const Vec3f p = patch.point(static_cast<float>(0.75 * spacing * std::cos(angle)),
                                  static_cast<float>(0.75 * spacing * std::sin(angle)));
      error.push_back(distance(p.template cast<double>()) / spacing);
    }
  }
  return test::root_mean_square(error);
}

TEST_CASE("patches lie on the surface between its samples") {
  constexpr double kPi = std::numbers::pi;
  const double on_sphere =
      patch_error(test::sphere(20'000, 1.0, test::Sampling::kRegular), std::sqrt(4.0 * kPi / 20'000.0),
                  [](const Vec3d& p) { return p.norm() - 1.0; });
  const double on_torus = patch_error(
      test::torus(20'000, 1.0, 0.35, test::Sampling::kRandom), std::sqrt(4.0 * kPi * kPi * 0.35 / 20'000.0),
      [](const Vec3d& p) { return std::hypot(std::hypot(p.x(), p.y()) - 1.0, p.z()) - 0.35; });
  MESSAGE("sphere " << on_sphere << ", torus " << on_torus << " spacings");
  CHECK(on_sphere < 1e-5);
  CHECK(on_torus < 5e-4);
}

TEST_CASE("tangents of a patch are its derivatives") {
  const test::Surface sphere = test::sphere(2'000, 1.0, test::Sampling::kRandom);
  const Level level = test::level_of(sphere);
  const RestPatch patch = rest_patch(level, build_neighbor_graph(level.position, 10), 77);
  constexpr float kStep = 1e-3F;
  for (const float x : {-0.02F, 0.0F, 0.03F}) {
    const Vec3f dx = (patch.point(x + kStep, 0.01F) - patch.point(x - kStep, 0.01F)) / (2.0F * kStep);
    const Vec3f dy = (patch.point(x, 0.01F + kStep) - patch.point(x, 0.01F - kStep)) / (2.0F * kStep);
    CHECK((dx - patch.tangent_x(x, 0.01F)).norm() < 2e-4F);
    CHECK((dy - patch.tangent_y(x, 0.01F)).norm() < 2e-4F);
  }
}

Level level_from(const Points& position, const Vec3f& normal) {
  Level level{.position = position, .normal = Points(position.size())};
  for (std::size_t i = 0; i < position.size(); ++i) level.normal.set(i, normal);
  return level;
}
constexpr std::array<float, 5> kNoJet{};

TEST_CASE("a patch is the tangent plane where its neighbours determine no jet") {
  const Points line = test::collinear(40, Vec3f::Zero(), {1.0F, 0.0F, 0.0F});
  CHECK(rest_patch(level_from(line, Vec3f::UnitZ()), build_neighbor_graph(line, 10), 20).jet == kNoJet);
  const Points few = test::coherent(
      test::from_list({{0.0F, 0.0F, 0.0F}, {1.0F, 0.0F, 0.2F}, {0.0F, 1.0F, 0.1F}, {-1.0F, 0.0F, 0.3F}}));
  CHECK(rest_patch(level_from(few, Vec3f::UnitZ()), build_neighbor_graph(few, 10), 0).jet == kNoJet);
  const Points same = test::identical(12, {1.0F, 2.0F, 3.0F});
  const RestPatch patch = rest_patch(level_from(same, Vec3f::UnitZ()), build_neighbor_graph(same, 10), 3);
  CHECK(patch.ring_size == 0);
  CHECK(patch.jet == kNoJet);
}

TEST_CASE("a patch takes no neighbour from a sheet that faces the other way") {
  const test::Surface sheets = test::parallel_sheets(20, 0.1, 0.02, test::Sampling::kJittered);
  const Level level = test::level_of(sheets);
  const NeighborGraph graph = build_neighbor_graph(level.position, 10);
  for (std::uint32_t i = 0; i < level.position.size(); ++i) {
    const RestPatch patch = rest_patch(level, graph, i);
    REQUIRE(patch.ring_size > 0);
    for (std::uint32_t r = 0; r < patch.ring_size; ++r) {
      REQUIRE(patch.ring[r] != i);
      REQUIRE(level.normal[patch.ring[r]].z() == level.normal[i].z());
    }
  }
}

// What the weights make of a function of the place in the plane z = 0.
template <typename Function>
double weighed(const ZombieWeights& weights, const Points& position, const Function& function) {
  double sum = 0.0;
  for (std::uint32_t j = 0; j < weights.count; ++j) {
    const Vec3d p = position[weights.sample[j]].cast<double>();
    sum += static_cast<double>(weights.weight[j]) * function(p.x(), p.y());
  }
  return sum;
}

TEST_CASE("weights of zombies reproduce quadratic functions") {
  const test::Surface plane = test::plane(30, 0.1, test::Sampling::kJittered);
  const Level level = test::level_of(plane);
  const NeighborGraph graph = build_neighbor_graph(level.position, 10);
  const auto quadratic = [](double x, double y) {
    return 1.0 + 2.0 * x - 3.0 * y + 4.0 * x * x + 5.0 * x * y - 6.0 * y * y;
  };
  double farthest = 0.0;
  double off_one = 0.0;
  for (std::uint32_t i = 0; i < level.position.size(); i += 3) {
    const RestPatch patch = rest_patch(level, graph, i);
    for (const float x : {-0.07F, 0.0F, 0.06F}) {
      const ZombieWeights weights = zombie_weights(patch, i, level.position, x, 0.03F);
      const Vec3d p = patch.point(x, 0.03F).cast<double>();
      CHECK(weights.count == kZombies);
      farthest =
          std::max(farthest, std::abs(weighed(weights, level.position, quadratic) - quadratic(p.x(), p.y())));
      off_one = std::max(
          off_one, std::abs(weighed(weights, level.position, [](double, double) { return 1.0; }) - 1.0));
    }
  }
  MESSAGE("quadratics to within " << farthest << ", sums to within " << off_one);
  CHECK(farthest < 1e-4);
  CHECK(off_one < 2e-6);
}

TEST_CASE("weights of zombies are linear, or a mean, where the neighbours do not determine more") {
  const auto sum_of = [](const ZombieWeights& weights, const Points& position) {
    return weighed(weights, position, [](double, double) { return 1.0; });
  };
  // Four samples that determine a plane.
  const Points few =
      test::from_list({{0.0F, 0.0F, 0.0F}, {1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}, {-1.0F, -1.0F, 0.0F}});
  const Level level = level_from(few, Vec3f::UnitZ());
  RestPatch patch = rest_patch(level, build_neighbor_graph(few, 3), 0);
  ZombieWeights weights = zombie_weights(patch, 0, few, 0.3F * patch.u.x(), 0.3F * patch.v.x());
  const Vec3f here = patch.point(0.3F * patch.u.x(), 0.3F * patch.v.x());
  CHECK(weights.count == 4);
  CHECK(std::abs(sum_of(weights, few) - 1.0) < 1e-6);
  CHECK(std::abs(weighed(weights, few, [](double x, double y) { return 2.0 * x - y; }) -
                 static_cast<double>(2.0F * here.x() - here.y())) < 1e-5);
  // On a line: a mean, all of whose weights are positive.
  const Points line = test::collinear(40, Vec3f::Zero(), {1.0F, 0.0F, 0.0F});
  const Level on_line = level_from(line, Vec3f::UnitZ());
  patch = rest_patch(on_line, build_neighbor_graph(line, 10), 20);
  weights = zombie_weights(patch, 20, line, 0.01F, 0.01F);
  CHECK(std::abs(sum_of(weights, line) - 1.0) < 1e-6);
  for (std::uint32_t j = 0; j < weights.count; ++j) CHECK(weights.weight[j] >= 0.0F);
  // Alone: the sample itself.
  const Points same = test::identical(12, {1.0F, 2.0F, 3.0F});
  patch = rest_patch(level_from(same, Vec3f::UnitZ()), build_neighbor_graph(same, 10), 3);
  for (const float x : {0.0F, 0.5F}) {
    weights = zombie_weights(patch, 3, same, x, 0.0F);
    CHECK(weights.count == 1);
    CHECK(weights.sample[0] == 3);
    CHECK(weights.weight[0] == 1.0F);
  }
  // At a sample's own place its own value counts most.
  const Level plane = test::level_of(test::plane(10, 0.1, test::Sampling::kJittered));
  patch = rest_patch(plane, build_neighbor_graph(plane.position, 10), 42);
  weights = zombie_weights(patch, 42, plane.position, 0.0F, 0.0F);
  CHECK(weights.sample[0] == 42);
  CHECK(weights.weight[0] > 0.5F);
}

}  // namespace
}  // namespace pointwright
