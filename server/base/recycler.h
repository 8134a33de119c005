#pragma once
// Large objects that are made over and over: their memory goes round instead of back to the system, whose
// fresh pages cost more than filling them does.

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace pointwright::server {

/// Thread-safe. Objects that outlive it are destroyed as usual.
template <typename T>
class Recycler {
 public:
  /// Keeps at most `kept` objects that nobody uses.
  explicit Recycler(std::size_t kept) : home_(std::make_shared<Home>(kept)) {}

  /// An object as it was when it was dropped; null where none is there.
  [[nodiscard]] std::unique_ptr<T> take() {
    const std::lock_guard lock(home_->mutex);
    if (home_->unused.empty()) return nullptr;
    auto object = std::move(home_->unused.back());
    home_->unused.pop_back();
    return object;
  }

  /// Shares an object that comes back here once nobody holds it any more.
  [[nodiscard]] std::shared_ptr<const T> share(std::unique_ptr<T> object) const {
    return {object.release(), [home = std::weak_ptr<Home>(home_)](T* dropped) {
              std::unique_ptr<T> owned(dropped);
              if (const auto still = home.lock()) still->give(std::move(owned));
            }};
  }

 private:
  struct Home {
    explicit Home(std::size_t count) : kept(count) { unused.reserve(kept); }  // so that give() cannot fail
    void give(std::unique_ptr<T> object) {
      const std::lock_guard lock(mutex);
      if (unused.size() < kept) unused.push_back(std::move(object));
    }

    const std::size_t kept;
    std::mutex mutex;  // guards unused
    std::vector<std::unique_ptr<T>> unused;
  };
  std::shared_ptr<Home> home_;
};

}  // namespace pointwright::server
