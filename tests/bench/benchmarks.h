#pragma once
// Every area's benchmarks; main.cpp runs them all.

#include <cstdint>
#include <string>
#include <vector>

#include "tests/bench/bench.h"

namespace pointwright::bench {

void bench_spatial(BenchReport& report);
void bench_multires(BenchReport& report);
void bench_simplification(BenchReport& report);
void bench_smoothing(BenchReport& report);
void bench_editing(BenchReport& report);
void bench_frames(BenchReport& report);
void bench_session(BenchReport& report);
void bench_undo(BenchReport& report);
void bench_resampling(BenchReport& report);
/// Only where the daemon is built.
void bench_http(BenchReport& report);
/// Likewise.
void bench_jobs(BenchReport& report);
/// Likewise. A job whose samples become more, and fewer again.
void bench_resampled_job(BenchReport& report);
/// Likewise. A job that writes Draco tiles, and one that reads them.
void bench_packed_job(BenchReport& report);
/// One process of one thread, and two of them under mpirun; nothing where the build has no MPI.
void bench_job_ranks(BenchReport& report, std::uint64_t size, const std::string& folder);
/// Likewise. Jobs on scans of these sizes, ascending, made and removed below `folder`: time and memory.
void bench_job_growth(BenchReport& report, const std::vector<std::uint64_t>& sizes,
                      const std::string& folder);

}  // namespace pointwright::bench
