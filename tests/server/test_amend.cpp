// Old edits that are changed or taken out, and the rest made once more.

#include "server/sessions/amend.h"

#include <doctest/doctest.h>

#include "tests/server/workshop.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;

namespace {

EditParams stretch(double height) {
  EditParams edit = lift(height);
  edit.resampling = ResamplingParams{};
  return edit;
}

/// Covers the same samples however far an edit has lifted them.
PaintOperation patch(double x) {
  return {.shape = AxisBox{.min = Vec3d(x, 0.25, -10.0), .max = Vec3d(x + 0.25, 0.75, 10.0)}};
}

/// Three edits, each with a painting of its own; `second` gives the middle one.
void edit_thrice(Session& session, const std::optional<EditParams>& second) {
  commit(session, lift(0.1));
  REQUIRE(session.paint(RegionKind::kOne, patch(0.6)).ok());
  if (second) commit(session, *second);
  REQUIRE(session.paint(RegionKind::kOne, patch(0.5)).ok());
  commit(session, lift(-0.03, 1));
}

SharedDocument amended(Session& session, std::size_t edit, const std::optional<EditParams>& params) {
  const auto done = amend(session, edit, params, session.document()->revision);
  REQUIRE_MESSAGE(done.ok(), (done.ok() ? "" : done.problem().detail));
  return done.value();
}

void check_same(const Session& a, const Session& b) {
  const Document& x = *a.document();
  const Document& y = *b.document();
  CHECK(x.surface.surface->finest() == y.surface.surface->finest());
  CHECK(x.surface.samples->cloud().id == y.surface.samples->cloud().id);
  CHECK(*x.marks == *y.marks);
  CHECK(x.head == y.head);
  REQUIRE(x.edits->size() == y.edits->size());
  for (std::size_t i = 0; i < x.edits->size(); ++i) {
    const RecordedEdit& p = *(*x.edits)[i];
    const RecordedEdit& q = *(*y.edits)[i];
    CHECK(p.index == i + 1);
    CHECK(p.params == q.params);
    CHECK(*p.marks == *q.marks);
    CHECK(p.moved_samples == q.moved_samples);
    CHECK(p.change.inserted == q.change.inserted);
    CHECK(p.sample_count == q.sample_count);
  }
}

}  // namespace

TEST_CASE("an amended history is the one that the new numbers would have made, to the bit") {
  for (const bool resampled : {false, true}) {
    CAPTURE(resampled);
    Workshop workshop;
    workshop.max_operations = 50;
    const EditParams first = resampled ? stretch(0.05) : lift(0.05);
    const EditParams second = resampled ? stretch(0.2) : lift(0.2);
    const auto session = workshop.painted();
    edit_thrice(*session, first);
    const auto created = (*session->document()->edits)[2]->created;
    const std::uint64_t revision = session->document()->revision;
    amended(*session, 2, second);
    CHECK(session->document()->revision == revision + 1);
    CHECK((*session->document()->edits)[2]->created == created);
    const auto expected = workshop.painted();
    edit_thrice(*expected, second);
    check_same(*session, *expected);
    // The way back leads over the new steps.
    for (const std::size_t head : {std::size_t{1}, std::size_t{3}, std::size_t{0}, std::size_t{2}}) {
      REQUIRE(session->move_head(head).ok());
      REQUIRE(expected->move_head(head).ok());
      CHECK(finest(*session) == finest(*expected));
    }
  }
}

TEST_CASE("an edit that is taken out leaves what the others alone would have made") {
  Workshop workshop;
  workshop.max_operations = 50;
  const auto session = workshop.painted();
  edit_thrice(*session, lift(0.2));
  amended(*session, 2, std::nullopt);
  const auto expected = workshop.painted();
  edit_thrice(*expected, std::nullopt);
  check_same(*session, *expected);
  amended(*session, 2, std::nullopt);
  amended(*session, 1, std::nullopt);
  CHECK(session->document()->edits->empty());
  CHECK(session->document()->head == 0);
  CHECK(finest(*session) == finest(*workshop.ready()));
}

TEST_CASE("undone edits are made anew too, and the head stays with its edit") {
  Workshop workshop;
  workshop.max_operations = 50;
  const auto session = workshop.painted();
  edit_thrice(*session, lift(0.05));
  REQUIRE(session->move_head(1).ok());
  amended(*session, 2, lift(0.2));
  CHECK(session->document()->head == 1);
  const auto expected = workshop.painted();
  edit_thrice(*expected, lift(0.2));
  REQUIRE(session->move_head(3).ok());
  CHECK(finest(*session) == finest(*expected));
  REQUIRE(session->move_head(2).ok());
  amended(*session, 1, std::nullopt);
  CHECK(session->document()->head == 1);
  CHECK(session->document()->edits->size() == 2);
}

TEST_CASE("an amendment that cannot be made whole changes nothing") {
  Workshop workshop;
  workshop.max_operations = 50;
  const auto session = workshop.painted();
  edit_thrice(*session, lift(0.05));
  const SharedDocument before = session->document();
  CHECK(kind_of(amend(*session, 0, lift(1.0), before->revision)) == ProblemKind::kNotFound);
  CHECK(kind_of(amend(*session, 4, lift(1.0), before->revision)) == ProblemKind::kNotFound);
  CHECK(kind_of(amend(*session, 2, lift(1.0), before->revision - 1)) == ProblemKind::kStaleRevision);
  EditParams wrong = lift(1.0);
  wrong.level = 7;
  CHECK(kind_of(amend(*session, 2, wrong, before->revision)) == ProblemKind::kInvalidValue);
  CHECK(session->document() == before);
}

TEST_CASE("an amendment that a later edit cannot follow names that edit") {
  Workshop workshop;
  workshop.max_samples = 1750;  // of 1,600 about 130 are inserted by each
  const auto session = workshop.painted();
  commit(*session, lift(0.05));
  commit(*session, stretch(0.05));
  const SharedDocument before = session->document();
  REQUIRE(before->surface.samples->size() > 1675);
  const auto refused = amend(*session, 1, stretch(0.05), before->revision);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.problem().detail.rfind("edit 2 of the history: ", 0) == 0);
  CHECK(session->document() == before);
}
