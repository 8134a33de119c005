#pragma once
// Every area's benchmarks; main.cpp runs them all.

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

}  // namespace pointwright::bench
