#pragma once
// A benchmark's notebook: medians of warm runs, as a table for people and as JSON for machines.

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace pointwright::bench {

/// One measured figure; `n` is how much work it stands for (samples, unless the name says otherwise).
struct Row {
  std::string name;
  double value = 0.0;
  std::string unit;
  std::size_t n = 0;
  int threads = 0;
};

class BenchReport {
 public:
  /// Only names that contain `filter` are measured; an empty one measures all.
  explicit BenchReport(std::string filter = {}) : filter_(std::move(filter)) {}

  [[nodiscard]] bool wants(std::string_view name) const;

  /// Median wall time of `work` over at least 7 runs (3 where one takes longer than 2 s) after a warm-up.
  /// unit: "ms" for the whole; "us/point", "ns/point" divide by work_items.
  void time(const std::string& name, const std::string& unit, double work_items,
            const std::function<void()>& work);

  /// A figure that was measured elsewhere, into the notebook alone.
  void record(const std::string& name, const std::string& unit, double work_items, double value);

  /// The same, and on the terminal.
  void add(const std::string& name, const std::string& unit, double work_items, double value);

  [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }
  /// Writes an array of {name, value, unit, n, threads}. Returns whether it could.
  [[nodiscard]] bool write_json(const std::string& path) const;

 private:
  std::string filter_;
  std::vector<Row> rows_;
};

}  // namespace pointwright::bench
