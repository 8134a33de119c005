#include <algorithm>
#include <cstdlib>

#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"
#include "engine/simplification/simplification.h"
#include "engine/simplification/subsample.h"
#include "engine/spatial/coherent_order.h"
#include "tests/bench/peers/library.h"
#include "tests/support/surfaces.h"

namespace pointwright::peers {
namespace {

constexpr std::uint32_t kNeighbors = 10;

std::function<void(NeighborLists&)> load_search(const Points& points, std::uint32_t k) {
  return [&points, k](NeighborLists& lists) {
    const std::vector<std::uint32_t> order = coherent_order(points);
    const NeighborGraph graph = build_neighbor_graph(test::reordered(points, order), k);
    parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        std::uint32_t* list = lists.data() + order[i] * std::size_t{k};
        for (std::uint32_t j = 0; j < k; ++j) list[j] = order[graph.index(i, j)];
      }
    });
  };
}

std::function<void(Points&)> load_normals(const Points& points, std::uint32_t k) {
  return [&points, k](Points& normal) {
    const std::vector<std::uint32_t> order = coherent_order(points);
    const Points ordered = test::reordered(points, order);
    Points found;
    estimate_normals(ordered, build_neighbor_graph(ordered, k), {}, found);
    for (std::size_t i = 0; i < order.size(); ++i) normal.set(order[i], found[i]);
  };
}

Simplifier quadrics(const std::string& name, const SimplifyParams& params, std::size_t most) {
  return {.name = name,
          .control = Control::kCount,
          .most_samples = most,
          .load = [params](const Model& model) -> std::function<void(double, Points&)> {
            return [params, &model](double count, Points& result) {
              const Points ordered = test::coherent(model.samples);
              const NeighborGraph graph = build_neighbor_graph(ordered, kNeighbors);
              Points normal;
              estimate_normals(ordered, graph, {}, normal);
              orient_normals(ordered, graph, normal);
              SimplifyParams wanted = params;
              wanted.target = KeepCount{static_cast<std::size_t>(count)};
              auto simplified = simplify(ordered, normal, graph, wanted);
              if (!simplified) std::abort();
              result = std::move(simplified.value().position);
            };
          }};
}

Simplifier uniform_subset() {
  return {.name = "ours, uniform subset",
          .control = Control::kCount,
          .most_samples = kAnyCount,
          .load = [](const Model& model) -> std::function<void(double, Points&)> {
            return [&model](double count, Points& result) {
              const Points ordered = test::coherent(model.samples);
              auto chosen = subsample(ordered, {}, {.target = KeepCount{static_cast<std::size_t>(count)}});
              if (!chosen) std::abort();
              result.resize(chosen.value().size());
              for (std::size_t i = 0; i < result.size(); ++i) result.set(i, ordered[chosen.value()[i]]);
            };
          }};
}

Simplifier random_subset() {
  return {.name = "random subset",
          .control = Control::kCount,
          .most_samples = kAnyCount,
          .load = [](const Model& model) -> std::function<void(double, Points&)> {
            return [&model](double count, Points& result) {
              // Selection sampling (Knuth, The Art of Computer Programming 2, 3.4.2, algorithm S).
              test::Random random(3);
              auto left = static_cast<std::size_t>(count);
              result.resize(left);
              const std::size_t n = model.samples.size();
              for (std::size_t i = 0; i < n && left > 0; ++i) {
                if (random.below(n - i) < left) result.set(result.size() - left--, model.samples[i]);
              }
            };
          }};
}

}  // namespace

Library our_library() {
  return {
      .name = "ours",
      .version = "0.1",
      .searches = {{"ours", load_search}},
      .estimators = {{"ours", load_normals}},
      .simplifiers = {quadrics("ours", {}, kAnyCount),
                      quadrics("ours, greedy", {.order = ContractionOrder::kGreedy}, kAnyCount),
                      quadrics("ours, quadric minimum", {.placement = Placement::kQuadricMinimum}, kAnyCount),
                      quadrics("ours, even", {.length_weight = 0.05F}, kAnyCount), uniform_subset(),
                      random_subset()},
  };
}

}  // namespace pointwright::peers
