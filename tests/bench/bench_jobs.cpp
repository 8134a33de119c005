// Full-resolution jobs, each in a process of its own as the daemon starts them: speed and memory.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

// Two edits over two bands; a third of the torus stays, a fifth moves rigidly, the rest is blended.
constexpr const char* kRecipe = R"({"format":"pointwright-recipe","version":1,"level_scales":[0.16,0.06,0],
"edits":[{"zero":{"operations":[{"mode":"add","shape":{"type":"box","min":[-3,-3,-3],"max":[-0.5,3,3]}}]},
"one":{"operations":[{"mode":"add","shape":{"type":"box","min":[0.8,-3,-3],"max":[3,3,3]}}]},
"level":0,"blend":"quartic","deformation":{"type":"translation","vector":[0.1,0,0.3]}},
{"level":1,"blend":"quartic","deformation":{"type":"rotation","axis":{"point":[0.8,0,0],
"direction":[0,1,0]},"angle_deg":25}}]})";

// Stretches two thirds of it, with samples inserted and collected.
constexpr const char* kPull = R"({"format":"pointwright-recipe","version":1,"level_scales":[0.16,0.06,0],
"edits":[{"zero":{"operations":[{"mode":"add","shape":{"type":"box","min":[-3,-3,-3],"max":[-0.5,3,3]}}]},
"one":{"operations":[{"mode":"add","shape":{"type":"box","min":[0.8,-3,-3],"max":[3,3,3]}}]},
"level":0,"blend":"quartic","deformation":{"type":"translation","vector":[1.5,0,0.3]},
"resampling":{"bound":1.5,"collect":0.6}}]})";

struct JobFigures {
  double seconds = 0.0;
  double cpu_seconds = 0.0;  // of all its threads
  double peak_mb = 0.0;      // MiB
  double made = 0.0;         // samples in the result
};

double cpu_of_children() {
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

class JobBench {
 public:
  explicit JobBench(const std::string& parent, const char* recipe = kRecipe)
      : folder_(parent + "/pointwright-bench-" + std::to_string(::getpid())) {
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ + "/recipe.json") << recipe;
  }
  ~JobBench() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  JobBench(const JobBench&) = delete;
  JobBench& operator=(const JobBench&) = delete;

  void scan(std::uint64_t n) const {
    if (!write_synthetic_scan(folder_ + "/in.ply", n)) throw std::runtime_error("cannot write " + folder_);
  }

  struct Way {
    std::string input = "in.ply";
    std::string output = "out.ply";
    int threads = thread_count();
    std::string launcher = {};  // before the command, with a blank behind it
  };
  [[nodiscard]] JobFigures run(const Way& way) const {
    const std::string command = way.launcher + "'" POINTWRIGHT_PATH "' job run --json --recipe '" + folder_ +
                                "/recipe.json' --in '" + folder_ + "/" + way.input + "' --out '" + folder_ +
                                "/" + way.output + "' --threads " + std::to_string(way.threads);
    const double cpu_before = cpu_of_children();
    std::FILE* const pipe = ::popen(command.c_str(), "r");  // NOLINT: a command line of our own
    if (pipe == nullptr) throw std::runtime_error("cannot start " POINTWRIGHT_PATH);
    std::string text;
    std::array<char, 4096> piece{};
    while (const std::size_t got = std::fread(piece.data(), 1, piece.size(), pipe))
      text.append(piece.data(), got);
    if (::pclose(pipe) != 0) throw std::runtime_error("the job failed");
    const auto report = nlohmann::json::parse(text);
    return {.seconds = report.at("seconds").get<double>(),
            .cpu_seconds = cpu_of_children() - cpu_before,
            .peak_mb = report.at("peak_memory_bytes").get<double>() / (1024.0 * 1024.0),
            .made = report.at("sample_count").get<double>() + report.at("inserted").get<double>() -
                    report.at("removed").get<double>()};
  }

 private:
  std::string folder_;
};

}  // namespace

