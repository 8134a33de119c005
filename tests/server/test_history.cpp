#include "server/sessions/history.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <bit>

#include "tests/support/surfaces.h"

using namespace pointwright;
using namespace pointwright::server;
using pointwright::test::Random;

namespace {

constexpr std::size_t kSamples = 4096;
constexpr std::size_t kBands = 2;

/// All bits of the levels and bands from `first` on.
std::uint64_t hash_of(const MultiresSurface& surface, std::uint32_t first) {
  std::uint64_t hash = 14695981039346656037ULL;
  const auto add = [&](const float* column) {
    for (std::size_t i = 0; i < kSamples; ++i)
      hash = (hash ^ std::bit_cast<std::uint32_t>(column[i])) * 1099511628211ULL;
  };
  for (std::size_t k = first; k < surface.levels.size(); ++k)
    for (const Points* points : {&surface.levels[k].position, &surface.levels[k].normal})
      for (const float* column : {points->x(), points->y(), points->z()}) add(column);
  for (std::size_t k = first; k < surface.detail.size(); ++k) add(surface.detail[k].data());
  return hash;
}

SurfaceState rest_state() {
  auto surface = std::make_shared<MultiresSurface>();
  Random random(1);
  for (std::size_t k = 0; k <= kBands; ++k) {
    surface->levels.push_back({.position = Points(kSamples), .normal = Points(kSamples)});
    for (std::size_t i = 0; i < kSamples; ++i) {
      surface->levels[k].position.set(i, random.direction().cast<float>());
      surface->levels[k].normal.set(i, random.direction().cast<float>());
    }
  }
  surface->detail.resize(kBands, std::vector<float>(kSamples, 0.5F));
  return {.surface = std::move(surface),
          .reports = std::make_shared<std::vector<DecompositionReport>>(kBands),
          .first_valid_level = 0};
}

/// Coarse levels as a function of the finest one that is valid, like a hierarchy's.
SurfaceState derived_state(const SurfaceState& stale) {
  const std::uint32_t valid = stale.first_valid_level;
  auto surface = std::make_shared<MultiresSurface>(*stale.surface);
  auto reports = std::make_shared<std::vector<DecompositionReport>>(*stale.reports);
  for (std::uint32_t k = 0; k < valid; ++k) {
    const Points& from = surface->levels[valid].position;
    for (std::size_t i = 0; i < kSamples; ++i) {
      surface->levels[k].position.set(i, from[(i + k + 1) % kSamples] * 0.75F);
      surface->levels[k].normal.set(i, from[i] * 1.5F);
      surface->detail[k][i] = from[i].x() + static_cast<float>(k);
    }
    (*reports)[k].scale = surface->levels[k].position[0].x();
  }
  return {.surface = std::move(surface), .reports = std::move(reports), .first_valid_level = 0};
}

/// Moves some samples of the edit's level and of the finer ones; which ones the record says.
SurfaceState edited_state(const SurfaceState& before, const RecordedEdit& edit) {
  const SurfaceState from = edit.params.level < before.first_valid_level ? derived_state(before) : before;
  auto surface = std::make_shared<MultiresSurface>(*from.surface);
  Random random(edit.zero_samples);
  const std::size_t begin = random.below(kSamples - edit.one_samples + 1);
  const auto turn = static_cast<float>(random.uniform(0.5, 1.5));
  for (std::size_t k = edit.params.level; k <= kBands; ++k)
    for (std::size_t i = begin; i < begin + edit.one_samples; ++i) {
      surface->levels[k].position.set(i, surface->levels[k].position[i] * turn);
      surface->levels[k].normal.set(i, -surface->levels[k].normal[i]);
      if (k < kBands) surface->detail[k][i] *= turn;
    }
  return {.surface = std::move(surface),
          .reports = from.reports,
          .first_valid_level = std::max(from.first_valid_level, edit.params.level)};
}

/// A history and, beside it, the states that it should have.
struct Bench {
  explicit Bench(std::uint64_t budget) : truth{rest_state()}, history(truth[0], budget, work()) {}

  int replays = 0;
  std::uint64_t peak = 0;  ///< of the history's memory while it replayed
  int derivations = 0;
  std::optional<std::size_t> failing;
  bool fails_to_derive = false;
  std::vector<SurfaceState> truth;  ///< by number of edits, each as replaying makes it
  History history;
  std::size_t serial = 1000;

