#include "server/sessions/history.h"

#include <iterator>

namespace pointwright::server {

History::History(SurfaceState rest, std::uint64_t budget_bytes, Replay replay)
    : budget_bytes_(budget_bytes), replay_(std::move(replay)) {
  states_.emplace(0, std::move(rest));
}

std::uint64_t History::memory() const {
  return states_memory() + marks_memory();
}

std::uint64_t History::marks_memory() const {
  // Edits of one painting follow each other and share its marks: a later painting has marks of its own.
  std::uint64_t bytes = 0;
  const Marks* counted = nullptr;
  for (const auto& edit : edits_) {
    if (edit->marks == nullptr || edit->marks.get() == counted) continue;
    counted = edit->marks.get();
    bytes += counted->size();
  }
  return bytes;
}

std::uint64_t History::states_memory() const {
  std::uint64_t bytes = 0;
  for (const auto& entry : states_) bytes += memory_of(entry.second);
  return bytes;
}

void History::push(std::shared_ptr<const RecordedEdit> edit, SurfaceState after) {
  edits_.resize(head_);
  states_.erase(states_.upper_bound(head_), states_.end());
  edits_.push_back(std::move(edit));
  ++head_;
  states_.insert_or_assign(head_, std::move(after));
  trim();
}

void History::replace_current(SurfaceState state) {
  states_.at(head_) = std::move(state);
}

Result<void> History::move_head(std::size_t edit) {
  POINTWRIGHT_CHECK(edit <= edits_.size(), "the head can only move to recorded edits");
  auto nearest = std::prev(states_.upper_bound(edit));
  SurfaceState state = nearest->second;
  for (std::size_t i = nearest->first; i < edit; ++i) {
    auto next = replay_(state, *edits_[i]);
    if (!next) return next.error();
    state = std::move(next).value();
  }
  head_ = edit;
  states_.insert_or_assign(edit, std::move(state));
  trim();
  return {};
}

void History::trim() {
  // The state that is cheapest to lose goes first: replaying what it spans, weighed by how far from the head
  // it is. So the stored states thin out with their distance, and undoing the last edits stays immediate.
  const std::uint64_t marks = marks_memory();
  while (marks + states_memory() > budget_bytes_) {
    auto victim = states_.end();
    double least_cost = 0.0;
    for (auto it = std::next(states_.begin()); it != states_.end(); ++it) {
      if (it->first == head_) continue;
      const auto after = std::next(it);
      const double span = static_cast<double>((after == states_.end() ? edits_.size() + 1 : after->first) -
                                              std::prev(it)->first);
      const double distance = static_cast<double>(it->first > head_ ? it->first - head_ : head_ - it->first);
      if (victim == states_.end() || span / distance < least_cost) {
        victim = it;
        least_cost = span / distance;
      }
    }
    if (victim == states_.end()) return;
    states_.erase(victim);
  }
}

}  // namespace pointwright::server
