#include "server/sessions/history.h"

#include <algorithm>
#include <bit>

#include "engine/core/parallel.h"

namespace pointwright::server {
namespace {

/// What getting a state back costs, in edits replayed: XORing a step is cheap, deriving levels is not.
constexpr double kStepCost = 0.05;
constexpr double kDerivationCost = 10.0;
/// A whole state is kept where the steps since the last one have grown to so many times its memory: it costs
/// little beside them, and whoever comes back from far away has no longer way than that.
constexpr std::uint64_t kStepsPerWhole = 4;
/// Steps that were dropped have no memory any more: after so many edits a whole state is kept in any case.
constexpr std::size_t kEditsPerWhole = 64;
/// Steps and whole states have room for so many surfaces, however much the paintings take.
constexpr std::uint64_t kLeastSurfaces = 4;
/// A replay of n edits leaves whole states n / 2, n / 4 and n / 8 edits before its end: going on in the same
/// direction replays less and less. Of shorter ways than this it leaves none.
constexpr std::size_t kLeastReplay = 8;

/// A copy of a large surface is mostly pages that are touched for the first time: all threads touch some.
std::shared_ptr<MultiresSurface> copy_of(const MultiresSurface& surface) {
  auto copy = std::make_shared<MultiresSurface>();
  const std::size_t levels = surface.levels.size();
  copy->levels.resize(levels);
  copy->detail.resize(surface.detail.size());
  parallel_for(
      2 * levels + surface.detail.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
          if (c < levels)
            copy->levels[c].position = surface.levels[c].position;
          else if (c < 2 * levels)
            copy->levels[c - levels].normal = surface.levels[c - levels].normal;
          else
            copy->detail[c - 2 * levels] = surface.detail[c - 2 * levels];
        }
      },
      1);
  return copy;
}

std::size_t distance(std::size_t a, std::size_t b) {
  return a > b ? a - b : b - a;
}

}  // namespace

/// A state on its way along the nodes.
class History::Walk {
 public:
  Walk(const std::vector<Node>& nodes, const Start& start) : nodes_(nodes), place_(start.place) {
    state_ = *start.state;
  }

  [[nodiscard]] Place place() const { return place_; }
  [[nodiscard]] const SurfaceState& state() const { return state_; }
  [[nodiscard]] SurfaceState release() { return std::move(state_); }

  void follow(const SurfaceDelta& delta, const SharedSamples& samples, Place to) {
    // The surface that a walk starts from is others' too; what the walk has made is its own.
    if (own_ == nullptr) own_ = copy_of(*state_.surface);
    delta.apply(*own_);
    const Node& node = nodes_[to.node];
    state_ = {.surface = own_,
              .reports = to.derived ? node.derived_reports : node.reports,
              .first_valid_level = to.derived ? 0 : node.first_valid_level,
              .samples = samples};
    place_ = to;
  }
  void jump(SurfaceState state, Place to) {
    own_.reset();
    state_ = std::move(state);
    place_ = to;
  }

  /// One edit back over the steps that are kept. Pre: they are.
  void step_back() {
    const Node& left = nodes_[place_.node];
    if (place_.derived) follow(*left.derivation, state_.samples, {.node = place_.node, .derived = false});
    follow(left.step->delta, left.step->before, {.node = place_.node - 1, .derived = left.from_derived});
  }
  /// To the side of the node that the next step starts from. Returns whether it got there.
  bool turn_to_next() {
    const bool derived = nodes_[place_.node + 1].from_derived;
    if (place_.derived == derived) return true;
    const auto& derivation = nodes_[place_.node].derivation;
    if (!derivation) return false;
    follow(*derivation, state_.samples, {.node = place_.node, .derived = derived});
    return true;
  }
  /// One edit on, where the step is kept. Returns whether it got there.
  bool step_on() {
    const auto& step = nodes_[place_.node + 1].step;
    if (!step) return false;
    follow(step->delta, step->after, {.node = place_.node + 1, .derived = false});
    return true;
  }

 private:
  const std::vector<Node>& nodes_;
  Place place_;
  SurfaceState state_;
  std::shared_ptr<MultiresSurface> own_;
};

