#include "server/access/accounts.h"

#include <algorithm>

namespace pointwright::server {

QuotaHold Accounts::hold(const std::string& owner, Quota quota, std::uint64_t amount, std::uint64_t limit) {
  const auto index = static_cast<std::size_t>(quota);
  {
    const std::lock_guard lock(book_->mutex);
    const auto it = book_->held.find(owner);
    const std::uint64_t held = it == book_->held.end() ? 0 : it->second[index];
    if (held > limit || amount > limit - held) return nullptr;
    book_->held[owner][index] += amount;
  }
  return {book_.get(), [book = book_, owner, index, amount](const void*) {
            const std::lock_guard lock(book->mutex);
            const auto it = book->held.find(owner);
            if (it == book->held.end()) return;  // of nothing
            it->second[index] -= amount;
            const auto& left = it->second;
            if (std::all_of(left.begin(), left.end(), [](std::uint64_t n) { return n == 0; }))
              book->held.erase(it);
          }};
}

std::uint64_t Accounts::held(const std::string& owner, Quota quota) const {
  const std::lock_guard lock(book_->mutex);
  const auto it = book_->held.find(owner);
  return it == book_->held.end() ? 0 : it->second[static_cast<std::size_t>(quota)];
}

}  // namespace pointwright::server
