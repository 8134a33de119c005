#pragma once
// The edits of a session and the way back and forth between them: stored states within a byte budget, replay
// elsewhere.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "server/sessions/surface_state.h"

namespace pointwright::server {

using EditList = std::vector<std::shared_ptr<const RecordedEdit>>;

/// Not thread-safe: used on its session's strand.
class History {
 public:
  /// The state after an edit, from the state before it.
  using Replay = std::function<Result<SurfaceState>(const SurfaceState&, const RecordedEdit&)>;

  History(SurfaceState rest, std::uint64_t budget_bytes, Replay replay);

  [[nodiscard]] std::size_t head() const { return head_; }
  [[nodiscard]] const EditList& edits() const { return edits_; }
  [[nodiscard]] const SurfaceState& current() const { return states_.at(head_); }
  /// Bytes of the stored states and of the recorded paintings.
  [[nodiscard]] std::uint64_t memory() const;
  [[nodiscard]] std::size_t stored_states() const { return states_.size(); }

  /// Records an edit after the head. What was undone before is forgotten.
  void push(std::shared_ptr<const RecordedEdit> edit, SurfaceState after);
  /// Puts an equal state with more valid levels in place of the current one.
  void replace_current(SurfaceState state);
  /// Goes to the state after `edit` edits, from the nearest stored state before it.
  /// Pre:    edit <= edits().size()
  /// Errors: those of the replay; the head then stays where it was
  Result<void> move_head(std::size_t edit);

 private:
  void trim();
  [[nodiscard]] std::uint64_t states_memory() const;
  [[nodiscard]] std::uint64_t marks_memory() const;

  std::uint64_t budget_bytes_;
  Replay replay_;
  EditList edits_;
  std::size_t head_ = 0;
  std::map<std::size_t, SurfaceState> states_;  // by number of edits; 0 and the head are always there
};

}  // namespace pointwright::server
