#include "engine/simplification/contraction.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "engine/core/simd_dispatch.h"
#include "tests/support/all_machines.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// Nodes of which every fourth has been contracted with the one after it.
ContractionNodes grown_nodes(const Surface& surface) {
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  ContractionNodes nodes(surface.position, surface.normal, graph, true, nullptr);
  std::vector<std::uint32_t> first(padded_to_block(surface.size() / 4), 0U);
  std::vector<std::uint32_t> second(first.size(), 1U);
  for (std::uint32_t p = 0; p < surface.size() / 4; ++p) {
    first[p] = 4 * p;
    second[p] = 4 * p + 1;
  }
  std::vector<ContractionNode> merged(first.size());
  nodes.contract(first.data(), second.data(), surface.size() / 4, merged.data());
  for (std::size_t p = 0; p < surface.size() / 4; ++p) nodes.set(first[p], merged[p]);
  return nodes;
}

TEST_CASE("a pair costs the same bits whichever of its samples comes first, on any instruction set") {
  // Rounds find the cheapest pairs from either side: with two costs for one pair they might find none.
  const Surface surface = with_noise(torus(4'096, 1.0, 0.4, Sampling::kRandom), 0.01);
  const ContractionNodes nodes = grown_nodes(surface);
  const PairCost rule{.length_weight = 0.05F, .limit = 1e-3F, .separate_sheets = true};
  std::vector<std::uint32_t> a(surface.size());
  std::vector<std::uint32_t> b(surface.size());
  Random random(7);
  for (std::size_t p = 0; p < a.size(); ++p) {
    a[p] = static_cast<std::uint32_t>(random.below(surface.size()));
    b[p] = static_cast<std::uint32_t>((a[p] + 1 + random.below(40)) % surface.size());
  }
  std::vector<float> reference(a.size());
  nodes.costs(rule, a.data(), b.data(), a.size(), reference.data());
  const auto finite = std::count_if(reference.begin(), reference.end(), [](float c) { return c < 1.0F; });
  CHECK(finite > 500);
  CHECK(finite < 4'000);
  on_every_instruction_set([&] {
    std::vector<float> cost(a.size());
    nodes.costs(rule, b.data(), a.data(), a.size(), cost.data());
    CHECK(cost == reference);
    // Over rows it is the same cost: a row that lists one other node.
    std::vector<ContractionRow> rows(surface.size());
    std::vector<std::uint32_t> live(surface.size());
    std::iota(live.begin(), live.end(), 0U);
    for (std::uint32_t i = 0; i < rows.size(); ++i) std::fill_n(rows[i].neighbor, kRowNeighbors, i);
    for (std::size_t p = 0; p < a.size(); ++p) rows[a[p]].neighbor[0] = b[p];
    std::vector<std::uint32_t> key(surface.size());
    std::vector<std::uint32_t> partner(surface.size());
    POINTWRIGHT_KERNEL(best_partners_kernel)
    ({.nodes = nodes.data(),
      .rows = rows[0].neighbor,
      .live = live.data(),
      .rule = rule,
      .cost = cost.data(),
      .key = key.data(),
      .partner = partner.data()},
     0, live.size());
    for (std::size_t p = 0; p < a.size(); ++p) {
      if (rows[a[p]].neighbor[0] != b[p]) continue;
      REQUIRE(cost[a[p]] == reference[p]);
      REQUIRE(partner[a[p]] == (reference[p] < 1.0F ? b[p] : kNoNode));
    }
  });
}

TEST_CASE("rows of contracted nodes hold what both had, once each, and the nearest where that is too much") {
  const Surface surface = plane(8, 1.0, Sampling::kJittered);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const ContractionNodes nodes(surface.position, surface.normal, graph, true, nullptr);
  std::vector<std::uint32_t> forward(64);
  std::iota(forward.begin(), forward.end(), 0U);
  forward[40] = 39;  // another pair
  forward[5] = 4;    // the pair of the row
  std::vector<std::uint32_t> mate(64, kNoNode);
  mate[4] = 5;
  const std::uint32_t live[] = {4, 20};
  on_every_instruction_set([&] {
    for (const std::uint32_t count : {4U, 16U}) {  // neighbours of each
      std::vector<ContractionRow> rows(64);
      std::vector<std::uint32_t> expected;
      for (std::uint32_t s = 0; s < kRowNeighbors; ++s) {
        rows[4].neighbor[s] = s < count ? 37 + s : 4;
        rows[5].neighbor[s] = s < count ? (s == 0 ? 4 : 39 + s) : 5;
        rows[20].neighbor[s] = s == 0 ? 40 : 20;
      }
      for (const std::uint32_t old : {4U, 5U}) {
        for (const std::uint32_t entry : rows[old].neighbor) {
          const std::uint32_t now = forward[entry];
          if (now != 4 && std::find(expected.begin(), expected.end(), now) == expected.end()) {
            expected.push_back(now);
          }
        }
      }
      if (expected.size() > kRowNeighbors) {
        const auto distance = [&](std::uint32_t i) {
          return (surface.position[i] - surface.position[4]).squaredNorm();
        };
        std::stable_sort(expected.begin(), expected.end(),
                         [&](std::uint32_t u, std::uint32_t v) { return distance(u) < distance(v); });
        expected.resize(kRowNeighbors);
      }
      std::uint8_t length[2] = {};
      POINTWRIGHT_KERNEL(merge_rows_kernel)
      ({.nodes = nodes.data(),
        .forward = forward.data(),
        .live = live,
        .mate = mate.data(),
        .rows = rows[0].neighbor,
        .length = length},
       0, 2);
      CHECK(length[0] == expected.size());
      std::sort(expected.begin(), expected.end());
      std::vector<std::uint32_t> found(rows[4].neighbor, rows[4].neighbor + length[0]);
      std::sort(found.begin(), found.end());
      CHECK(found == expected);
      CHECK(std::all_of(rows[4].neighbor + length[0], rows[4].neighbor + kRowNeighbors,
                        [](std::uint32_t i) { return i == 4; }));
      CHECK(rows[20].neighbor[0] == 39);
      CHECK(rows[20].neighbor[1] == 20);
    }
  });
}

}  // namespace
}  // namespace pointwright
