// Draco bytes to a ready hierarchy of three bands: what opening a session costs.
#include <malloc.h>
#include <unistd.h>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "engine/io/cloud_io.h"
#include "engine/multires/hierarchy.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double total = 0.0;
  double resident = 0.0;
  statm >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

void bench_scan(BenchReport& report, const std::string& label, std::size_t n) {
  const std::string decode = "draco.decode." + label;
  const std::string shuffled = decode + ".random";
  const std::string session = "session." + label;
  if (!report.wants(shuffled) && !report.wants(session)) return;
  const Cloud scan = ordered_scan(n);
  const ImportParams params{};
  const auto written = [&](bool caller_order) {
    auto bytes = write_cloud(scan, CloudFormat::kDraco,
                             ExportParams{.caller_order = caller_order, .draco_position_bits = 14});
    if (!bytes) std::abort();
    return std::move(bytes).value();
  };
  // The caller's order is random. Whichever it is, the cloud is put in order as it is read.
  const std::vector<std::byte> random_order = written(true);
  const auto time_decoding = [&](const std::string& name, const std::vector<std::byte>& bytes) {
    report.time(name, "ms", static_cast<double>(n), [&] {
      if (!read_cloud(bytes, CloudFormat::kDraco, params)) std::abort();
    });
    report.add(name + ".bytes_per_sample", "B", static_cast<double>(n),
               static_cast<double>(bytes.size()) / static_cast<double>(n));
  };
  if (report.wants(shuffled)) {
    time_decoding(decode, written(false));
    time_decoding(shuffled, random_order);
  }
  const auto open = [&] {
    auto imported = read_cloud(random_order, CloudFormat::kDraco, params);
    if (!imported) std::abort();
    auto hierarchy =
        build_hierarchy(imported.value().cloud, HierarchyParams{.scales = kThreeScales}, ExecutionContext{});
    if (!hierarchy) std::abort();
    return std::pair(std::move(imported).value(), std::move(hierarchy).value());
  };
  report.time(session, "ms", static_cast<double>(n), [&] { open(); });
  // What the runs before freed would be taken again and never show.
  malloc_trim(0);
  const double before = resident_bytes();
  const auto kept = open();
  report.add(session + ".bytes_per_sample", "B", static_cast<double>(n),
             (resident_bytes() - before) / static_cast<double>(n));
}

}  // namespace

void bench_session(BenchReport& report) {
  bench_scan(report, "150k", 150'000);
  bench_scan(report, "2m", 2'000'000);
}

}  // namespace pointwright::bench