/// What trimming may drop.
struct History::Victim {
  enum class Kind : std::uint8_t { kNone, kStep, kDerivation, kWhole };
  Kind kind = Kind::kNone;
  std::size_t node = 0;
  double worth = 0.0;
};

History::History(SurfaceState rest, std::uint64_t budget_bytes, Work work)
    : budget_bytes_(budget_bytes), work_(std::move(work)), current_(std::move(rest)) {
  nodes_.push_back(
      Node{.reports = current_.reports, .first_valid_level = current_.first_valid_level, .whole = current_});
}

std::uint64_t History::Step::memory() const {
  if (before == after) return delta.memory();
  SamplesMemory added(before);
  added.add(after);
  return delta.memory() + added.bytes();
}

std::uint64_t History::memory() const {
  return states_memory() + samples_memory() + marks_memory();
}

std::size_t History::whole_states() const {
  const auto wholes = static_cast<std::size_t>(
      std::count_if(nodes_.begin(), nodes_.end(), [](const Node& node) { return node.whole.has_value(); }));
  return wholes + (nodes_[head_].whole ? 0 : 1);
}

std::size_t History::kept_steps() const {
  return static_cast<std::size_t>(
      std::count_if(nodes_.begin(), nodes_.end(), [](const Node& node) { return node.step != nullptr; }));
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
  for (const Node& node : nodes_) {
    if (node.step) bytes += node.step->delta.memory();
    if (node.derivation) bytes += node.derivation->memory();
    if (node.whole) bytes += memory_of(*node.whole);
  }
  const auto& whole = nodes_[head_].whole;
  if (!whole || whole->surface != current_.surface) bytes += memory_of(current_);
  return bytes;
}

std::uint64_t History::samples_memory() const {
  // Those that the session starts with are as old as it is, and no part of its history.
  SamplesMemory memory(nodes_.front().whole->samples);
  for (const Node& node : nodes_) {
    if (node.step) {
      memory.add(node.step->before);
      memory.add(node.step->after);
    }
    if (node.whole) memory.add(node.whole->samples);
  }
  memory.add(current_.samples);
  return memory.bytes();
}

bool History::pays_whole(std::size_t node) const {
  std::uint64_t steps = 0;
  const std::size_t last = node;
  for (; !nodes_[node].whole; --node) {
    if (nodes_[node].step) steps += nodes_[node].step->memory();
    if (nodes_[node].from_derived && nodes_[node - 1].derivation)
      steps += nodes_[node - 1].derivation->memory();
  }
  return steps >= kStepsPerWhole * memory_of(current_) || last - node >= kEditsPerWhole;
}

History::SharedStep History::step_between(const SurfaceState& before, const SurfaceState& after) {
  const bool same = before.samples == after.samples;
  if (!same && !continues(*before.samples, *after.samples)) return nullptr;
  return std::make_shared<const Step>(Step{.delta = SurfaceDelta(*before.surface, *after.surface),
                                           .before = before.samples,
                                           .after = after.samples});
}

void History::keep_whole(std::size_t node, const SurfaceState& state, bool derived) {
  Node& kept = nodes_[node];
  if (kept.whole || (derived && !kept.derivation)) return;
  kept.whole = state;
  if (!derived) return;
  auto surface = copy_of(*state.surface);
  kept.derivation->apply(*surface);
  kept.whole->surface = std::move(surface);
  kept.whole->reports = kept.reports;
  kept.whole->first_valid_level = kept.first_valid_level;
}

void History::forget_undone() {
  edits_.resize(head_);
  nodes_.resize(head_ + 1);
}

void History::push(std::shared_ptr<const RecordedEdit> edit, SurfaceState after) {
  forget_undone();
  Node node{.step = step_between(current_, after)};
  // Where samples are gone the state before is the way back.
  if (!node.step) keep_whole(head_, current_, derived_);
  const Node& before = nodes_[head_];
  // Inserted samples have places on all levels, derived ones included.
  const bool inserts = node.step == nullptr || node.step->delta.further_samples() > 0;
  if (derived_ && before.derivation && !inserts && edit->params.level >= before.first_valid_level) {
    // The edit needed none of the levels that were derived. Without them the state is what replaying makes
    // of the state before, and nothing has to be derived on the way back here.
    auto surface = copy_of(*after.surface);
    before.derivation->apply(*surface);
    after.surface = std::move(surface);
    after.reports = before.reports;
  } else {
    node.from_derived = derived_;
  }
  node.reports = after.reports;
  node.first_valid_level = after.first_valid_level;
  nodes_.push_back(std::move(node));
  edits_.push_back(std::move(edit));
  ++head_;
  current_ = std::move(after);
  derived_ = false;
  if (pays_whole(head_)) nodes_[head_].whole = current_;
  trim(head_);
}

