#pragma once
// Answers to requests with an Idempotency-Key: asked again within a day, a request has no second effect.

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>

#include "server/sessions/keeper.h"
#include "server/store/database.h"

namespace pointwright::server {

/// Thread-safe.
class Answers {
 public:
  /// `most`: so many are kept at once.
  Answers(Database& database, std::uint64_t most) : database_(database), most_(most) {}

  /// The request is under way as long as it lives.
  using Turn = std::shared_ptr<const void>;
  /// Its first answer; or a turn to answer it now.
  using Claim = std::variant<KeptAnswer, Turn>;
  /// Where as many are kept as may be, those are forgotten first that came first, of whoever has most.
  /// Problems: the key came with another request, the first one is still under way
  Outcome<Claim> claim(const std::string& caller, const std::string& key, const std::string& fingerprint);
  /// Whether a request with the key has been answered, or is being answered: one more needs nothing of what
  /// the first one took.
  [[nodiscard]] bool has(const std::string& caller, const std::string& key);
  /// Keeps an answer as part of a change; one that is there already stays.
  static void put(Database::Access& access, const KeptAnswer& answer);
  /// Keeps an answer by itself.
  Outcome<Done> put(const KeptAnswer& answer);

 private:
  using Name = std::pair<std::string, std::string>;
  struct UnderWay {
    std::mutex mutex;  // guards names
    std::set<Name> names;
  };
  [[nodiscard]] std::optional<KeptAnswer> find(const std::string& caller, const std::string& key);

  /// For one more answer of the caller.
  Outcome<Done> make_room(const std::string& caller);

  Database& database_;
  const std::uint64_t most_;
  std::mutex room_mutex_;              // guards bound_
  std::optional<std::int64_t> bound_;  // no more answers than this are there, those that are due included
  std::shared_ptr<UnderWay> under_way_ = std::make_shared<UnderWay>();
};

}  // namespace pointwright::server
