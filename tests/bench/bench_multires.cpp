// Decomposition: what a session is built of.
#include <cstdlib>

#include "engine/multires/base_surface.h"
#include "engine/multires/decomposition.h"
#include "engine/multires/hierarchy.h"
#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

struct Size {
  std::size_t samples;
  const char* decomposition;
};

void bench_kernels(BenchReport& report, const Size& size) {
  if (!report.wants(size.decomposition)) return;
  const auto n = static_cast<double>(size.samples);
  const Cloud scan = ordered_scan(size.samples);
  const NeighborGraph graph = build_neighbor_graph(scan.position, 10);
  Points normal;
  estimate_normals(scan.position, graph, {}, normal);
  orient_normals(scan.position, graph, normal);
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
  bench_kernels(report, {150'000, "decompose.150k"});
  bench_kernels(report, {2'000'000, "decompose.2m"});
}

}  // namespace pointwright::bench