void History::replace_current(SurfaceState derived) {
  POINTWRIGHT_CHECK(!derived_ && derived.first_valid_level == 0, "a state is derived once, and all of it");
  Node& node = nodes_[head_];
  node.derivation = std::make_shared<const SurfaceDelta>(*current_.surface, *derived.surface);
  node.derived_reports = derived.reports;
  current_ = std::move(derived);
  derived_ = true;
  trim(head_);
}

std::vector<History::Start> History::starts() const {
  std::vector<Start> starts{{.place = {.node = head_, .derived = derived_}, .state = &current_}};
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    if (nodes_[i].whole)
      starts.push_back({.place = {.node = i, .derived = false}, .state = &*nodes_[i].whole});
  return starts;
}

std::optional<double> History::cost_of_way(Place from, std::size_t edit) const {
  double cost = 0.0;
  for (; from.node > edit; --from.node) {
    const Node& node = nodes_[from.node];
    if (!node.step || (from.derived && !node.derivation)) return std::nullopt;
    cost += from.derived ? 2 * kStepCost : kStepCost;
    from.derived = node.from_derived;
  }
  for (; from.node < edit; ++from.node) {
    const Node& next = nodes_[from.node + 1];
    const bool known = nodes_[from.node].derivation != nullptr;
    if (from.derived && !next.from_derived && !known) return std::nullopt;
    if (from.derived != next.from_derived) cost += known ? kStepCost : kDerivationCost;
    cost += next.step ? kStepCost : 1.0;
    from.derived = false;
  }
  return cost;
}

Result<void> History::move_head(std::size_t edit) {
  POINTWRIGHT_CHECK(edit <= edits_.size(), "the head can only move to recorded edits");
  std::optional<Start> best;
  double least = 0.0;
  for (const Start& start : starts()) {
    const auto cost = cost_of_way(start.place, edit);
    if (!cost || (best && *cost >= least)) continue;
    best = start;
    least = *cost;
  }
  const auto given_up = [this](const Error& error) {
    trim(head_);  // what was replayed so far is kept where there is room
    return error;
  };
  Walk walk(nodes_, *best);  // from the rest there always is a way
  while (walk.place().node > edit) walk.step_back();
  const std::size_t start = walk.place().node;
  while (walk.place().node < edit) {
    const std::size_t from = walk.place().node;
    if (!walk.turn_to_next()) {
      auto derived = work_.derive(walk.state());
      if (!derived) return given_up(derived.error());
      nodes_[from].derivation =
          std::make_shared<const SurfaceDelta>(*walk.state().surface, *derived.value().surface);
      nodes_[from].derived_reports = derived.value().reports;
      walk.jump(std::move(derived).value(), {.node = from, .derived = true});
    }
    if (walk.step_on()) continue;
    auto next = work_.replay(walk.state(), *edits_[from]);
    if (!next) return given_up(next.error());
    nodes_[from + 1].step = step_between(walk.state(), next.value());
    if (!nodes_[from + 1].step) keep_whole(from, walk.state(), walk.place().derived);
    walk.jump(std::move(next).value(), {.node = from + 1, .derived = false});
    trim(edit);  // at every step: a long way must not take more memory than a short one
    const std::size_t left = edit - from - 1;
    if (left >= kLeastReplay && std::has_single_bit(left) && left * 8 >= edit - start)
      nodes_[from + 1].whole = walk.state();
  }
  head_ = edit;
  derived_ = walk.place().derived;
  current_ = !derived_ && nodes_[edit].whole ? *nodes_[edit].whole : walk.release();
  trim(head_);
  return {};
}

