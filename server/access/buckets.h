#pragma once
// Token buckets: how often, and how much a time.

#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>
#include <string>

namespace pointwright::server {

/// Many buckets by key, each as full as it can be when it is first asked for. Thread-safe; holds a bounded
/// number of keys: buckets that are full again are forgotten first.
class Buckets {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Buckets(std::size_t max_keys) : max_keys_(max_keys) {}

  struct Flow {
    double capacity = 0.0;
    double per_second = 0.0;
  };
  /// Takes the amount where it is there. Returns 0, or else the seconds until it will be (infinite where the
  /// amount is beyond the capacity).
  double take(const std::string& key, const Flow& flow, double amount, Clock::time_point now = Clock::now());
  /// What is out of the bucket.
  [[nodiscard]] double taken(const std::string& key, const Flow& flow,
                             Clock::time_point now = Clock::now()) const;

 private:
  struct Bucket {
    double taken = 0.0;
    double per_second = 0.0;
    Clock::time_point seen;
  };
  static double taken_at(const Bucket& bucket, double per_second, Clock::time_point now);
  void make_room(Clock::time_point now);

  const std::size_t max_keys_;
  mutable std::mutex mutex_;  // guards buckets_
  std::map<std::string, Bucket> buckets_;
};

}  // namespace pointwright::server
