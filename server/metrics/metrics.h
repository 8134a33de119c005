#pragma once
// Counters and histograms of the whole process, as Prometheus reads them. Counting takes no lock.

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/http_server.h"

namespace pointwright::server {

/// How often values fell below each of a few fixed borders. Thread-safe, without locks.
class Histogram {
 public:
  /// Seconds.
  static constexpr std::array kBorders = {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25,
                                          0.5,   1.0,    2.5,   5.0,  10.0,  30.0, 60.0};
  void add(double seconds);
  /// Appends the lines of one histogram; `labels`: without braces, may be empty.
  void write(std::string& text, std::string_view name, std::string_view labels) const;

 private:
  std::array<std::atomic<std::uint64_t>, kBorders.size() + 1> counts_{};
  std::atomic<std::uint64_t> sum_us_{0};
};

/// One value at the time of asking.
struct Gauge {
  std::string_view name;
  std::string_view help;
  std::string labels;  ///< without braces; empty: none
  double value = 0.0;
};

/// Thread-safe.
class Metrics {
 public:
  /// `routes`: every "METHOD pattern" that can be asked for; others count as "none".
  explicit Metrics(const std::vector<std::string>& routes);

  /// One request that has been answered, with the times that its Server-Timing told.
  void count_request(const RequestLog& request);
  /// How long a step of work took: decode, encode, or what sessions measure.
  void add_time(std::string_view step, double seconds);
  void count_frame(std::uint64_t bytes, std::uint64_t passed_over);

  /// The exposition format 0.0.4, the gauges after what is counted here.
  [[nodiscard]] std::string text(const std::vector<Gauge>& gauges) const;

 private:
  static constexpr int kLeastStatus = 100;
  static constexpr std::size_t kStatuses = 500;
  using Statuses = std::array<std::atomic<std::uint64_t>, kStatuses>;

  std::map<std::string, std::unique_ptr<Statuses>, std::less<>> requests_;  // the keys never change
  std::map<std::string, Histogram, std::less<>> steps_;                     // nor do these
  Histogram durations_;
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::uint64_t> frames_{0};
  std::atomic<std::uint64_t> frame_bytes_{0};
  std::atomic<std::uint64_t> frames_passed_over_{0};
};

/// Bytes of memory that the process has; 0 where the system does not tell.
std::uint64_t resident_bytes();
/// Bytes that the file system of a folder has left for us; 0 where there is none.
std::uint64_t free_bytes(const std::string& folder);

}  // namespace pointwright::server
