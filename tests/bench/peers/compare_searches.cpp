#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "tests/bench/peers/comparison.h"
#include "tests/bench/synthetic_scan.h"
#include "tests/support/surfaces.h"

namespace pointwright::peers {
namespace {

constexpr std::uint32_t kNeighbors = 10;
constexpr int kRounds = 7;

struct Contest {
  std::string name;
  std::function<void()> work;
  std::vector<double> ms;
};

// Turn by turn, so that what disturbs the machine disturbs all; a round to warm up is not counted.
void take_turns(std::vector<Contest>& contests) {
  using Clock = std::chrono::steady_clock;
  for (int round = 0; round <= kRounds; ++round) {
    for (Contest& contest : contests) {
      const auto start = Clock::now();
      contest.work();
      const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
      if (round > 0) contest.ms.push_back(ms);
    }
  }
  for (Contest& contest : contests) std::sort(contest.ms.begin(), contest.ms.end());
}

double mean_distance(const Points& points, const NeighborLists& lists) {
  double sum = 0.0;
  for (std::size_t e = 0; e < lists.size(); ++e) {
    sum += static_cast<double>((points[lists[e]] - points[e / kNeighbors]).norm());
  }
  return sum / static_cast<double>(lists.size());
}

void print_row(const std::string& name, const std::string& order, const Contest& contest, std::size_t samples,
               double answer, const char* what, bench::BenchReport& report) {
  const double us = 1e3 * contest.ms[kRounds / 2] / static_cast<double>(samples);
  std::printf("  %-20s %8.3f us/point   (%.3f to %.3f)   %s %.6g\n", contest.name.c_str(), us,
              1e3 * contest.ms.front() / static_cast<double>(samples),
              1e3 * contest.ms.back() / static_cast<double>(samples), what, answer);
  report.record(name + "." + order + "." + contest.name, "us/point", static_cast<double>(samples), us);
}

// What every library enters of one kind, each writing to `result`.
template <typename Entry, typename Answer>
std::vector<Contest> contests_of(std::span<const Library> libraries, std::vector<Entry> Library::*entries,
                                 const Points& points, Answer& result) {
  std::vector<Contest> contests;
  for (const Library& library : libraries) {
    for (const Entry& entry : library.*entries) {
      contests.push_back(
          {entry.name, [&result, work = entry.load(points, kNeighbors)] { work(result); }, {}});
    }
  }
  return contests;
}

void search_in(const std::string& order, std::span<const Library> libraries, const Points& points,
               bench::BenchReport& report) {
  const std::string name = "knn.k10";
  if (!report.wants(name)) return;
  NeighborLists lists(points.size() * kNeighbors);
  std::vector<Contest> contests = contests_of(libraries, &Library::searches, points, lists);
  take_turns(contests);
  std::printf("\n%u nearest neighbours of %zu samples, %s order\n", kNeighbors, points.size(), order.c_str());
  for (Contest& contest : contests) {
    contest.work();
    print_row(name, order, contest, points.size(), mean_distance(points, lists), "mean distance", report);
  }
}

void normals_in(const std::string& order, std::span<const Library> libraries, const Points& points,
                bench::BenchReport& report) {
  const std::string name = "normals.k10";
  if (!report.wants(name)) return;
  Points normal(points.size());
  std::vector<Contest> contests = contests_of(libraries, &Library::estimators, points, normal);
  take_turns(contests);
  std::printf("\nnormals of %zu samples over %u neighbours, %s order\n", points.size(), kNeighbors,
              order.c_str());
  Points exact(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) exact.set(i, scan_normal(points[i].cast<double>()));
  for (Contest& contest : contests) {
    contest.work();
    const double degrees = test::mean_line_angle(normal, exact) * 180.0 / std::acos(-1.0);
    print_row(name, order, contest, points.size(), degrees, "mean error in degrees", report);
  }
}

}  // namespace

void compare_searches(std::span<const Library> libraries, std::size_t samples, bench::BenchReport& report) {
  const Points random = bench::synthetic_scan(samples).position;
  const Points ordered = bench::ordered_scan(samples).position;
  search_in("random", libraries, random, report);
  search_in("coherent", libraries, ordered, report);
  normals_in("random", libraries, random, report);
  normals_in("coherent", libraries, ordered, report);
}

}  // namespace pointwright::peers
