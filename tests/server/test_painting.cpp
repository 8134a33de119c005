// Painting on a session: what is recorded, what is stolen, and what it counts against.
#include "server/sessions/session.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <thread>

#include "protocol/json/parse.h"
#include "protocol/json/requests.h"
#include "tests/server/workshop.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::ProblemKind;

TEST_CASE("closing a session ends its painting") {
  Workshop workshop;
  const auto session = workshop.ready();
  // Passes above the whole sheet, near enough to be tested everywhere, and covers nothing.
  Stroke stroke{.vertices = {}, .radius = 1e-6};
  for (int i = 0; i < 100'000; ++i)
    stroke.vertices.emplace_back(i % 2 == 0 ? -1.0 : 2.0, 1e-3 * (i / 2 % 1000), 0.03);
  const std::vector<PaintOperation> operations(5, PaintOperation{.shape = stroke});
  std::thread closer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    session->close("the session was deleted");
  });
  CHECK(kind_of(session->replace_painting(RegionKind::kZero, operations)) == ProblemKind::kNotFound);
  closer.join();
}

TEST_CASE("painting counts what changed and raises the revision") {
  Workshop workshop;
  const auto session = workshop.ready();
  const auto first = session->paint(RegionKind::kZero, left_of(0.2));
  REQUIRE(first.ok());
  CHECK(first.value().changed == first.value().document->zero.samples);
  CHECK(first.value().changed == 8 * 40);
  CHECK(first.value().document->revision == 1);
  const auto again = session->paint(RegionKind::kZero, left_of(0.2));
  CHECK(again.value().changed == 0);
  CHECK(again.value().document->zero.operations->size() == 2);

  const auto replaced = session->replace_painting(RegionKind::kZero, {left_of(0.1)});
  REQUIRE(replaced.ok());
  CHECK(replaced.value().document->zero.samples == 4 * 40);
  CHECK(replaced.value().document->zero.operations->size() == 1);
  const auto cleared = session->replace_painting(RegionKind::kZero, {});
  CHECK(cleared.value().document->zero.samples == 0);
  CHECK(cleared.value().document->revision == 4);
}

// The list as a client reads it and sends it back.
std::vector<PaintOperation> read_back(const Painting& painting) {
  protocol::JsonDocument list = protocol::JsonDocument::array();
  for (const auto& operation : *painting.operations) {
    CHECK_FALSE(depends_on_sampling(*operation));
    list.push_back(protocol::to_json(*operation));
  }
  const auto document = protocol::parse_json(protocol::JsonDocument{{"operations", list}}.dump());
  REQUIRE(document.ok());
  auto parsed = protocol::parse_painting(document.value());
  REQUIRE(parsed.ok());
  return std::move(parsed).value();
}