void bench_jobs(BenchReport& report) {
  if (!report.wants("job.samples_per_s") && !report.wants("job.rss_mb")) return;
  constexpr std::uint64_t kSamples = 5'000'000;
  const JobBench bench(std::filesystem::temp_directory_path().string());
  bench.scan(kSamples);
  std::array<double, 3> seconds{};
  double peak_mb = 0.0;
  for (double& run : seconds) {
    const JobFigures figures = bench.run({});
    run = figures.seconds;
    peak_mb = std::max(peak_mb, figures.peak_mb);
  }
  std::ranges::sort(seconds);
  const auto n = static_cast<double>(kSamples);
  report.add("job.samples_per_s", "1/s", n, n / seconds[1]);
  report.add("job.rss_mb", "MB", n, peak_mb);
}

void bench_resampled_job(BenchReport& report) {
  if (!report.wants("job.resampled")) return;
  constexpr std::uint64_t kSamples = 5'000'000;
  const JobBench bench(std::filesystem::temp_directory_path().string(), kPull);
  bench.scan(kSamples);
  const JobFigures figures = bench.run({});
  const auto n = static_cast<double>(kSamples);
  report.add("job.resampled.samples_per_s", "1/s", n, n / figures.seconds);
  report.add("job.resampled.out_samples", "samples", n, figures.made);
  report.add("job.resampled.rss_mb", "MB", n, figures.peak_mb);
}

void bench_packed_job(BenchReport& report) {
  if (!report.wants("job.packed")) return;
  constexpr std::uint64_t kSamples = 5'000'000;
  const JobBench bench(std::filesystem::temp_directory_path().string());
  bench.scan(kSamples);
  const auto n = static_cast<double>(kSamples);
  const JobFigures packing = bench.run({.output = "out.zip"});
  report.add("job.packed.out.samples_per_s", "1/s", n, n / packing.seconds);
  report.add("job.packed.out.rss_mb", "MB", n, packing.peak_mb);
  const JobFigures unpacking = bench.run({.input = "out.zip"});
  report.add("job.packed.in.samples_per_s", "1/s", n, n / unpacking.seconds);
  report.add("job.packed.in.rss_mb", "MB", n, unpacking.peak_mb);
}

void bench_job_ranks(BenchReport& report, std::uint64_t size, const std::string& folder) {
#ifdef POINTWRIGHT_MPIEXEC
  if (!report.wants("job.ranks")) return;
  const JobBench bench(folder);
  bench.scan(size);
  const auto n = static_cast<double>(size);
  double alone = 0.0;
  for (const int ranks : {1, 2}) {
    const std::string launcher =
        "'" POINTWRIGHT_MPIEXEC "' --allow-run-as-root -n " + std::to_string(ranks) + " ";
    const JobFigures figures = bench.run({.threads = 1, .launcher = launcher});
    report.add("job.ranks." + std::to_string(ranks) + ".samples_per_s", "1/s", n, n / figures.seconds);
    if (ranks == 1)
      alone = figures.seconds;
    else
      report.add("job.ranks.speedup", "times", n, alone / figures.seconds);
  }
#else
  static_cast<void>(report);
  static_cast<void>(size);
  static_cast<void>(folder);
#endif
}

void bench_job_growth(BenchReport& report, const std::vector<std::uint64_t>& sizes,
                      const std::string& folder) {
  const JobBench bench(folder);
  double last_n = 0.0;
  double last_seconds = 0.0;
  double first_slope = 0.0;
  for (const std::uint64_t size : sizes) {
    const std::string label = "job." + std::to_string(size / 1'000'000) + "m.";
    if (!report.wants(label)) continue;
    bench.scan(size);
    const JobFigures figures = bench.run({});
    const auto n = static_cast<double>(size);
    report.add(label + "us_per_sample", "us/point", n, 1e6 * figures.seconds / n);
    report.add(label + "cpu_us_per_sample", "us/point", n, 1e6 * figures.cpu_seconds / n);
    report.add(label + "rss_mb", "MB", n, figures.peak_mb);
    // The preview costs the same whatever the size, so what counts is what each further sample takes.
    const double slope = 1e6 * (figures.seconds - last_seconds) / (n - last_n);
    if (last_n > 0.0) report.add(label + "us_per_further_sample", "us/point", n, slope);
    if (first_slope > 0.0)
      report.add(label + "off_linear", "%", n, 100.0 * (slope / first_slope - 1.0));
    else if (last_n > 0.0)
      first_slope = slope;
    last_n = n;
    last_seconds = figures.seconds;
  }
}

}  // namespace pointwright::bench
