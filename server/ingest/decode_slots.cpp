#include "server/ingest/decode_slots.h"

namespace pointwright {

DecodeSlots::Lease DecodeSlots::acquire(std::chrono::duration<double> patience) {
  std::unique_lock lock(mutex_);
  if (!freed_.wait_for(lock, patience, [&] { return free_ > 0; })) return {};
  --free_;
  return Lease(this);
}

void DecodeSlots::release() {
  {
    const std::lock_guard lock(mutex_);
    ++free_;
  }
  freed_.notify_one();
}

}  // namespace pointwright