  History::Work work() {
    return {.replay = [this](const SurfaceState& before, const RecordedEdit& edit) -> Result<SurfaceState> {
              ++replays;
              peak = std::max(peak, history.memory());
              if (failing == edit.index) return cancelled_error();
              CHECK(edit.params.level >= before.first_valid_level);  // the history has derived it
              return edited_state(before, edit);
            },
            .derive = [this](const SurfaceState& stale) -> Result<SurfaceState> {
              ++derivations;
              if (fails_to_derive) return cancelled_error();
              return derived_state(stale);
            }};
  }
  /// What a session does to look at coarse levels.
  void look() {
    if (history.current().first_valid_level == 0) return;
    history.replace_current(derived_state(history.current()));
  }
  void push(std::uint32_t level, std::size_t moved, std::shared_ptr<const Marks> marks = nullptr) {
    auto edit = std::make_shared<RecordedEdit>();
    edit->index = history.head() + 1;
    edit->params.level = level;
    edit->marks = std::move(marks);
    edit->zero_samples = ++serial;
    edit->one_samples = moved;
    if (level < history.current().first_valid_level) look();
    const std::size_t head = history.head();
    truth.resize(head + 1);
    truth.push_back(edited_state(truth[head], *edit));
    history.push(edit, edited_state(history.current(), *edit));
  }
  void push_many(std::size_t count, std::size_t moved) {
    for (std::size_t i = 0; i < count; ++i) push(static_cast<std::uint32_t>(kBands), moved);
  }
  void check_state(const SurfaceState& state, std::size_t edit) const {
    const SurfaceState& expected = truth[edit];
    const bool was_derived = state.first_valid_level != expected.first_valid_level;
    const SurfaceState full = was_derived ? derived_state(expected) : expected;
    REQUIRE(state.first_valid_level == full.first_valid_level);
    REQUIRE(hash_of(*state.surface, state.first_valid_level) ==
            hash_of(*full.surface, full.first_valid_level));
    for (std::size_t k = full.first_valid_level; k < kBands; ++k)
      REQUIRE((*state.reports)[k].scale == (*full.reports)[k].scale);
  }
  void check_head() const { check_state(history.current(), history.head()); }
  void go(std::size_t edit) {
    REQUIRE(history.move_head(edit).ok());
    REQUIRE(history.head() == edit);
    check_head();
  }
};

const std::uint64_t kWhole = memory_of(rest_state());
constexpr std::uint64_t kAmple = 1ULL << 32U;

/// 300 edits of all levels and sizes, with looks at coarse levels between.
void push_mixed(Bench& bench, std::uint64_t budget) {
  Random random(5);
  for (std::size_t i = 0; i < 300; ++i) {
    const auto level = static_cast<std::uint32_t>(random.below(kBands + 1));
    bench.push(level, random.below(10) == 0 ? kSamples : random.below(kSamples / 8));
    if (random.below(4) == 0) bench.look();
    bench.check_head();
    REQUIRE(bench.history.memory() <= budget);
  }
}

}  // namespace

TEST_CASE("paintings count once each, however many edits share them") {
  Bench bench(kAmple);
  const auto first = std::make_shared<const Marks>(100);
  bench.push(2, 0, first);
  const std::uint64_t one = bench.history.memory();
  bench.push(2, 0, first);
  const std::uint64_t two = bench.history.memory();
  bench.push(2, 0, std::make_shared<const Marks>(100));
  CHECK(bench.history.memory() - two == two - one + 100);
}

TEST_CASE("with room for all steps nothing is replayed, and few states are whole") {
  Bench bench(kAmple);
  push_mixed(bench, kAmple);
  for (std::size_t edit = 300; edit-- > 0;) bench.go(edit);
  for (std::size_t edit = 1; edit <= 300; ++edit) bench.go(edit);
  Random random(6);
  for (int i = 0; i < 50; ++i) bench.go(random.below(301));
  CHECK(bench.replays == 0);
  CHECK(bench.derivations == 0);
  CHECK(bench.history.kept_steps() == 300);
  CHECK(bench.history.whole_states() < 60);
}

TEST_CASE("a step takes the memory of what it moved") {
  Bench bench(kAmple);
  const std::uint64_t before = bench.history.memory();
  bench.push(1, kSamples / 8);
  // The rest was the current state and is whole besides now; the step is 13 of the 20 columns.
  const std::uint64_t step = bench.history.memory() - before - kWhole;
  CHECK(step > 13 * kSamples / 8 * 4);
  CHECK(step < 13 * kSamples / 8 * 4 * 5 / 4 + 4000);
}

TEST_CASE("where steps and states were dropped, every state comes back to the bit") {
  for (const std::uint64_t wholes : {3U, 10U, 40U}) {
    const std::uint64_t budget = wholes * kWhole;
    Bench bench(budget);
    push_mixed(bench, budget);
    CHECK(bench.history.kept_steps() < 300);
    bench.replays = 0;
    for (std::size_t edit = 300; edit-- > 0;) bench.go(edit);
    CHECK(bench.replays > 0);
    for (std::size_t edit = 1; edit <= 300; ++edit) bench.go(edit);
    Random random(7);
    for (int i = 0; i < 50; ++i) {
      bench.go(random.below(301));
      if (random.below(3) == 0) bench.look();
      bench.check_head();
      CHECK(bench.history.memory() <= budget);
    }
  }
}