TEST_CASE("a painting that was made by operations on samples gives the same marks when it is put back") {
  Workshop workshop;
  ScreenShape seen{.outline = ScreenEllipse{.center = {0.5, 0.5}, .half_axes = {0.2, 0.4}}, .visible = true};
  const PaintOperation flood{.mode = PaintMode::kFlood,
                             .steal = true,
                             .flood = {.seed = Vec3d(0.5, 0.5, 0.0), .radius = 0.3, .stop_at_other = true}};
  const std::vector<PaintOperation> operations = {
      {.shape = AxisBox{.min = Vec3d(0.4, 0.0, -1.0), .max = Vec3d(0.7, 1.0, 1.0)},
       .facing = Vec3d(0.6, 0.0, -0.8)},
      flood,
      {.mode = PaintMode::kGrow, .steal = true, .distance = 0.07},
      {.mode = PaintMode::kRemove, .shape = seen}};
  // As it was built, and once an edit moved it: the list holds the places of then.
  for (const bool edited : {false, true}) {
    const auto made = workshop.painted();
    const auto second = workshop.painted();
    if (edited) {
      commit(*made, lift(0.3));
      commit(*second, lift(0.3));
    }
    for (const PaintOperation& operation : operations) {
      CAPTURE(static_cast<int>(operation.mode));
      CAPTURE(edited);
      const auto painted = made->paint(RegionKind::kZero, operation);
      REQUIRE(painted.ok());
      CHECK(painted.value().changed > 0);
    }
    const auto list = read_back(made->document()->zero);
    CHECK(list.size() == operations.size() + 1);
    REQUIRE(second->replace_painting(RegionKind::kZero, list).ok());
    REQUIRE(second->replace_painting(RegionKind::kOne, read_back(made->document()->one)).ok());
    CHECK(*second->document()->marks == *made->document()->marks);
    // Once more, into the session itself.
    const auto again = made->replace_painting(RegionKind::kZero, list);
    REQUIRE(again.ok());
    CHECK(again.value().changed == 0);
  }
  // Painted before an edit, put into a session that was never edited.
  const auto made = workshop.painted();
  for (const PaintOperation& operation : operations) REQUIRE(made->paint(RegionKind::kZero, operation).ok());
  commit(*made, lift(0.3));
  const auto fresh = workshop.painted();
  REQUIRE(fresh->replace_painting(RegionKind::kOne, read_back(made->document()->one)).ok());
  REQUIRE(fresh->replace_painting(RegionKind::kZero, read_back(made->document()->zero)).ok());
  CHECK(*fresh->document()->marks == *made->document()->marks);
}

TEST_CASE("what one region steals is in both lists: each is put back by itself, in any order") {
  Workshop workshop;
  const auto session = workshop.ready();
  const auto ball = [](double x) {
    return PaintOperation{.shape = Sphere{.center = Vec3d(x, 0.5, 0.0), .radius = 0.25}, .steal = true};
  };
  REQUIRE(session->paint(RegionKind::kZero, ball(0.35)).ok());
  REQUIRE(session->paint(RegionKind::kOne, ball(0.6)).ok());
  REQUIRE(session->paint(RegionKind::kZero, ball(0.75)).ok());
  const SharedDocument painted = session->document();
  REQUIRE(painted->one.samples > 0);
  CHECK(std::ranges::none_of(*painted->marks, [](std::uint8_t mark) { return mark == 3; }));
  const auto zero = read_back(painted->zero);
  const auto one = read_back(painted->one);
  for (const bool zero_first : {false, true}) {
    const auto second = workshop.ready();
    if (zero_first) REQUIRE(second->replace_painting(RegionKind::kZero, zero).ok());
    REQUIRE(second->replace_painting(RegionKind::kOne, one).ok());
    if (!zero_first) REQUIRE(second->replace_painting(RegionKind::kZero, zero).ok());
    CHECK(*second->document()->marks == *painted->marks);
  }
}

TEST_CASE("what an operation on samples is recorded as counts against the limits of a painting") {
  Workshop workshop;
  workshop.max_painting_vertices = 20;
  const auto session = workshop.ready();
  const PaintOperation flood{.mode = PaintMode::kFlood,
                             .flood = {.seed = Vec3d(0.5, 0.5, 0.0), .radius = 0.3}};
  const auto refused = session->paint(RegionKind::kZero, flood);
  CHECK(kind_of(refused) == ProblemKind::kTooManySamples);
  CHECK(refused.problem().limit == 20.0);
  CHECK(refused.problem().actual.value_or(0.0) > 20.0);
  CHECK(session->document()->zero.samples == 0);
  CHECK(session->document()->revision == 0);
}

TEST_CASE("a region takes no more operations than the limit says") {
  Workshop workshop;
  const auto session = workshop.ready();
  for (int i = 0; i < 5; ++i) CHECK(session->paint(RegionKind::kOne, right_of(0.8)).ok());
  CHECK(kind_of(session->paint(RegionKind::kOne, right_of(0.8))) == ProblemKind::kTooMany);
  CHECK(session->document()->one.operations->size() == 5);
}
