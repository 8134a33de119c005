#include "tests/bench/bench.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>

#include "engine/core/parallel.h"

namespace pointwright::bench {

bool BenchReport::wants(std::string_view name) const {
  return name.find(filter_) != std::string_view::npos;
}

void BenchReport::time(const std::string& name, const std::string& unit, double work_items,
                       const std::function<void()>& work) {
  if (!wants(name)) return;
  using Clock = std::chrono::steady_clock;
  const auto run_ms = [&] {
    const auto start = Clock::now();
    work();
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  };
  const double warm_up = run_ms();
  const int runs = warm_up > 2000.0 ? 3 : 7;
  std::vector<double> times;
  for (int i = 0; i < runs; ++i) times.push_back(run_ms());
  std::sort(times.begin(), times.end());
  const double median = times[times.size() / 2];
  const double scale = unit == "us/point" ? 1e3 / work_items : unit == "ns/point" ? 1e6 / work_items : 1.0;
  add(name, unit, work_items, median * scale);
}

void BenchReport::record(const std::string& name, const std::string& unit, double work_items, double value) {
  rows_.push_back({name, value, unit, static_cast<std::size_t>(work_items), thread_count()});
}

void BenchReport::add(const std::string& name, const std::string& unit, double work_items, double value) {
  if (!wants(name)) return;
  record(name, unit, work_items, value);
  std::printf("%-32s %12.3f %-10s n = %zu, %d threads\n", name.c_str(), value, unit.c_str(), rows_.back().n,
              rows_.back().threads);
  std::fflush(stdout);
}

bool BenchReport::write_json(const std::string& path) const {
  std::ofstream out(path);
  out << "[\n";
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    out << "  {\"name\": \"" << row.name << "\", \"value\": " << row.value << ", \"unit\": \"" << row.unit
        << "\", \"n\": " << row.n << ", \"threads\": " << row.threads << "}"
        << (i + 1 < rows_.size() ? "," : "") << "\n";
  }
  out << "]\n";
  return static_cast<bool>(out.flush());
}

}  // namespace pointwright::bench
