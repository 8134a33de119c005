// Long chains of real edits: every state comes back to the bit.

#include <doctest/doctest.h>

#include <bit>
#include <string>

#include "tests/server/workshop.h"
#include "tests/support/surfaces.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;

namespace {

constexpr std::size_t kChain = 300;

/// All bits of the levels that are valid by what the edits alone say.
std::uint64_t hash_of(const SurfaceState& state, std::uint32_t first) {
  std::uint64_t hash = 14695981039346656037ULL;
  const auto add = [&](const float* column, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      hash = (hash ^ std::bit_cast<std::uint32_t>(column[i])) * 1099511628211ULL;
  };
  for (std::size_t k = first; k < state.surface->levels.size(); ++k) {
    const Level& level = state.surface->levels[k];
    for (const Points* points : {&level.position, &level.normal})
      for (const float* column : {points->x(), points->y(), points->z()}) add(column, points->size());
  }
  for (std::size_t k = first; k < state.surface->detail.size(); ++k)
    add(state.surface->detail[k].data(), state.surface->detail[k].size());
  return hash;
}

struct Recorded {
  std::uint32_t first_valid_level = 0;
  std::uint64_t hash = 0;
};

Recorded recorded(const Session& session) {
  const SurfaceState& state = session.document()->surface;
  return {state.first_valid_level, hash_of(state, state.first_valid_level)};
}

void check_state(const Session& session, const Recorded& expected) {
  const SurfaceState& state = session.document()->surface;
  // Levels that were derived to look at them may be there besides.
  REQUIRE(state.first_valid_level <= expected.first_valid_level);
  REQUIRE(hash_of(state, expected.first_valid_level) == expected.hash);
}

void go(Session& session, std::size_t edit) {
  REQUIRE(session.move_head(edit).ok());
  REQUIRE(session.document()->head == edit);
}

/// A small part of the sheet that moves by any kind of deformation on any level.
EditParams random_edit(Random& random) {
  const Vec3d point(random.uniform(), random.uniform(), 0.0);
  const Vec3d axis = random.direction();
  EditParams edit{.level = static_cast<std::uint32_t>(random.below(3))};
  if (random.below(2) == 0)
    edit.gains = {static_cast<float>(random.uniform(0.5, 1.5)), static_cast<float>(random.uniform(0.5, 1.5))};
  switch (random.below(6)) {
    case 0:
      edit.deformation = Translation{.vector = 0.02 * axis};
      break;
    case 1:
      edit.deformation = NormalOffset{.distance = 0.01 * axis.x()};
      break;
    case 2:
      edit.deformation = TowardPoint{.target = point, .amount = 0.1 * axis.x()};
      break;
    case 3:
      edit.deformation = Rotation{.point = point, .axis = axis, .angle_rad = 0.2 * axis.y()};
      break;
    case 4:
      edit.deformation = Scaling{.center = point, .factors = Vec3d::Ones() + 0.1 * axis};
      break;
    default:
      edit.deformation = Twist{.point = point, .axis = axis, .angle_rad = 0.2, .length = 2.0};
  }
  return edit;
}

PaintOperation ball(const Vec3d& center, double radius) {
  return {.mode = PaintMode::kSet, .shape = Sphere{.center = center, .radius = radius}};
}

void paint_somewhere(Session& session, Random& random) {
  const Level& level = finest(session);
  const Vec3d center = level.position[random.below(level.position.size())].cast<double>();
  PaintOperation outside = ball(center, random.uniform(0.25, 0.6));
  PaintOperation invert{.mode = PaintMode::kInvert};
  REQUIRE(session.replace_painting(RegionKind::kZero, {outside, invert}).ok());
  REQUIRE(session.replace_painting(RegionKind::kOne, {ball(center, 0.1)}).ok());
}

void check_chain(std::uint64_t history_bytes, int threads) {
  Workshop workshop(threads);
  workshop.hierarchy.scales = {0.08F, 0.03F};
  workshop.max_edits = kChain;
  const auto session = workshop.ready(history_bytes);
  Random random(42);
  std::vector<Recorded> states{recorded(*session)};
  while (states.size() <= kChain) {
    if (states.size() % 4 == 1) paint_somewhere(*session, random);
    const auto committed = session->commit(random_edit(random), {});
    if (!committed.ok()) {
      // Edits may fold a patch onto another one; then the regions touch, and others are painted.
      REQUIRE(committed.problem().kind == ProblemKind::kRegionsIntersect);
      paint_somewhere(*session, random);
      continue;
    }
    states.push_back(recorded(*session));
    if (random.below(5) == 0) REQUIRE(session->committed_picture(0, false).ok());
  }
  for (std::size_t edit = kChain; edit-- > 0;) {
    go(*session, edit);
    check_state(*session, states[edit]);
  }
  for (std::size_t edit = 1; edit <= kChain; ++edit) {
    go(*session, edit);
    check_state(*session, states[edit]);
  }
  for (int jump = 0; jump < 20; ++jump) {
    const std::size_t edit = random.below(kChain + 1);
    go(*session, edit);
    check_state(*session, states[edit]);
  }
}

}  // namespace

TEST_CASE("300 edits of all kinds are undone and redone one by one, to the bit") {
  check_chain(1ULL << 30U, 0);
}

TEST_CASE("300 edits come back to the bit where most of the history was dropped") {
  // Twelve states' worth beside the paintings: steps go, whole states thin out, the rest is replayed.
  constexpr std::uint64_t kState = 1600 * 4 * 20;
  check_chain(12 * kState + kChain * 1600, 0);
}
