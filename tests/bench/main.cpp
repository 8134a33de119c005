// pointwright_bench [--out FILE] [--threads N] [FILTER]: runs the benchmarks whose name contains FILTER.
// With --job-growth FOLDER: jobs on 1, 10 and 100 million samples instead, and one of two processes, 8 GB of
// files below FOLDER.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "engine/core/parallel.h"
#include "tests/bench/benchmarks.h"

int main(int argc, char** argv) {
  std::string out = "build/bench.json";
  std::string filter;
  std::string growth;
  int threads = 0;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--out") == 0 && i + 1 < argc) {
      out = argv[++i];
    } else if (std::strcmp(argv[i], "--threads") == 0 && i + 1 < argc) {
      threads = std::atoi(argv[++i]);
#ifdef POINTWRIGHT_BENCH_HTTP
    } else if (std::strcmp(argv[i], "--job-growth") == 0 && i + 1 < argc) {
      growth = argv[++i];
#endif
    } else if (argv[i][0] == '-') {
      std::fprintf(stderr,
                   "usage: pointwright_bench [--out FILE] [--threads N] [--job-growth FOLDER] [FILTER]\n");
      return 2;
    } else {
      filter = argv[i];
    }
  }
  pointwright::bench::BenchReport report(filter);
  pointwright::with_threads(threads, [&] {
#ifdef POINTWRIGHT_BENCH_HTTP
    if (!growth.empty()) {
      pointwright::bench::bench_job_growth(report, {1'000'000, 10'000'000, 100'000'000}, growth);
      pointwright::bench::bench_job_ranks(report, 20'000'000, growth);
      return;
    }
#endif
    pointwright::bench::bench_spatial(report);
    pointwright::bench::bench_simplification(report);
    pointwright::bench::bench_smoothing(report);
    pointwright::bench::bench_multires(report);
    pointwright::bench::bench_editing(report);
    pointwright::bench::bench_frames(report);
    pointwright::bench::bench_resampling(report);
    pointwright::bench::bench_session(report);
    pointwright::bench::bench_undo(report);
#ifdef POINTWRIGHT_BENCH_HTTP
    pointwright::bench::bench_http(report);
    pointwright::bench::bench_jobs(report);
    pointwright::bench::bench_resampled_job(report);
    pointwright::bench::bench_packed_job(report);
#endif
  });
  if (!report.write_json(out)) {
    std::fprintf(stderr, "cannot write %s\n", out.c_str());
    return 1;
  }
  return 0;
}
