#include "engine/simplification/simplification.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "engine/normals/estimation.h"
#include "engine/spatial/kd_tree.h"
#include "tests/support/all_machines.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

Simplification simplified(const Surface& surface, const SimplifyParams& params) {
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  auto result = simplify(surface.position, surface.normal, graph, params);
  REQUIRE(result.ok());
  return std::move(result).value();
}

// Root mean square distance of every input sample to the plane of the sample that stands for it.
double plane_rms(const Surface& surface, const Simplification& result) {
  double sum = 0.0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const std::uint32_t m = result.parent[i];
    const auto d = static_cast<double>(result.normal[m].dot(surface.position[i] - result.position[m]));
    sum += d * d;
  }
  return std::sqrt(sum / static_cast<double>(surface.size()));
}

bool same_bits(const Simplification& a, const Simplification& b) {
  const auto same_steps =
      std::equal(a.record.steps.begin(), a.record.steps.end(), b.record.steps.begin(), b.record.steps.end(),
                 [](const Contraction& u, const Contraction& v) {
                   return u.survivor == v.survivor && u.removed == v.removed && u.error == v.error;
                 });
  return same_steps && a.kept == b.kept && a.parent == b.parent && a.position == b.position &&
         a.normal == b.normal && a.record.position == b.record.position &&
         a.record.normal == b.record.normal && a.record.neighbor_first == b.record.neighbor_first &&
         a.record.neighbor == b.record.neighbor;
}

void check_consistent(const Surface& surface, const Simplification& result) {
  CHECK(result.kept.size() + result.record.steps.size() == surface.size());
  CHECK(std::is_sorted(result.kept.begin(), result.kept.end()));
  CHECK(result.position.size() == result.kept.size());
  CHECK(result.normal.size() == result.kept.size());
  CHECK(all_finite(result.position));
  REQUIRE(result.parent.size() == surface.size());
  for (std::uint32_t m = 0; m < result.kept.size(); ++m) {
    CHECK(result.parent[result.kept[m]] == m);
    CHECK(std::abs(result.normal[m].norm() - 1.0F) < 1e-5F);
  }
  CHECK(std::all_of(result.parent.begin(), result.parent.end(),
                    [&](std::uint32_t m) { return m < result.kept.size(); }));
}

TEST_CASE("a plane simplifies without error, in either order and with either placement") {
  const Surface surface = plane(48, 0.01, Sampling::kJittered);
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    for (const Placement placement : {Placement::kQuadricMinimum, Placement::kOnSurface}) {
      const Simplification result =
          simplified(surface, {.target = KeepCount{60}, .order = order, .placement = placement});
      check_consistent(surface, result);
      CHECK(result.kept.size() == 60);
      for (const Contraction& step : result.record.steps) CHECK(step.error == 0.0F);
      for (std::size_t m = 0; m < result.kept.size(); ++m) CHECK(result.position[m].z() == 0.0F);
    }
  }
}

TEST_CASE("a pair across a ridge is contracted onto the line where its planes meet") {
  // Far enough apart that the neighbours of each lie in its own plane: k = 4 of two clusters of five.
  std::vector<Vec3f> list;
  std::vector<Vec3f> normals;
  const float root = std::numbers::sqrt2_v<float> / 2.0F;
  for (const float side : {-1.0F, 1.0F}) {
    for (const auto& [u, v] :
         {std::pair{0.0F, 0.0F}, {0.1F, 0.0F}, {-0.1F, 0.0F}, {0.0F, 0.1F}, {0.0F, -0.1F}}) {
      list.push_back({u, side * (1.0F + v), -(1.0F + v)});
      normals.push_back({0.0F, side * root, root});
    }
  }
  const Surface surface{from_list(list), from_list(normals)};
  const NeighborGraph graph = build_neighbor_graph(surface.position, 4);
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    const auto two =
        simplify(surface.position, surface.normal, graph, {.target = KeepCount{2}, .order = order});
    REQUIRE(two.ok());
    CHECK(two.value().kept.size() == 2);
    for (const Contraction& step : two.value().record.steps) CHECK(step.error < 1e-4F);
    const auto one =
        simplify(surface.position, surface.normal, graph,
                 {.target = KeepCount{1}, .order = order, .placement = Placement::kQuadricMinimum});
    REQUIRE(one.ok());
    REQUIRE(one.value().kept.size() == 1);
    // Both planes pass through the x axis; the pull toward the mean, at z = -1, is a thousandth of the
    // planes'.
    const Vec3f p = one.value().position[0];
    CHECK(std::abs(p.x()) < 1e-4F);
    CHECK(std::abs(p.y()) < 1e-4F);
    CHECK(std::abs(p.z()) < 3e-3F);
    CHECK(one.value().normal[0].z() > 0.999F);
  }
}

