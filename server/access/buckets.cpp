#include "server/access/buckets.h"

#include <algorithm>
#include <limits>

namespace pointwright::server {

double Buckets::taken_at(const Bucket& bucket, double per_second, Clock::time_point now) {
  const double passed = std::chrono::duration<double>(now - bucket.seen).count();
  return std::max(bucket.taken - per_second * std::max(passed, 0.0), 0.0);
}

void Buckets::make_room(Clock::time_point now) {
  if (buckets_.size() < max_keys_) return;
  std::erase_if(buckets_, [&](const auto& entry) {
    return taken_at(entry.second, entry.second.per_second, now) <= 0.0;
  });
  // All are in use: the one that was quiet longest gives way.
  while (buckets_.size() >= max_keys_)
    buckets_.erase(std::min_element(buckets_.begin(), buckets_.end(), [](const auto& a, const auto& b) {
      return a.second.seen < b.second.seen;
    }));
}

double Buckets::take(const std::string& key, const Flow& flow, double amount, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  auto it = buckets_.find(key);
  if (it == buckets_.end()) {
    make_room(now);
    it = buckets_.emplace(key, Bucket{.taken = 0.0, .per_second = flow.per_second, .seen = now}).first;
  }
  Bucket& bucket = it->second;
  bucket.taken = taken_at(bucket, flow.per_second, now);
  bucket.per_second = flow.per_second;
  bucket.seen = now;
  if (bucket.taken + amount <= flow.capacity) {
    bucket.taken += amount;
    return 0.0;
  }
  if (amount > flow.capacity || flow.per_second <= 0.0) return std::numeric_limits<double>::infinity();
  return (bucket.taken + amount - flow.capacity) / flow.per_second;
}

double Buckets::taken(const std::string& key, const Flow& flow, Clock::time_point now) const {
  const std::lock_guard lock(mutex_);
  const auto it = buckets_.find(key);
  return it == buckets_.end() ? 0.0 : taken_at(it->second, flow.per_second, now);
}

}  // namespace pointwright::server
