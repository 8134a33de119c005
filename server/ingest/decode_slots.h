#pragma once
// How many decoders may run at once: a counting semaphore that can be waited for with a deadline.

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

namespace pointwright {

class DecodeSlots {
 public:
  explicit DecodeSlots(int count) : free_(count) {}

  /// One slot, held until the lease ends; an empty lease where none came free in time.
  class Lease {
   public:
    Lease() = default;
    explicit Lease(DecodeSlots* slots) : slots_(slots) {}
    Lease(Lease&& other) noexcept : slots_(std::exchange(other.slots_, nullptr)) {}
    Lease& operator=(Lease&& other) noexcept {
      std::swap(slots_, other.slots_);
      return *this;
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    ~Lease() {
      if (slots_ != nullptr) slots_->release();
    }
    explicit operator bool() const { return slots_ != nullptr; }

   private:
    DecodeSlots* slots_ = nullptr;
  };

  Lease acquire(std::chrono::duration<double> patience);

 private:
  void release();

  std::mutex mutex_;
  std::condition_variable freed_;
  int free_;  // guarded by mutex_
};

}  // namespace pointwright
