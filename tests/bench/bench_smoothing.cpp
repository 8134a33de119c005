// The umbrella operator and the V-cycle.
#include <cstdlib>

#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"
#include "engine/smoothing/umbrella.h"
#include "engine/smoothing/umbrella_steps.h"
#include "engine/smoothing/v_cycle.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

struct Size {
  std::size_t samples;
  const char* compensated;  // one iteration, given neighbours and reverse neighbours
  const char* plain;
  const char* whole;  // ten compensated iterations with all that they need to be set up
};

void bench_iterations(BenchReport& report, const Size& size) {
  if (!report.wants(size.compensated) && !report.wants(size.plain) && !report.wants(size.whole)) return;
  const auto n = static_cast<double>(size.samples);
  const Cloud scan = ordered_scan(size.samples);
  const NeighborGraph graph = build_neighbor_graph(scan.position, 10);
  const ReverseNeighbors listers = reverse_neighbors(graph);
  const UmbrellaOperator umbrella{.graph = &graph};
  Packed points(scan.position);
  Packed other(scan.size());
  report.time(size.compensated, "ms", n, [&] { compensated_step(umbrella, listers, 0.5F, points, other); });
  report.time(size.plain, "ms", n, [&] { plain_step(umbrella, 0.5F, points, other); });
  report.time(size.whole, "ms", n, [&] {
    const UmbrellaParams params{.preserve = VolumePreservation::kLocal, .iterations = 10};
    if (!smooth(scan.position, {}, graph, params)) std::abort();
  });
}

struct Scan {
  Cloud cloud;
  NeighborGraph graph;
  Points normal;
};

Scan oriented_scan(std::size_t samples) {
  Scan scan{.cloud = ordered_scan(samples)};
  scan.graph = build_neighbor_graph(scan.cloud.position, 10);
  estimate_normals(scan.cloud.position, scan.graph, {}, scan.normal);
  orient_normals(scan.cloud.position, scan.graph, scan.normal);
  return scan;
}

void bench_v_cycle(BenchReport& report) {
  const auto hierarchy_of = [](const Scan& scan, float scale) {
    return build_smoothing_hierarchy(scan.cloud.position, scan.normal, scan.graph, scale,
                                     contracting_coarsener());
  };
  const auto time_cycle = [&](const char* name, const Scan& scan, const SmoothingHierarchy& hierarchy,
                              const VCycleParams& params) {
    report.time(name, "ms", static_cast<double>(scan.cloud.size()), [&] {
      if (!v_cycle(scan.cloud.position, scan.normal, scan.graph, hierarchy, params)) std::abort();
    });
  };
  if (report.wants("vcycle.500k.s1") || report.wants("vcycle.500k.s10")) {
    const Scan scan = oriented_scan(500'000);
    const auto hierarchy = hierarchy_of(scan, 0.2F);
    time_cycle("vcycle.500k.s1", scan, hierarchy.value(), {.scale = 0.02F});
    time_cycle("vcycle.500k.s10", scan, hierarchy.value(), {.scale = 0.2F});
  }
  if (report.wants("vcycle.2m") || report.wants("vcycle.2m.local") || report.wants("vcycle.build.2m")) {
    const Scan scan = oriented_scan(2'000'000);
    const float scale = 0.01F * bounds_of(scan.cloud.position).diagonal();
    const auto hierarchy = hierarchy_of(scan, scale);
    report.time("vcycle.build.2m", "ms", 2e6, [&] {
      if (!hierarchy_of(scan, scale)) std::abort();
    });
    report.add("vcycle.2m.bytes_per_sample", "B", 2e6,
               static_cast<double>(hierarchy.value().byte_count()) / 2e6);
    time_cycle("vcycle.2m", scan, hierarchy.value(), {.scale = scale});
    time_cycle("vcycle.2m.local", scan, hierarchy.value(),
               {.scale = scale, .preserve = VolumePreservation::kLocal});
  }
}

}  // namespace

void bench_smoothing(BenchReport& report) {
  bench_iterations(report,
                   {150'000, "smooth.iteration.150k", "smooth.plain.150k", "smooth.10iterations.150k"});
  bench_iterations(report, {2'000'000, "smooth.iteration.2m", "smooth.plain.2m", "smooth.10iterations.2m"});
  bench_v_cycle(report);
}

}  // namespace pointwright::bench