TEST_CASE("the last edits stay at hand, and going far back is bounded") {
  const std::uint64_t budget = 8 * kWhole;
  Bench bench(budget);
  bench.push_many(400, kSamples / 10);
  CHECK(bench.history.memory() <= budget);
  for (std::size_t edit = 399; edit > 380; --edit) bench.go(edit);
  CHECK(bench.replays == 0);
  bench.go(200);
  CHECK(bench.replays < 150);  // from a whole state on the way, not from the rest
  const int far = bench.replays;
  for (std::size_t edit = 200; edit-- > 195;) bench.go(edit);
  for (std::size_t edit = 195; edit++ < 200;) bench.go(edit);
  CHECK(bench.replays == far);  // what was replayed is kept anew
}

TEST_CASE("even without any budget the first and the current state are kept") {
  Bench bench(0);
  bench.push_many(5, 100);
  CHECK(bench.history.whole_states() == 2);
  CHECK(bench.history.kept_steps() == 0);
  bench.go(3);
  bench.go(0);
  CHECK(bench.history.whole_states() == 1);
  bench.go(5);
  bench.push(0, 50);
  bench.push(2, 50);
  bench.look();
  bench.push(1, 50);
  for (const std::size_t edit : {7U, 8U, 6U, 8U, 5U}) bench.go(edit);
}

TEST_CASE("while a replay runs, the steps behind it are dropped where there is no room") {
  Bench bench(4 * kWhole);
  bench.push_many(60, kSamples);
  bench.go(0);
  bench.replays = 0;
  bench.peak = 0;
  bench.go(50);
  CHECK(bench.replays > 10);
  // The budget, the whole states that a long replay leaves, and the one in the making. All steps are 15.
  CHECK(bench.peak <= 8 * kWhole);
}

TEST_CASE("paintings that fill the budget leave room for the last steps") {
  Bench bench(4 * kWhole);
  for (std::size_t i = 0; i < 300; ++i)
    bench.push(static_cast<std::uint32_t>(kBands), 100, std::make_shared<Marks>(kSamples, std::uint8_t{1}));
  bench.replays = 0;
  for (std::size_t i = 299; i > 290; --i) bench.go(i);
  CHECK(bench.replays == 0);
}

TEST_CASE("a replay that fails leaves the head where it was") {
  Bench bench(0);
  bench.push_many(5, 100);
  bench.failing = 2;
  CHECK_FALSE(bench.history.move_head(3).ok());
  CHECK(bench.history.head() == 5);
  bench.check_head();
  bench.go(1);
  bench.push(2, 100);
  bench.push(0, 100);  // needs levels that are to be derived
  bench.failing = std::nullopt;
  bench.go(0);
  bench.fails_to_derive = true;
  CHECK_FALSE(bench.history.move_head(3).ok());
  CHECK(bench.history.head() == 0);
  bench.check_head();
  bench.go(2);
}

TEST_CASE("a new edit after undo forgets what was undone") {
  Bench bench(kAmple);
  bench.push_many(5, 100);
  bench.go(2);
  bench.push(1, 100);
  CHECK(bench.history.edits().size() == 3);
  CHECK(bench.history.head() == 3);
  bench.check_head();
  CHECK(bench.history.kept_steps() == 3);
  bench.go(2);
  bench.look();
  bench.push(2, 10);
  for (const std::size_t edit : {0U, 3U, 2U, 1U, 3U}) bench.go(edit);
  CHECK(bench.replays == 0);
}

TEST_CASE("levels that were looked at change no step, and are there again after undo") {
  Bench bench(kAmple);
  bench.push(2, 300);
  bench.look();
  CHECK(bench.history.current().first_valid_level == 0);
  bench.push(2, 200);
  // Stale levels too are what replaying makes them.
  CHECK(hash_of(*bench.history.current().surface, 0) == hash_of(*bench.truth[2].surface, 0));
  bench.look();
  bench.push(0, 200);  // made of derived levels
  bench.go(2);
  CHECK(bench.history.current().first_valid_level == 0);  // nothing to derive again
  bench.go(0);
  CHECK(hash_of(*bench.history.current().surface, 0) == hash_of(*bench.truth[0].surface, 0));
  bench.go(3);
  CHECK(bench.derivations == 0);
  CHECK(bench.replays == 0);
}

TEST_CASE("an edit that moves nothing is a step without bits") {
  Bench bench(kAmple);
  bench.push(2, 0);
  bench.push(2, 0);
  bench.go(0);
  bench.go(2);
  CHECK(bench.replays == 0);
}

TEST_CASE("the nearest known state is found without replaying, and the head stays") {
  for (const std::uint64_t budget : {kAmple, 20 * kWhole, std::uint64_t{0}}) {
    Bench bench(budget);
    push_mixed(bench, std::max(budget, 3 * kWhole));
    bench.go(250);
    const int replays = bench.replays;
    for (std::size_t edit = 0; edit <= 300; edit += 7) {
      const auto known = bench.history.nearest_known(edit);
      REQUIRE(known.edit <= edit);
      if (budget == kAmple) REQUIRE(known.edit == edit);
      bench.check_state(known.state, known.edit);
    }
    CHECK(bench.history.nearest_known(250).edit == 250);
    CHECK(bench.replays == replays);
    CHECK(bench.history.head() == 250);
    bench.check_head();
  }
}
