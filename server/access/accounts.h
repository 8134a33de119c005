#pragma once
// What each token holds of what its quotas bound.

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "protocol/json/access.h"

namespace pointwright::server {

/// In the order of protocol::kQuotas.
enum class Quota {
  kSessions,
  kSamples,
  kStoredBytes,
  kUploadBytesPerDay,
  kStreams,
  kRequestsPerSecond,
  kJobs,
  kClouds,
  kImages
};
inline constexpr std::size_t kQuotaCount = protocol::kQuotas.size();

/// Parts of quotas, given back with the last copy.
using QuotaHold = std::shared_ptr<const void>;

struct QuotaPart {
  Quota quota;
  std::uint64_t amount;
};

/// Thread-safe; holds may outlive it.
class Accounts {
 public:
  /// Null where the owner would then hold more than `limit`.
  [[nodiscard]] QuotaHold hold(const std::string& owner, Quota quota, std::uint64_t amount,
                               std::uint64_t limit);
  [[nodiscard]] std::uint64_t held(const std::string& owner, Quota quota) const;

 private:
  struct Book {
    std::mutex mutex;  // guards held
    std::map<std::string, std::array<std::uint64_t, kQuotaCount>> held;
  };
  std::shared_ptr<Book> book_ = std::make_shared<Book>();
};

}  // namespace pointwright::server
