// Simplification from raw points: ordering, neighbours and normals included; subsampling from coherent order.
#include <cstdlib>

#include "engine/normals/estimation.h"
#include "engine/simplification/simplification.h"
#include "engine/simplification/subsample.h"
#include "engine/spatial/coherent_order.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {

void bench_simplification(BenchReport& report) {
  struct Target {
    const char* name;
    std::size_t count;
  };
  constexpr std::size_t kSamples = 2'000'000;
  for (const Target& target : {Target{"simplify.2m.100k", 100'000}, Target{"simplify.2m.10k", 10'000}}) {
    if (!report.wants(target.name)) continue;
    const Cloud scan = synthetic_scan(kSamples);
    report.time(target.name, "ms", static_cast<double>(kSamples), [&] {
      const Cloud ordered = permuted(scan, coherent_order(scan.position));
      const NeighborGraph graph = build_neighbor_graph(ordered.position, 10);
      Points normal;
      estimate_normals(ordered.position, graph, {}, normal);
      // Estimated normals have no sides yet: sheets cannot be told apart by them.
      const auto simplified = simplify(ordered.position, normal, graph,
                                       {.target = KeepCount{target.count}, .separate_sheets = false});
      if (!simplified || simplified.value().kept.size() != target.count) std::abort();
    });
  }
  if (report.wants("subsample.2m.100k")) {
    const Cloud scan = ordered_scan(kSamples);
    report.time("subsample.2m.100k", "ms", static_cast<double>(kSamples), [&] {
      const auto kept = subsample(scan.position, scan.normal, {.target = KeepCount{100'000}});
      if (!kept || kept.value().size() != 100'000) std::abort();
    });
  }
}

}  // namespace pointwright::bench
