#pragma once
// The edits of a session and the way back and forth between them: what each edit changed, within a byte
// budget; replay where that was dropped.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "engine/multires/surface_delta.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

using EditList = std::vector<std::shared_ptr<const RecordedEdit>>;

/// Not thread-safe: used on its session's strand. A copy shares the states and the steps, and goes its own
/// way.
class History {
 public:
  /// The state after an edit, from the state before it.
  using Replay = std::function<Result<SurfaceState>(const SurfaceState&, const RecordedEdit&)>;
  /// A state with all levels valid.
  using Derive = std::function<Result<SurfaceState>(const SurfaceState&)>;
  struct Work {
    Replay replay;
    Derive derive;
  };

  History(SurfaceState rest, std::uint64_t budget_bytes, Work work);

  [[nodiscard]] std::size_t head() const { return head_; }
  [[nodiscard]] const EditList& edits() const { return edits_; }
  [[nodiscard]] const SurfaceState& current() const { return current_; }
  /// Bytes of the whole states, the steps and the recorded paintings.
  [[nodiscard]] std::uint64_t memory() const;
  /// The rest and the current one included.
  [[nodiscard]] std::size_t whole_states() const;
  /// Edits that need no replay in either direction.
  [[nodiscard]] std::size_t kept_steps() const;

  /// Records an edit after the head. What was undone before is forgotten. The current state is then `after`,
  /// with the stale levels that replaying gives.
  /// Pre: `after` was made of current()
  void push(std::shared_ptr<const RecordedEdit> edit, SurfaceState after);
  /// Forgets the edits after the head.
  void forget_undone();
  /// Puts an equal state with all levels valid in place of the current one.
  void replace_current(SurfaceState derived);
  /// Goes to the state after `edit` edits on the cheapest way: over steps where they are kept, by replay from
  /// a whole state where not. Replayed steps are kept anew.
  /// Pre:    edit <= edits().size()
  /// Errors: those of the work; the head then stays where it was
  /// Cost:   a copy of a surface and the samples that the steps move
  Result<void> move_head(std::size_t edit);

  struct Known {
    std::size_t edit = 0;
    SurfaceState state;
  };
  /// The last state up to `edit` edits that is there without replaying anything. The head stays.
  [[nodiscard]] Known nearest_known(std::size_t edit) const;

 private:
  using SharedDelta = std::shared_ptr<const SurfaceDelta>;
  /// From one state to the next, which may have further samples.
  struct Step {
    SurfaceDelta delta;
    SharedSamples before;
    SharedSamples after;

    [[nodiscard]] std::uint64_t memory() const;  ///< with those samples that the one before lacks
  };
  using SharedStep = std::shared_ptr<const Step>;
  /// The state after an edit. An edit of a coarse level that was stale is made from the derived state, and
  /// its step leads from there. An edit that removed samples has no step.
  struct Node {
    SharedStep step = nullptr;  ///< from the node before
    bool from_derived = false;  ///< from the derived state of that node
    std::shared_ptr<const std::vector<DecompositionReport>> reports = nullptr;
    std::uint32_t first_valid_level = 0;
    SharedDelta derivation = nullptr;  ///< to the state with all levels valid
    std::shared_ptr<const std::vector<DecompositionReport>> derived_reports = nullptr;
    std::optional<SurfaceState> whole = std::nullopt;
  };
  /// Where a state stands: on a node, with the levels that the edit left or with all of them derived.
  struct Place {
    std::size_t node = 0;
    bool derived = false;
  };
  struct Start {
    Place place;
    const SurfaceState* state = nullptr;
  };
  class Walk;
  struct Victim;

  static SharedStep step_between(const SurfaceState& before, const SurfaceState& after);
  void keep_whole(std::size_t node, const SurfaceState& state, bool derived);
  [[nodiscard]] std::vector<Start> starts() const;
  /// What the way costs, in edits replayed; none where there is no way.
  [[nodiscard]] std::optional<double> cost_of_way(Place from, std::size_t edit) const;
  [[nodiscard]] bool pays_whole(std::size_t node) const;
  [[nodiscard]] std::uint64_t budget() const;
  void trim(std::size_t center);
  [[nodiscard]] Victim cheapest_to_lose(std::size_t center) const;
  [[nodiscard]] std::uint64_t states_memory() const;
  [[nodiscard]] std::uint64_t samples_memory() const;
  [[nodiscard]] std::uint64_t marks_memory() const;

  std::uint64_t budget_bytes_;
  Work work_;
  EditList edits_;
  std::vector<Node> nodes_;  // by number of edits; that of the rest is whole
  std::size_t head_ = 0;
  SurfaceState current_;
  bool derived_ = false;  // the current one has levels that were derived
};

}  // namespace pointwright::server
