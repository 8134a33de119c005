// Neighbours, normals, smoothing and decomposition: what a session is built of.
#include <numeric>

#include "engine/multires/base_surface.h"
#include "engine/multires/decomposition.h"
#include "engine/multires/hierarchy.h"
#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"
#include "engine/smoothing/umbrella.h"
#include "engine/spatial/coherent_order.h"
#include "engine/spatial/kd_tree.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

void bench_search(BenchReport& report) {
  if (report.wants("kdtree.build.500k") || report.wants("normals.raw.500k")) {
    const Cloud scan = synthetic_scan(500'000);
    report.time("kdtree.build.500k", "ms", 500'000, [&] {
      const std::vector<std::uint32_t> order = coherent_order(scan.position);
      Points ordered(order.size());
      for (std::size_t i = 0; i < order.size(); ++i) ordered.set(i, scan.position[order[i]]);
      const KdTree tree(ordered);
    });
    report.time("normals.raw.500k", "us/point", 500'000, [&] {
      const Cloud ordered = permuted(scan, coherent_order(scan.position));
      const NeighborGraph graph = build_neighbor_graph(ordered.position, 10);
      Points normal;
      estimate_normals(ordered.position, graph, {}, normal);
    });
  }
  // The tree is built inside: a graph is never wanted without it.
  for (const auto& [name, n] : {std::pair{"knn.k10.500k", 500'000}, std::pair{"knn.k10.2m", 2'000'000}}) {
    if (!report.wants(name)) continue;
    const Cloud scan = ordered_scan(static_cast<std::size_t>(n));
    report.time(name, "us/point", n, [&] { build_neighbor_graph(scan.position, 10); });
  }
}

struct Size {
  std::size_t samples;
  const char* normals;
  const char* orientation;
  const char* smoothing;
  const char* decomposition;
};

void bench_kernels(BenchReport& report, const Size& size) {
  if (!report.wants(size.normals) && !report.wants(size.decomposition) && !report.wants(size.orientation) &&
      !report.wants(size.smoothing)) {
    return;
  }
  const auto n = static_cast<double>(size.samples);
  const Cloud scan = ordered_scan(size.samples);
  const NeighborGraph graph = build_neighbor_graph(scan.position, 10);
  Points normal;
  estimate_normals(scan.position, graph, {}, normal);
  report.time(size.normals, "ns/point", n, [&] { estimate_normals(scan.position, graph, {}, normal); });
  report.time(size.orientation, "ms", n, [&] {
    Points sided = normal;
    orient_normals(scan.position, graph, sided);
  });
  orient_normals(scan.position, graph, normal);
  report.time(size.smoothing, "ms", n, [&] {
    const UmbrellaParams params{.preserve = VolumePreservation::kLocal, .iterations = 10};
    if (!smooth(scan.position, normal, graph, params)) std::abort();
  });
  const float diagonal = bounds_of(scan.position).diagonal();
  const ExecutionContext context;
  const std::vector<float> spacing = local_spacing(scan.position, graph);
  report.time(size.decomposition, "ms", n, [&] {
    const auto base = build_base_surface(scan.position, normal, scan.origin, 0.02F * diagonal, context);
    if (!base || !decompose(scan.position, normal, base.value(), spacing[0], {}, context)) std::abort();
  });
}

}  // namespace

void bench_multires(BenchReport& report) {
  bench_search(report);
  bench_kernels(
      report, {150'000, "normals.k10.150k", "orient.k10.150k", "smooth.10iterations.150k", "decompose.150k"});
  bench_kernels(report,
                {2'000'000, "normals.k10.2m", "orient.k10.2m", "smooth.10iterations.2m", "decompose.2m"});
}

}  // namespace pointwright::bench
