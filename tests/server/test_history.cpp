#include "server/sessions/history.h"

#include <doctest/doctest.h>

using namespace pointwright;
using namespace pointwright::server;

namespace {

/// A surface of one sample whose x tells the state; 24 bytes.
SurfaceState state_at(float x) {
  auto surface = std::make_shared<MultiresSurface>();
  surface->levels.resize(1);
  surface->levels[0].position.resize(1);
  surface->levels[0].normal.resize(1);
  surface->levels[0].position.set(0, {x, 0, 0});
  return {.surface = std::move(surface), .reports = nullptr, .first_valid_level = 0};
}
float x_of(const SurfaceState& state) {
  return state.surface->finest().position[0].x();
}

struct Steps {
  int replays = 0;
  std::optional<std::size_t> failing;
  History::Replay replay() {
    return [this](const SurfaceState& before, const RecordedEdit& edit) -> Result<SurfaceState> {
      ++replays;
      if (failing == edit.index) return cancelled_error();
      return state_at(x_of(before) + static_cast<float>(edit.index));
    };
  }
};

void push_many(History& history, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    auto edit = std::make_shared<RecordedEdit>();
    edit->index = history.head() + 1;
    history.push(edit, state_at(x_of(history.current()) + static_cast<float>(edit->index)));
  }
}

}  // namespace

TEST_CASE("paintings count once each, however many edits share them") {
  Steps steps;
  History history(state_at(0), 24 * 4 + 250, steps.replay());
  const auto push = [&](const std::shared_ptr<const Marks>& marks) {
    auto edit = std::make_shared<RecordedEdit>();
    edit->index = history.head() + 1;
    edit->marks = marks;
    history.push(edit, state_at(x_of(history.current()) + static_cast<float>(edit->index)));
  };
  const auto first = std::make_shared<const Marks>(100);
  push(first);
  push(first);
  CHECK(history.memory() == 24 * 3 + 100);
  push(std::make_shared<const Marks>(100));
  CHECK(history.memory() == 24 * 4 + 200);
  push(std::make_shared<const Marks>(100));
  CHECK(history.stored_states() < 5);  // what paintings take is not there for states
}

TEST_CASE("with room for all states nothing is replayed") {
  Steps steps;
  History history(state_at(0), 1 << 20, steps.replay());
  push_many(history, 10);
  for (const std::size_t edit : {9U, 0U, 5U, 10U}) {
    REQUIRE(history.move_head(edit).ok());
    CHECK(x_of(history.current()) == static_cast<float>(edit * (edit + 1) / 2));
  }
  CHECK(steps.replays == 0);
  CHECK(history.stored_states() == 11);
}

TEST_CASE("a budget is kept, the last edits stay at hand and far ones are replayed from the nearest state") {
  Steps steps;
  const std::uint64_t one_state = memory_of(state_at(0));
  History history(state_at(0), one_state * 8, steps.replay());
  push_many(history, 100);
  CHECK(history.memory() <= one_state * 8);
  CHECK(history.stored_states() == 8);
  REQUIRE(history.move_head(99).ok());
  REQUIRE(history.move_head(98).ok());
  CHECK(steps.replays == 0);
  REQUIRE(history.move_head(40).ok());
  CHECK(x_of(history.current()) == 820.0F);
  CHECK(steps.replays > 0);
  CHECK(steps.replays <= 40);
  CHECK(history.memory() <= one_state * 8);
}

TEST_CASE("even without any budget the first and the current state are kept") {
  Steps steps;
  History history(state_at(0), 0, steps.replay());
  push_many(history, 5);
  CHECK(history.stored_states() == 2);
  REQUIRE(history.move_head(3).ok());
  CHECK(x_of(history.current()) == 6.0F);
  REQUIRE(history.move_head(0).ok());
  CHECK(history.stored_states() == 1);
  CHECK(x_of(history.current()) == 0.0F);
}

TEST_CASE("a replay that fails leaves the head where it was") {
  Steps steps;
  History history(state_at(0), 0, steps.replay());
  push_many(history, 5);
  steps.failing = 2;
  CHECK_FALSE(history.move_head(3).ok());
  CHECK(history.head() == 5);
  CHECK(x_of(history.current()) == 15.0F);
  REQUIRE(history.move_head(1).ok());
}

TEST_CASE("a new edit after undo forgets what was undone") {
  Steps steps;
  History history(state_at(0), 1 << 20, steps.replay());
  push_many(history, 5);
  REQUIRE(history.move_head(2).ok());
  push_many(history, 1);
  CHECK(history.edits().size() == 3);
  CHECK(history.head() == 3);
  CHECK(x_of(history.current()) == 6.0F);
  CHECK(history.stored_states() == 4);
}
