// Order, neighbourhoods, normals and their sides: what every session starts with.
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"
#include "engine/spatial/block_tree.h"
#include "engine/spatial/coherent_order.h"
#include "engine/spatial/kd_tree.h"
#include "engine/spatial/neighbor_graph.h"
#include "engine/spatial/radius_graph.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

constexpr std::uint32_t kNeighbors = 10;

Points ordered_positions(const Points& points) {
  const std::vector<std::uint32_t> order = coherent_order(points);
  Points ordered(order.size());
  parallel_for(order.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ordered.set(i, points[order[i]]);
  });
  return ordered;
}

// From samples in random order.
void bench_raw(BenchReport& report) {
  if (!report.wants("kdtree.build.500k") && !report.wants("normals.raw.500k")) return;
  const Cloud scan = synthetic_scan(500'000);
  // What build_neighbor_graph searches: the order of the samples and the boxes over it.
  report.time("kdtree.build.500k", "ms", 500'000, [&] {
    const Points ordered = ordered_positions(scan.position);
    const BlockTree tree(ordered);
  });
  report.time("normals.raw.500k", "us/point", 500'000, [&] {
    const Points ordered = ordered_positions(scan.position);
    const NeighborGraph graph = build_neighbor_graph(ordered, kNeighbors);
    Points normal;
    estimate_normals(ordered, graph, {}, normal);
  });
}

// The peer: nanoflann's tree over the same samples in the same order, its building included.
void bench_kd_tree(BenchReport& report) {
  if (!report.wants("knn.nanoflann.500k")) return;
  const Cloud scan = ordered_scan(500'000);
  report.time("knn.nanoflann.500k", "us/point", 500'000, [&] {
    const KdTree tree(scan.position);
    parallel_for(scan.size(), [&](std::size_t begin, std::size_t end) {
      std::vector<Neighbor> found;
      for (std::size_t i = begin; i < end; ++i) tree.nearest(scan.position[i], kNeighbors + 1, found);
    });
  });
}

// A dozen neighbours a sample: a radius of two spacings, h^2 the area for each of n samples of the torus.
void bench_radius(BenchReport& report) {
  if (!report.wants("knn.radius.500k") && !report.wants("normals.radius.500k")) return;
  const Cloud scan = ordered_scan(500'000);
  const float radius = 2.0F * std::sqrt(15.8F / 500'000.0F);
  report.time("knn.radius.500k", "us/point", 500'000, [&] {
    if (!build_radius_graph(scan.position, {.radius = radius})) std::abort();
  });
  const auto graph = build_radius_graph(scan.position, {.radius = radius});
  Points normal;
  report.time("normals.radius.500k", "ns/point", 500'000,
              [&] { estimate_normals(scan.position, graph.value(), {}, normal); });
}

void bench_graph(BenchReport& report, std::size_t samples, const std::string& size) {
  const std::string knn = "knn.k10." + size;
  const std::string normals = "normals.k10." + size;
  const std::string orientation = "orient.k10." + size;
  if (!report.wants(knn) && !report.wants(normals) && !report.wants(orientation)) return;
  const auto n = static_cast<double>(samples);
  const Cloud scan = ordered_scan(samples);
  // The boxes are built inside: a graph is never wanted without them.
  report.time(knn, "us/point", n, [&] { build_neighbor_graph(scan.position, kNeighbors); });
  const NeighborGraph graph = build_neighbor_graph(scan.position, kNeighbors);
  Points normal;
  estimate_normals(scan.position, graph, {}, normal);
  report.time(normals, "ns/point", n, [&] { estimate_normals(scan.position, graph, {}, normal); });
  report.time(orientation, "ms", n, [&] {
    Points sided = normal;
    orient_normals(scan.position, graph, sided);
  });
}

}  // namespace

void bench_spatial(BenchReport& report) {
  bench_raw(report);
  bench_kd_tree(report);
  bench_radius(report);
  bench_graph(report, 150'000, "150k");
  bench_graph(report, 500'000, "500k");
  bench_graph(report, 2'000'000, "2m");
}

}  // namespace pointwright::bench
