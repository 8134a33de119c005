#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "engine/normals/estimation.h"
#include "tests/bench/peers/comparison.h"
#include "tests/support/surfaces.h"

namespace pointwright::peers {
namespace {

using Run = std::function<void(double, Points&)>;

constexpr std::uint32_t kNeighbors = 10;

double timed_ms(const Run& run, double parameter, Points& result) {
  const auto start = std::chrono::steady_clock::now();
  run(parameter, result);
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// A median of three where that is quick.
double median_ms(const Run& run, double parameter, Points& result) {
  std::vector<double> ms{timed_ms(run, parameter, result)};
  while (ms.size() < 3 && ms.front() < 2000.0) ms.push_back(timed_ms(run, parameter, result));
  std::sort(ms.begin(), ms.end());
  return ms[ms.size() / 2];
}

double first_guess(Control control, const Model& model, std::size_t count) {
  switch (control) {
    case Control::kCell:
      return static_cast<double>(bounds_of(model.samples).diagonal()) / std::sqrt(static_cast<double>(count));
    case Control::kCluster:
      return static_cast<double>(model.samples.size()) / static_cast<double>(count);
    default:
      return static_cast<double>(count);
  }
}

// The parameter that leaves a count nearest to the wanted one: bracketed, then halved in logarithms.
double matched(Control control, const Run& run, const Model& model, std::size_t count) {
  double guess = first_guess(control, model, count);
  if (control == Control::kCount) return guess;
  const auto wanted = static_cast<double>(count);
  double best = guess;
  double least = HUGE_VAL;
  double small = 0.0;  // leaves more than wanted
  double large = 0.0;  // leaves fewer
  Points result;
  for (int trial = 0; trial < 22 && least > 0.001 * wanted; ++trial) {
    run(guess, result);
    const double off = static_cast<double>(result.size()) - wanted;
    if (std::abs(off) < least) {
      least = std::abs(off);
      best = guess;
    }
    (off > 0.0 ? small : large) = guess;
    guess = small == 0.0 ? large / 1.6 : large == 0.0 ? small * 1.6 : std::sqrt(small * large);
    if (control == Control::kCluster && small != 0.0 && large != 0.0 && large - small < 1.0) break;
  }
  return best;
}

test::DistanceSummary in_millionths(const std::vector<double>& distances, double diagonal) {
  test::DistanceSummary summary = test::summarized(distances);
  for (double* value : {&summary.mean, &summary.rms, &summary.max}) *value *= 1e6 / diagonal;
  return summary;
}

Simplified measured(const Simplifier& method, const Model& model, const test::Surface& original,
                    std::size_t count) {
  const Run run = method.load(model);
  const double parameter = matched(method.control, run, model, count);
  Simplified result;
  result.method = method.name;
  Points left;
  result.ms = median_ms(run, parameter, left);
  result.count = left.size();
  const auto diagonal = static_cast<double>(bounds_of(model.samples).diagonal());
  result.to_set =
      in_millionths(test::distances_to_discs(original.position, original.normal, left,
                                             test::discs_over(left, original.position, original.normal)),
                    diagonal);
  result.to_surface =
      in_millionths(model.distance ? test::distances_to(left, model.distance)
                                   : test::distances_to_quadratic_fit(left, original.position),
                    diagonal);
  return result;
}

void record(const std::string& prefix, const Simplified& row, bench::BenchReport& report) {
  const std::string name = prefix + "." + row.method;
  const auto n = static_cast<double>(row.count);
  report.record(name + ".time", "ms", n, row.ms);
  const auto distances = [&](const std::string& direction, const test::DistanceSummary& summary) {
    report.record(name + direction + ".mean", "ppm", n, summary.mean);
    report.record(name + direction + ".rms", "ppm", n, summary.rms);
    report.record(name + direction + ".max", "ppm", n, summary.max);
  };
  distances(".to_set", row.to_set);
  distances(".to_surface", row.to_surface);
}

}  // namespace

std::vector<Simplified> compare_simplifiers(std::span<const Library> libraries, const Model& model,
                                            std::size_t count, bench::BenchReport& report) {
  const std::string name =
      "simplify." + model.name + "." + std::to_string(model.samples.size()) + "." + std::to_string(count);
  std::vector<Simplified> results;
  if (!report.wants(name)) return results;
  std::printf("\n%s: %zu samples to %zu; distances in millionths of the diagonal\n", model.name.c_str(),
              model.samples.size(), count);
  std::printf("  %-30s %8s %9s   %27s   %27s\n", "", "", "", "originals to simplified set",
              "simplified to surface");
  std::printf("  %-30s %8s %9s   %8s %8s %9s   %8s %8s %9s\n", "method", "samples", "ms", "mean", "rms",
              "max", "mean", "rms", "max");
  test::Surface original{test::coherent(model.samples), {}};
  estimate_normals(original.position, build_neighbor_graph(original.position, kNeighbors), {},
                   original.normal);
  for (const Library& library : libraries) {
    for (const Simplifier& method : library.simplifiers) {
      if (method.wants_mesh && model.mesh.triangle.empty()) continue;
      if (model.samples.size() > method.most_samples) {
        std::printf("  %-30s takes minutes on so many samples\n", method.name.c_str());
        continue;
      }
      const Simplified row = measured(method, model, original, count);
      std::printf("  %-30s %8zu %9.1f   %8.2f %8.2f %9.1f   %8.2f %8.2f %9.1f\n", row.method.c_str(),
                  row.count, row.ms, row.to_set.mean, row.to_set.rms, row.to_set.max, row.to_surface.mean,
                  row.to_surface.rms, row.to_surface.max);
      std::fflush(stdout);
      record(name, row, report);
      results.push_back(row);
    }
  }
  return results;
}

}  // namespace pointwright::peers