History::Known History::nearest_known(std::size_t edit) const {
  POINTWRIGHT_CHECK(edit <= edits_.size(), "a recorded edit");
  // How far each start leads without replaying: the farthest wins, then the one on the shortest way.
  const auto reach = [&](Place place) {
    while (place.node < edit) {
      const Node& next = nodes_[place.node + 1];
      if (!next.step || (place.derived != next.from_derived && !nodes_[place.node].derivation)) break;
      place = {.node = place.node + 1, .derived = false};
    }
    return place.node;
  };
  std::optional<Start> best;
  std::size_t farthest = 0;
  for (const Start& start : starts()) {
    if (start.place.node > edit && !cost_of_way(start.place, edit)) continue;
    const std::size_t end = start.place.node > edit ? edit : reach(start.place);
    const bool nearer = best && distance(start.place.node, edit) < distance(best->place.node, edit);
    if (best && (end < farthest || (end == farthest && !nearer))) continue;
    best = start;
    farthest = end;
  }
  Walk walk(nodes_, *best);
  while (walk.place().node > farthest) walk.step_back();
  while (walk.place().node < farthest) POINTWRIGHT_CHECK(walk.turn_to_next() && walk.step_on(), "kept steps");
  return {.edit = farthest, .state = walk.release()};
}

History::Victim History::cheapest_to_lose(std::size_t center) const {
  Victim least;
  const auto consider = [&](Victim::Kind kind, std::size_t node, double cost, std::size_t away,
                            std::uint64_t bytes) {
    const double worth = cost / (static_cast<double>(away) * static_cast<double>(bytes + 1));
    if (least.kind == Victim::Kind::kNone || worth < least.worth)
      least = {.kind = kind, .node = node, .worth = worth};
  };
  std::size_t whole_before = 0;  // the last whole state before the node, the current one included
  std::size_t lost = 0;          // steps between it and the node that are not kept
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const std::size_t away = std::max<std::size_t>(1, i <= center ? center - i + 1 : i - center);
    if (node.step) consider(Victim::Kind::kStep, i, 1.0, away, node.step->memory());
    if (i > 0 && !node.step) ++lost;
    if (node.derivation && !(i == head_ && derived_)) {
      // Where the next step starts from it, all that lies beyond is lost with it.
      const bool needed = i + 1 < nodes_.size() && nodes_[i + 1].from_derived;
      consider(Victim::Kind::kDerivation, i, needed ? kDerivationCost : 1.0, away, node.derivation->memory());
    }
    if (i == head_) {
      if (i > 0 && node.whole && node.whole->surface != current_.surface)
        consider(Victim::Kind::kWhole, i, kStepCost, 1, memory_of(*node.whole));
      whole_before = i;
      lost = 0;
    } else if (node.whole && i > 0) {
      std::size_t next = i + 1;
      for (; next < nodes_.size() && next != head_ && !nodes_[next].whole; ++next)
        if (!nodes_[next].step) ++lost;
      // Where all steps are kept it only shortens ways.
      const double span = static_cast<double>(next - whole_before);
      consider(Victim::Kind::kWhole, i, static_cast<double>(lost) + kStepCost * span, away,
               memory_of(*node.whole));
      whole_before = i;
      lost = 0;
    }
  }
  return least;
}

std::uint64_t History::budget() const {
  // Paintings cannot be replayed, so they are never dropped, nor are the samples of the current state: beside
  // them there is always room for the last steps, however many they are.
  const std::uint64_t least = std::min(budget_bytes_, kLeastSurfaces * memory_of(current_));
  SamplesMemory samples(nodes_.front().whole->samples);
  samples.add(current_.samples);
  return std::max(budget_bytes_, marks_memory() + samples.bytes() + least);
}

void History::trim(std::size_t center) {
  // What is cheapest to lose goes first: what it costs to get back, for each byte, weighed by how far from
  // the center it is. So the last edits stay at hand, and whole states thin out with their distance.
  while (memory() > budget()) {
    const Victim victim = cheapest_to_lose(center);
    Node& node = nodes_[victim.node];
    if (victim.kind == Victim::Kind::kNone) return;
    if (victim.kind == Victim::Kind::kStep) node.step.reset();
    if (victim.kind == Victim::Kind::kDerivation) node.derivation.reset();
    if (victim.kind == Victim::Kind::kWhole) node.whole.reset();
  }
}

}  // namespace pointwright::server