TEST_CASE("a cube keeps its edges; its flats grow sparse and cost nothing") {
  const std::size_t side = 60;
  const Surface surface = cube(side, 1.0);
  const float spacing = 2.0F / static_cast<float>(side);
  const Simplification result = simplified(surface, {.target = KeepCount{2'500}});
  check_consistent(surface, result);
  const auto edge_distance = [](const Vec3f& p) {
    Eigen::Array3f a = p.array().abs();
    std::sort(a.data(), a.data() + 3);
    return 1.0F - a[1];
  };
  std::size_t near_before = 0;
  std::size_t near_after = 0;
  for (std::size_t i = 0; i < surface.size(); ++i)
    near_before += edge_distance(surface.position[i]) < 2 * spacing;
  for (std::size_t m = 0; m < result.kept.size(); ++m)
    near_after += edge_distance(result.position[m]) < 2 * spacing;
  const double edge_share = static_cast<double>(near_after) / static_cast<double>(near_before);
  const double flat_share = static_cast<double>(result.kept.size() - near_after) /
                            static_cast<double>(surface.size() - near_before);
  CHECK(edge_share > 8.0 * flat_share);
  double worst_flat = 0.0;
  std::vector<float> extent(result.kept.size(), 1.0F);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    extent[result.parent[i]] = std::min(extent[result.parent[i]], edge_distance(surface.position[i]));
  }
  std::size_t flats = 0;
  for (std::size_t m = 0; m < result.kept.size(); ++m) {
    if (extent[m] < 3.0F * spacing) continue;  // all that it stands for lies inside a face
    ++flats;
    const double off = std::abs(1.0 - static_cast<double>(result.position[m].cwiseAbs().maxCoeff()));
    worst_flat = std::max(worst_flat, off);
  }
  CHECK(flats > 20);
  CHECK(worst_flat < 1e-6);
  CHECK(result.record.steps.back().error < 0.2F * spacing);
}

TEST_CASE("no sample comes to stand for a whole flat") {
  // Flats cost nothing: without a length term one sample takes thousands, and the rest of the face is bare.
  const Surface surface = cube(80, 1.0);
  const std::size_t mean = 20;
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    const Simplification result =
        simplified(surface, {.target = KeepCount{surface.size() / mean}, .order = order});
    std::vector<std::size_t> stands_for(result.kept.size(), 0);
    for (const std::uint32_t m : result.parent) ++stands_for[m];
    CHECK(*std::max_element(stands_for.begin(), stands_for.end()) < 20 * mean);
  }
}

TEST_CASE("on a sphere the error falls with the count as 1 / count") {
  // A cap of area 4 pi / M has a height of 1 / M to first order.
  const Surface surface = sphere(40'000, 1.0, Sampling::kRegular);
  std::vector<double> error;
  for (const std::size_t count : {250, 1'000, 4'000}) {
    const Simplification result =
        simplified(surface, {.target = KeepCount{count}, .placement = Placement::kQuadricMinimum});
    double sum = 0.0;
    for (std::size_t m = 0; m < count; ++m) {
      const double d = static_cast<double>(result.position[m].norm()) - 1.0;
      sum += d * d;
    }
    error.push_back(std::sqrt(sum / static_cast<double>(count)));
  }
  CHECK(std::log2(error[0] / error[1]) / 2.0 == doctest::Approx(1.0).epsilon(0.15));
  CHECK(std::log2(error[1] / error[2]) / 2.0 == doctest::Approx(1.0).epsilon(0.15));
}

TEST_CASE("placement on the surface cancels what the quadrics' minimum and the mean are off") {
  const Surface surface = sphere(40'000, 1.0, Sampling::kRandom);
  const auto rms = [&](Placement placement) {
    const Simplification result = simplified(surface, {.target = KeepCount{1'500}, .placement = placement});
    double sum = 0.0;
    for (std::size_t m = 0; m < result.kept.size(); ++m) {
      const double d = static_cast<double>(result.position[m].norm()) - 1.0;
      sum += d * d;
    }
    return std::sqrt(sum / static_cast<double>(result.kept.size()));
  };
  CHECK(rms(Placement::kOnSurface) < 0.25 * rms(Placement::kQuadricMinimum));
}

TEST_CASE("batches of independent pairs come within 5 % of the greedy order") {
  const auto bumps = [](const Vec3d& p) { return 0.03 * std::sin(9.0 * p.x()) * std::cos(7.0 * p.y()); };
  const Surface surfaces[] = {torus(20'000, 1.0, 0.4, Sampling::kRandom),
                              wave(140, 0.01, Sampling::kJittered, 0.04, 0.35),
                              displaced(sphere(20'000, 1.0, Sampling::kRandom), bumps),
                              with_noise(ellipsoid(20'000, {1.0, 0.7, 0.4}), 0.002)};
  for (const Surface& surface : surfaces) {
    for (const std::size_t count : {5'000, 1'000}) {
      const Simplification greedy =
          simplified(surface, {.target = KeepCount{count}, .order = ContractionOrder::kGreedy});
      const Simplification batched = simplified(surface, {.target = KeepCount{count}});
      REQUIRE(greedy.kept.size() == count);
      REQUIRE(batched.kept.size() == count);
      CHECK(plane_rms(surface, batched) < 1.05 * plane_rms(surface, greedy));
    }
  }
}

TEST_CASE("opposed sheets are never joined") {
  // 0.3 spacings apart: a sample's nearest neighbours are on the other sheet.
  const Surface surface = parallel_sheets(40, 0.01, 0.003, Sampling::kJittered);
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    for (const std::size_t count : {400, 20, 2}) {
      const Simplification result = simplified(surface, {.target = KeepCount{count}, .order = order});
      CHECK(result.kept.size() == count);
      for (std::size_t i = 0; i < surface.size(); ++i) {
        REQUIRE(surface.normal[i].dot(result.normal[result.parent[i]]) > 0.9F);
        REQUIRE(surface.position[i].z() == result.position[result.parent[i]].z());
      }
    }
    CHECK(simplified(surface, {.target = KeepCount{1}, .order = order}).kept.size() == 2);
    CHECK(
        simplified(surface, {.target = KeepCount{1}, .order = order, .separate_sheets = false}).kept.size() ==
        1);
  }
}

TEST_CASE("targets are met") {
  const Surface surface = torus(3'000, 1.0, 0.4, Sampling::kRandom);
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    for (const std::size_t count : {2'999, 1'777, 100, 7}) {
      const Simplification result = simplified(surface, {.target = KeepCount{count}, .order = order});
      check_consistent(surface, result);
      CHECK(result.kept.size() == count);
    }
    CHECK(simplified(surface, {.target = KeepRatio{0.25}, .order = order}).kept.size() == 750);
    CHECK(simplified(surface, {.target = KeepRatio{1e-9}, .order = order, .separate_sheets = false})
              .kept.size() == 1);
    const Simplification all = simplified(surface, {.target = KeepCount{5'000}, .order = order});
    CHECK(all.position == surface.position);
    CHECK(all.normal == surface.normal);
  }
}

TEST_CASE("an error bound holds for every contraction and every sample, and is used up") {
  const Surface surface = torus(8'000, 1.0, 0.4, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  std::size_t before = surface.size();
  for (const float bound : {0.002F, 0.01F, 0.04F}) {
    for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
      const SimplifyParams params{
          .target = KeepWithin{bound}, .order = order, .placement = Placement::kQuadricMinimum};
      const auto outcome = simplify(surface.position, surface.normal, graph, params);
      REQUIRE(outcome.ok());
      const Simplification& result = outcome.value();
      for (const Contraction& step : result.record.steps) REQUIRE(step.error <= bound * 1.00001F);
      CHECK(result.kept.size() < before);
      // The planes of §3.2, spelt out: through p, spanned by e and e x n.
      for (std::size_t i = 0; i < surface.size(); ++i) {
        const Vec3d p = surface.position[i].cast<double>();
        const Vec3d n = surface.normal[i].cast<double>();
        double sum = 0.0;
        for (std::uint32_t j = 0; j < graph.k; ++j) {
          const Vec3d e = p - surface.position[graph.index(i, j)].cast<double>();
          const double d =
              e.cross(e.cross(n)).normalized().dot(result.position[result.parent[i]].cast<double>() - p);
          sum += d * d;
        }
        REQUIRE(std::sqrt(sum / static_cast<double>(graph.k)) <= static_cast<double>(bound) * 1.0001);
      }
      if (order == ContractionOrder::kBatched) before = result.kept.size();
    }
  }
}

TEST_CASE("contractions are undone to any count, bit by bit") {
  const Surface surface = torus(4'000, 1.0, 0.4, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    const Simplification coarse = simplified(surface, {.target = KeepCount{150}, .order = order});
    const Simplification all = reinsert(coarse, surface.position, surface.normal, surface.size());
    CHECK(all.position == surface.position);
    CHECK(all.normal == surface.normal);
    CHECK(all.kept.size() == surface.size());
    CHECK(all.record.steps.empty());
    CHECK(same_bits(reinsert(coarse, surface.position, surface.normal, 150), coarse));
    for (const std::size_t count : {151, 1'000, 3'333}) {
      const Simplification between = reinsert(coarse, surface.position, surface.normal, count);
      check_consistent(surface, between);
      CHECK(between.kept.size() == count);
      // By way of a finer count it is the same, and so are its neighbourhoods.
      const Simplification finer = reinsert(coarse, surface.position, surface.normal, 3'500);
      for (std::size_t s = 0; s < between.record.steps.size() && s < finer.record.steps.size(); ++s) {
        CHECK(finer.record.steps[s].removed == between.record.steps[s].removed);
      }
      const Neighborhoods rows = neighborhoods(between, graph);
      REQUIRE(rows.first.size() == count + 1);
      for (std::uint32_t m = 0; m < count; ++m) {
        for (std::size_t e = rows.first[m]; e < rows.first[m + 1]; ++e) {
          const std::uint32_t x = rows.neighbor[e];
          CHECK(x != m);
          CHECK(std::binary_search(rows.neighbor.begin() + static_cast<std::ptrdiff_t>(rows.first[x]),
                                   rows.neighbor.begin() + static_cast<std::ptrdiff_t>(rows.first[x + 1]),
                                   m));
        }
      }
      if (order == ContractionOrder::kBatched) continue;
      // The greedy order passes through that very count.
      const Simplification stopped = simplified(surface, {.target = KeepCount{count}, .order = order});
      CHECK(same_bits(stopped, between));
      CHECK(neighborhoods(stopped, graph) == rows);
    }
  }
}

TEST_CASE("any number of threads and any instruction set gives the same bytes") {
  const Surface surface = with_noise(torus(30'000, 1.0, 0.4, Sampling::kRandom), 0.001);
  const SimplifyParams params{.target = KeepCount{2'000}};
  for_all_machines(
      [&] { return simplified(surface, params); },
      [](const Simplification& one, const Simplification& other) { CHECK(same_bits(other, one)); });
}

TEST_CASE("the scale of the model does not matter") {
  const Surface surface = torus(3'000, 1.0, 0.4, Sampling::kRandom);
  const Simplification reference = simplified(surface, {.target = KeepCount{200}});
  for (const float scale : {0x1p-60F, 0x1p40F}) {
    Surface scaled = surface;
    for (std::size_t i = 0; i < surface.size(); ++i) scaled.position.set(i, surface.position[i] * scale);
    const Simplification result = simplified(scaled, {.target = KeepCount{200}});
    CHECK(result.parent == reference.parent);
    for (std::size_t m = 0; m < 200; ++m) {
      CHECK((result.record.position[m] / scale - reference.record.position[m]).norm() == 0.0F);
    }
  }
}

TEST_CASE("degenerate input is legal") {
  const auto run = [](const Points& position, std::size_t count, ContractionOrder order) {
    Surface surface{position, Points(position.size())};
    for (std::size_t i = 0; i < position.size(); ++i) surface.normal.set(i, {0.0F, 0.0F, 1.0F});
    const Simplification result = simplified(surface, {.target = KeepCount{count}, .order = order});
    check_consistent(surface, result);
    return result;
  };
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    CHECK(run(Points(), 1, order).kept.empty());
    CHECK(run(identical(1, {1, 2, 3}), 1, order).position[0] == Vec3f(1, 2, 3));
    CHECK(run(from_list({{0, 0, 0}, {1, 0, 0}}), 1, order).kept.size() == 1);
    const Simplification pile = run(identical(100, {1, 2, 3}), 3, order);
    CHECK(pile.kept.size() == 3);
    CHECK(pile.position[2] == Vec3f(1, 2, 3));
    const Simplification line = run(collinear(50, {0, 0, 0}, {1, 0, 0}), 5, order);
    CHECK(line.kept.size() == 5);
    CHECK(line.position[3].y() == 0.0F);
    // Parts that share no neighbour: 4 x 40 samples, further apart than ten neighbours reach.
    std::vector<Surface> parts;
    for (const double x : {0.0, 100.0, 200.0, 300.0}) {
      parts.push_back(moved(plane(7, 0.1, Sampling::kJittered), {x, 0.0, 0.0}));
    }
    CHECK(run(joined(parts).position, 2, order).kept.size() == 2);
  }
}

TEST_CASE("parameters out of range are named") {
  const auto field = [](const SimplifyParams& params) {
    const auto result = validate(params);
    REQUIRE(!result.ok());
    CHECK(result.error().code == ErrorCode::kInvalidArgument);
    CHECK(result.error().limit.has_value());
    return result.error().field;
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(field({.target = KeepCount{0}}) == "target.count");
  CHECK(field({.target = KeepRatio{0.0}}) == "target.ratio");
  CHECK(field({.target = KeepRatio{1.5}}) == "target.ratio");
  CHECK(field({.target = KeepWithin{-1.0F}}) == "target.error");
  CHECK(field({.target = KeepWithin{nan}}) == "target.error");
  CHECK(field({.length_weight = -0.1F}) == "length_weight");
  CHECK(field({.length_weight = nan}) == "length_weight");
  CHECK(validate(SimplifyParams{}).ok());
}

TEST_CASE("cancelled work says so") {
  const Surface surface = torus(2'000, 1.0, 0.4, Sampling::kRandom);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const ExecutionContext context;
  context.cancel();
  for (const ContractionOrder order : {ContractionOrder::kGreedy, ContractionOrder::kBatched}) {
    const auto result = simplify(surface.position, surface.normal, graph, {.order = order}, &context);
    REQUIRE(!result.ok());
    CHECK(result.error().code == ErrorCode::kCancelled);
  }
}

}  // namespace
}  // namespace pointwright
