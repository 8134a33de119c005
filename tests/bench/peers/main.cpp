// pointwright_bench_peers [--out FILE] [--threads N] [--samples N | --scan FILE] [FILTER]: measures this
// engine and other libraries beside each other.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>

#include "engine/core/parallel.h"
#include "engine/io/cloud_io.h"
#include "tests/bench/peers/comparison.h"

namespace pointwright::peers {
namespace {

struct Options {
  std::string out = "build/bench-peers.json";
  std::string filter;
  std::string scan;
  std::size_t samples = 0;  // of the models, instead of what is given below
  int threads = 2;
};

std::optional<Options> parsed(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--out") == 0 && has_value) {
      options.out = argv[++i];
    } else if (std::strcmp(argv[i], "--threads") == 0 && has_value) {
      options.threads = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--scan") == 0 && has_value) {
      options.scan = argv[++i];
    } else if (std::strcmp(argv[i], "--samples") == 0 && has_value) {
      options.samples = static_cast<std::size_t>(std::max(0LL, std::atoll(argv[++i])));
    } else if (argv[i][0] == '-') {
      return std::nullopt;
    } else {
      options.filter = argv[i];
    }
  }
  return options;
}

std::vector<Library> libraries() {
  std::vector<Library> result{our_library(), nanoflann_library()};
#ifdef POINTWRIGHT_PEER_CGAL
  result.push_back(cgal_library());
#endif
#ifdef POINTWRIGHT_PEER_PCL
  result.push_back(pcl_library());
#endif
#ifdef POINTWRIGHT_PEER_OPEN3D
  result.push_back(open3d_library());
#endif
  return result;
}

// A real scan in its file's order; nobody knows its surface.
std::optional<Model> read_model(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const auto bytes = std::as_bytes(std::span(text));
  const auto format = detect_format(bytes);
  if (!format) return std::nullopt;
  const auto imported = read_cloud(bytes, format.value(), {});
  if (!imported) return std::nullopt;
  Model model;
  model.name = path.substr(path.find_last_of('/') + 1);
  model.samples = in_caller_order(imported.value().cloud).position;
  return model;
}

std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "an unknown processor";
}

// Of all processors' time since the start of the machine: what other machines took, and the whole.
std::pair<double, double> stolen_time() {
  std::ifstream stat("/proc/stat");
  std::string name;
  stat >> name;
  double whole = 0.0;
  double stolen = 0.0;
  double value = 0.0;
  for (int field = 0; field < 8 && stat >> value; ++field) {
    whole += value;
    if (field == 7) stolen = value;
  }
  return {stolen, whole};
}

// To a twentieth.
void compare(const Model& model, std::span<const Library> all, bench::BenchReport& report) {
  const std::size_t count = std::max<std::size_t>(1, model.samples.size() / 20);
  check_promises(model.name, compare_simplifiers(all, model, count, report), report);
}

int run(const Options& options) {
  bench::BenchReport report(options.filter);
  const std::vector<Library> all = libraries();
  std::printf("%s, %d threads;", processor().c_str(), thread_count());
  for (const Library& library : all) std::printf(" %s %s", library.name.c_str(), library.version.c_str());
  std::printf("\n");
  const auto [stolen_before, whole_before] = stolen_time();
  if (options.scan.empty()) {
    if (options.samples == 0) compare_searches(all, 500'000, report);
    const std::size_t samples = options.samples > 0 ? options.samples : 200'000;
    compare(scan_model(samples, 0.0), all, report);
    compare(scan_model(samples, 0.001), all, report);
    compare(steps_model(samples), all, report);
    if (options.samples == 0 && report.wants("simplify.scan.2000000.100000")) {
      compare(scan_model(2'000'000, 0.0), all, report);
    }
  } else {
    const auto model = read_model(options.scan);
    if (!model) {
      std::fprintf(stderr, "%s cannot be read\n", options.scan.c_str());
      return 1;
    }
    compare(*model, all, report);
  }
  const auto [stolen, whole] = stolen_time();
  std::printf("\nOther machines took %.1f %% of the processors' time.\n",
              100.0 * (stolen - stolen_before) / std::max(1.0, whole - whole_before));
  if (report.write_json(options.out)) return 0;
  std::fprintf(stderr, "cannot write %s\n", options.out.c_str());
  return 1;
}

}  // namespace
}  // namespace pointwright::peers

int main(int argc, char** argv) {
  const auto options = pointwright::peers::parsed(argc, argv);
  if (!options) {
    std::fprintf(
        stderr,
        "usage: pointwright_bench_peers [--out FILE] [--threads N] [--samples N | --scan FILE] [FILTER]\n");
    return 2;
  }
  int status = 0;
  pointwright::with_threads(options->threads, [&] { status = pointwright::peers::run(*options); });
  return status;
}
