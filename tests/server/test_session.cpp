#include "server/sessions/session.h"

#include <doctest/doctest.h>

#include <stdexcept>
#include <thread>

#include "protocol/frames/frame.h"
#include "tests/server/workshop.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::ProblemKind;

TEST_CASE("a session builds, says how far it is, and becomes ready") {
  Workshop workshop;
  const auto session = workshop.ready();
  const auto document = session->describe(*session->document());
  CHECK(document.summary.revision == 0);
  CHECK(document.summary.sample_count == 1600);
  CHECK(document.progress.fraction == doctest::Approx(1.0));
  CHECK(document.spacing == doctest::Approx(1.0 / 39).epsilon(0.3));
  REQUIRE(document.level_scales.size() == 2);
  CHECK(document.level_scales[0] > 0.0);
  CHECK(document.level_scales[1] == 0.0);
  CHECK(document.decomposition.size() == 1);
  CHECK(finest(*session).position == workshop.cloud->position);
}

TEST_CASE("while it builds, and after it failed, a session refuses changes with the reason") {
  Workshop workshop;
  std::atomic<bool> go{false};
  const auto failing = workshop.open(
      1, [&](const Cloud&, const HierarchyParams&, const ExecutionContext&) -> Result<Hierarchy> {
        while (!go) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        return Error{.code = ErrorCode::kInvalidArgument, .message = "no such scale", .field = "scales"};
      });
  CHECK(kind_of(failing->paint(RegionKind::kZero, left_of(0.2))) == ProblemKind::kWrongState);
  CHECK(kind_of(failing->put_preview({.edit = lift(1), .sequence = 1})) == ProblemKind::kWrongState);
  go = true;
  REQUIRE(comes_true([&] { return failing->document()->state == protocol::SessionState::kFailed; }));
  CHECK(failing->document()->error->detail == "no such scale");
  CHECK(kind_of(failing->commit(lift(1), 0)) == ProblemKind::kWrongState);
}

TEST_CASE("a session whose building throws has failed, and the next one builds") {
  Workshop workshop;
  const auto session = workshop.open(
      1, [](const Cloud&, const HierarchyParams&, const ExecutionContext&) -> Result<Hierarchy> {
        throw std::runtime_error("secret");
      });
  REQUIRE(comes_true([&] { return session->document()->state == protocol::SessionState::kFailed; }));
  CHECK(session->document()->error->kind == ProblemKind::kInternalError);
  CHECK(session->document()->error->detail.find("secret") == std::string::npos);
  workshop.ready();
}

TEST_CASE("closing a session cancels its building") {
  Workshop workshop;
  std::atomic<bool> cancelled{false};
  const auto session = workshop.open(
      1, [&](const Cloud&, const HierarchyParams&, const ExecutionContext& context) -> Result<Hierarchy> {
        while (!context.is_cancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        cancelled = true;
        return cancelled_error();
      });
  session->close("the session was deleted");
  CHECK(comes_true([&] { return cancelled.load(); }));
  CHECK(session->closed_reason().value() == "the session was deleted");
  CHECK(kind_of(session->paint(RegionKind::kZero, left_of(0.2))) == ProblemKind::kNotFound);
}

TEST_CASE("edits need both regions, apart from each other") {
  Workshop workshop;
  const auto session = workshop.ready();
  CHECK(kind_of(session->put_preview({.edit = lift(1), .sequence = 1})) == ProblemKind::kEmptyRegion);
  REQUIRE(session->paint(RegionKind::kZero, left_of(0.5)).ok());
  CHECK(kind_of(session->commit(lift(1), 1)) == ProblemKind::kEmptyRegion);
  REQUIRE(session->paint(RegionKind::kOne, right_of(0.4)).ok());
  CHECK(kind_of(session->put_preview({.edit = lift(1), .sequence = 1})) == ProblemKind::kRegionsIntersect);
  CHECK(kind_of(session->render_preview({.edit = lift(1), .sequence = 1}, 0)) ==
        ProblemKind::kRegionsIntersect);
  CHECK(session->document()->edits->empty());
}

TEST_CASE("an edit moves the one-region, leaves the zero-region to the bit and is recorded") {
  Workshop workshop;
  const auto session = workshop.painted();
  const std::uint64_t before = session->document()->revision;
  const auto record = commit(*session, lift(0.5));
  CHECK(session->document()->revision == before + 1);
  CHECK(session->document()->head == 1);
  CHECK(record->index == 1);
  CHECK(record->zero_samples == 320);
  CHECK(record->one_samples == 320);
  CHECK(record->moved_samples >= 320);
  const Level& now = finest(*session);
  std::size_t checked = 0;
  for (std::size_t i = 0; i < now.position.size(); ++i) {
    const Vec3f rest = workshop.cloud->position[i];
    if (rest.x() <= 0.2F) {
      CHECK(now.position[i] == rest);
      ++checked;
    } else if (rest.x() >= 0.8F) {
      CHECK(now.position[i].z() == doctest::Approx(rest.z() + 0.5F).epsilon(0.01));
      ++checked;
    }
  }
  CHECK(checked == 640);
}

TEST_CASE("an edit for a stale revision is refused with the current one") {
  Workshop workshop;
  const auto session = workshop.painted();
  const auto stale = session->commit(lift(0.5), 1);
  CHECK(kind_of(stale) == ProblemKind::kStaleRevision);
  CHECK(stale.problem().revision.value() == 2);
  CHECK(session->document()->head == 0);
}

TEST_CASE("levels that do not exist are refused") {
  Workshop workshop;
  const auto session = workshop.painted();
  CHECK(kind_of(session->put_preview({.edit = lift(0.5, 2), .sequence = 1})) == ProblemKind::kInvalidValue);
  CHECK(kind_of(session->commit(lift(0.5, 2), 2)) == ProblemKind::kInvalidValue);
}

TEST_CASE("undo, redo and jumps bring every state back to the bit, stored or replayed") {
  Workshop workshop;
  // A budget of nothing: every state but the first and the current one must be replayed.
  for (const std::uint64_t budget : {1ULL << 30U, 1ULL}) {
    const auto session = workshop.painted(budget);
    std::vector<Level> states = {finest(*session)};
    for (const EditParams& params : {lift(0.3), turn(0.7), lift(0.1, 1), turn(-0.4), lift(-0.2)}) {
      commit(*session, params);
      states.push_back(finest(*session));
    }
    for (const std::size_t edit : {4U, 3U, 5U, 0U, 2U, 5U, 1U, 4U}) {
      const std::uint64_t before = session->document()->revision;
      REQUIRE(session->move_head(edit).ok());
      CHECK(session->document()->head == edit);
      CHECK(session->document()->revision == before + 1);
      CHECK(finest(*session) == states[edit]);
    }
    CHECK(session->document()->edits->size() == 5);
    CHECK(kind_of(session->move_head(6)) == ProblemKind::kInvalidValue);
    const std::uint64_t revision = session->document()->revision;
    REQUIRE(session->move_head(4).ok());  // where it already is
    CHECK(session->document()->revision == revision);
  }
}

TEST_CASE("every kind of edit gives the same bits previewed, committed, after other previews, and replayed") {
  const EditParams bent{.deformation = Twist{.axis = Vec3d(1, 0, 0), .angle_rad = 1.0, .length = 0.7}};
  const EditParams wide{.deformation = Scaling{.center = Vec3d(0.5, 0.5, 0), .factors = Vec3d(1, 1.5, 2)}};
  const EditParams raised{.deformation = NormalOffset{.distance = 0.1}};
  const EditParams drawn{.level = 1, .deformation = TowardPoint{.target = Vec3d(2, 0, 1), .amount = 0.3}};
  const EditParams smooth{.blend = Blend::kCosine, .deformation = Translation{}, .gains = {0.0F}};
  const EditParams several{.deformation = Deformation({NormalOffset{.distance = -0.05},
                                                       Rotation{.axis = Vec3d(0, 1, 0), .angle_rad = 0.3}})};
  const std::vector<EditParams> edits = {bent, wide, raised, drawn, smooth, several, turn(0.5), lift(0.1, 1)};
  Workshop workshop;
  const auto dragged = workshop.painted();
  const auto plain = workshop.painted(1);  // no room for states: all but the newest are replayed
  std::vector<Level> states = {finest(*plain)};
  std::uint64_t sequence = 0;
  for (const EditParams& params : edits) {
    // A drag that wanders over the other kinds before it comes to this one.
    for (const EditParams& other : {edits[0], edits[4], turn(0.2), turn(0.9), params}) {
      const auto rendered = dragged->render_preview({.edit = other, .sequence = ++sequence}, 0);
      REQUIRE(rendered.ok());
    }
    commit(*dragged, params);
    commit(*plain, params);
    states.push_back(finest(*plain));
    CHECK(finest(*dragged) == states.back());
    CHECK(finest(*plain) != states[states.size() - 2]);
  }
  for (const std::size_t edit : {3U, 8U, 5U, 1U, 7U}) {
    REQUIRE(plain->move_head(edit).ok());
    CHECK(finest(*plain) == states[edit]);
  }
}

TEST_CASE("looking at a level changes no later edit, and replaying gives what was there") {
  const auto open = [](Workshop& workshop) {
    workshop.hierarchy.scales = {0.1F, 0.05F};
    return workshop.open(1);
  };
  Workshop workshop;
  const auto looked = open(workshop);
  const auto plain = open(workshop);
  for (const auto& session : {looked, plain}) {
    REQUIRE(comes_true([&] { return session->document()->state == protocol::SessionState::kReady; }));
    REQUIRE(session->paint(RegionKind::kZero, left_of(0.2)).ok());
    REQUIRE(session->paint(RegionKind::kOne, right_of(0.8)).ok());
    commit(*session, turn(0.4, 1));
  }
  const Level before = looked->document()->surface.surface->levels[1];
  REQUIRE(looked->committed_picture(0, false).ok());
  CHECK(looked->document()->surface.first_valid_level == 0);
  CHECK(looked->document()->surface.surface->levels[1] == before);
  CHECK(looked->document()->surface.surface->levels[0] != plain->document()->surface.surface->levels[0]);
  for (const auto& session : {looked, plain}) commit(*session, turn(0.3, 1));
  const Level after = finest(*plain);
  CHECK(finest(*looked) == after);
  REQUIRE(looked->move_head(0).ok());
  REQUIRE(looked->move_head(2).ok());
  CHECK(finest(*looked) == after);
}

TEST_CASE("an edit that takes samples out of reach is refused, however many lead there") {
  Workshop workshop;
  const auto session = workshop.painted();
  const Scaling away{.center = Vec3d(1e9, 0, 0), .factors = Vec3d(1e3, 1e3, 1e3)};
  const EditParams far{.deformation = Deformation(std::vector<ElementaryDeformation>(8, away))};
  const auto refused = session->commit(far, session->document()->revision);
  CHECK(kind_of(refused) == ProblemKind::kInvalidValue);
  CHECK(refused.problem().errors.at(0).pointer == "/deformation");
  CHECK(kind_of(session->render_preview({.edit = far, .sequence = 1}, 0)) == ProblemKind::kInvalidValue);
  int made = 0;
  for (; made < 12; ++made) {
    const auto one = session->commit({.level = 1, .deformation = away}, session->document()->revision);
    if (!one.ok()) break;
  }
  CHECK(made < 3);
  REQUIRE(session->committed_picture(0, false).ok());
  REQUIRE(session->move_head(0).ok());
}

TEST_CASE("a picture that is shown is never written over by the frames after it") {
  Workshop workshop;
  const auto session = workshop.painted();
  std::vector<std::pair<Picture, Level>> shown;
  for (std::uint64_t i = 1; i <= 12; ++i) {
    REQUIRE(session->put_preview({.edit = turn(0.05 * static_cast<double>(i)), .sequence = i}).ok());
    REQUIRE(comes_true([&] { return session->display().picture().sequence == i; }));
    Picture picture = session->display().picture();
    Level seen = picture.surface->finest();
    if (i % 3 != 0) shown.emplace_back(std::move(picture), std::move(seen));  // the others are let go
  }
  for (const auto& [picture, seen] : shown) CHECK(picture.surface->finest() == seen);
}

TEST_CASE("an edit after undo drops what was undone") {
  Workshop workshop;
  const auto session = workshop.painted();
  commit(*session, lift(0.3));
  commit(*session, lift(0.4));
  REQUIRE(session->move_head(1).ok());
  CHECK(commit(*session, turn(0.2))->index == 2);
  CHECK(session->document()->edits->size() == 2);
  CHECK(kind_of(session->move_head(3)) == ProblemKind::kInvalidValue);
}

TEST_CASE("undo of an edit leaves the painting alone, and painting leaves the edits alone") {
  Workshop workshop;
  const auto session = workshop.painted();
  commit(*session, lift(0.3));
  const Level lifted = finest(*session);
  REQUIRE(session->replace_painting(RegionKind::kZero, {left_of(0.1)}).ok());
  CHECK(finest(*session) == lifted);
  REQUIRE(session->move_head(0).ok());
  CHECK(session->document()->zero.samples == 160);
  REQUIRE(session->move_head(1).ok());  // replays nothing with the new painting
  CHECK(finest(*session) == lifted);
}

TEST_CASE("the same edits give the same bits with one thread and with many") {
  std::vector<Level> results;
  for (const int threads : {1, 4}) {
    Workshop workshop(threads);
    const auto session = workshop.painted();
    commit(*session, turn(0.7));
    commit(*session, lift(0.2, 1));
    commit(*session, lift(0.1));
    results.push_back(finest(*session));
  }
  CHECK(results[0] == results[1]);
}

TEST_CASE("a level-0 edit after a single-resolution edit works on levels derived from the edited surface") {
  Workshop workshop;
  const auto session = workshop.painted();
  commit(*session, lift(0.4, 1));
  CHECK(session->document()->surface.first_valid_level == 1);
  const Level before = finest(*session);
  const auto base = session->committed_picture(0, false);
  REQUIRE(base.ok());
  CHECK(session->document()->surface.first_valid_level == 0);
  CHECK(finest(*session) == before);
  float highest = 0.0F;
  for (std::size_t i = 0; i < 1600; ++i)
    highest = std::max(highest, base.value().surface->levels[0].position[i].z());
  CHECK(highest > 0.3F);
  commit(*session, lift(0.4));
  CHECK(finest(*session).position != before.position);
}

TEST_CASE("the newest preview wins and is shown with its number") {
  Workshop workshop;
  const auto session = workshop.painted();
  const std::uint64_t revision = session->document()->revision;
  for (std::uint64_t sequence = 1; sequence <= 40; ++sequence)
    REQUIRE(session->put_preview({.edit = lift(0.01 * static_cast<double>(sequence)), .sequence = sequence})
                .ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 40; }));
  CHECK(session->display().version() < 45);
  CHECK(session->document()->revision == revision);
  CHECK(finest(*session).position == workshop.cloud->position);
  const Picture shown = session->display().picture();
  CHECK(shown.revision == revision);
  for (std::size_t i = 0; i < 1600; ++i)
    if (workshop.cloud->position[i].x() >= 0.8F)
      CHECK(shown.surface->finest().position[i].z() - workshop.cloud->position[i].z() ==
            doctest::Approx(0.4F).epsilon(0.01));
}

TEST_CASE("a preview that was overtaken by a later one of the same drag is not shown") {
  Workshop workshop;
  const auto session = workshop.painted();
  REQUIRE(session->put_preview({.edit = lift(0.2), .sequence = 8}).ok());
  REQUIRE(session->put_preview({.edit = lift(0.1), .sequence = 7}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence != 0; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  CHECK(session->display().picture().sequence == 8);
}

TEST_CASE("a preview that the end of its drag overtook is not shown over the committed state") {
  Workshop workshop;
  const auto session = workshop.painted();
  REQUIRE(session->put_preview({.edit = lift(0.2), .sequence = 8}).ok());
  const std::uint64_t revision = session->document()->revision;
  commit(*session, lift(0.2));
  REQUIRE(session->put_preview({.edit = lift(0.1), .sequence = 7}).ok());
  REQUIRE(session->put_preview({.edit = lift(0.2), .sequence = 8}).ok());
  // The last one may come first after its commit: the revision that it was made for tells.
  CHECK(kind_of(session->put_preview({.edit = lift(0.2), .sequence = 9}, revision)) ==
        ProblemKind::kStaleRevision);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  CHECK(session->display().picture().sequence == 0);
  REQUIRE(session->put_preview({.edit = lift(0.3), .sequence = 10}, revision + 1).ok());
  CHECK(comes_true([&] { return session->display().picture().sequence == 10; }));
}

TEST_CASE("the base stays editable wherever the finest level was moved to") {
  Workshop workshop;
  workshop.hierarchy.scales = {0.0002F};
  const auto session = workshop.open();
  REQUIRE(comes_true([&] { return session->document()->state == protocol::SessionState::kReady; }));
  REQUIRE(session->paint(RegionKind::kZero, left_of(0.2)).ok());
  REQUIRE(session->paint(RegionKind::kOne, right_of(0.8)).ok());
  commit(*session,
         lift(2.2, 1));  // more than one and a half diagonals: the scale's fraction falls below 1e-4
  commit(*session, lift(0.1, 0));
  CHECK(session->document()->head == 2);
  CHECK(session->document()->surface.reports->front().scale > 0.0F);
}

TEST_CASE("ending a preview shows the committed state again") {
  Workshop workshop;
  const auto session = workshop.painted();
  REQUIRE(session->put_preview({.edit = lift(0.2), .sequence = 1}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 1; }));
  REQUIRE(session->end_preview().ok());
  CHECK(session->display().picture().sequence == 0);
  CHECK(session->display().picture().surface == session->document()->surface.surface);
}

TEST_CASE("what is committed after a preview is what the preview showed, to the bit") {
  Workshop workshop;
  const auto session = workshop.painted();
  REQUIRE(session->put_preview({.edit = turn(0.6), .sequence = 1}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 1; }));
  const Level previewed = session->display().picture().surface->finest();
  commit(*session, turn(0.6));
  CHECK(finest(*session) == previewed);
  const auto other = workshop.painted();
  commit(*other, turn(0.6));
  CHECK(finest(*other) == previewed);
}

TEST_CASE("a rendered preview is one whole frame that nobody else sees") {
  Workshop workshop;
  const auto session = workshop.painted();
  const std::uint64_t version = session->display().version();
  const auto frame =
      session->render_preview({.edit = lift(0.3), .sequence = 5}, protocol::kAllFrameAttributes);
  REQUIRE(frame.ok());
  const auto decoded = protocol::decode_frame(*frame.value());
  REQUIRE(decoded.ok());
  CHECK(decoded.value().header.kind == protocol::FrameKind::kKey);
  CHECK(decoded.value().header.sequence == 5);
  CHECK(decoded.value().header.sample_count == 1600);
  CHECK(session->display().picture().sequence == 0);
  CHECK(session->display().version() <= version + 1);  // t may have arrived meanwhile
}

TEST_CASE("frames bring a viewer from any picture to the newest one") {
  Workshop workshop;
  const auto session = workshop.painted();
  const std::uint16_t attributes = protocol::kFrameNormal | protocol::kFrameT | protocol::kFrameMarks;
  REQUIRE(session->committed_picture(1, true).ok());
  REQUIRE(comes_true([&] { return session->display().picture().t != nullptr; }));

  std::map<std::uint32_t, std::vector<std::array<std::uint16_t, 4>>> blocks;
  std::uint64_t seen = 0;
  const auto update = [&] {
    const auto frame = session->display().frame_since(seen, attributes);
    const auto decoded = protocol::decode_frame(*frame.bytes);
    REQUIRE(decoded.ok());
    CHECK((decoded.value().header.kind == protocol::FrameKind::kKey) == (seen == 0));
    for (const auto& block : decoded.value().blocks) blocks[block.number] = block.position_t;
    seen = frame.version;
    return decoded.value().header;
  };
  update();
  REQUIRE(session->put_preview({.edit = lift(0.3), .sequence = 3}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 3; }));
  CHECK(update().sequence == 3);
  commit(*session, lift(0.3));
  REQUIRE(session->move_head(0).ok());
  commit(*session, turn(0.3));
  CHECK(update().revision == session->document()->revision);

  // Deltas on top of deltas hold what a key frame holds. (t may still arrive: then both are taken again.)
  for (int attempt = 0;; ++attempt) {
    REQUIRE(attempt < 100);
    update();
    const auto whole = session->display().frame_since(0, attributes);
    if (whole.version != seen) continue;
    const auto key = protocol::decode_frame(*whole.bytes);
    REQUIRE(key.ok());
    REQUIRE(key.value().blocks.size() == blocks.size());
    for (const auto& block : key.value().blocks) CHECK(blocks.at(block.number) == block.position_t);
    return;
  }
}

TEST_CASE("viewers that want the same frame share its bytes") {
  Workshop workshop;
  const auto session = workshop.ready();
  const auto first = session->display().frame_since(0, protocol::kFrameNormal);
  const auto second = session->display().frame_since(0, protocol::kFrameNormal);
  CHECK(first.bytes == second.bytes);
  CHECK(session->display().frame_since(0, 0).bytes != first.bytes);
}

TEST_CASE("the edited cloud keeps every attribute and the bits of what no edit moved") {
  Workshop workshop;
  auto cloud = std::make_shared<Cloud>(*workshop.cloud);
  cloud->exact_position.resize(1600);
  for (std::size_t i = 0; i < 1600; ++i)
    for (int axis = 0; axis < 3; ++axis)
      cloud->exact_position[i][static_cast<std::size_t>(axis)] =
          static_cast<double>(cloud->position[i][axis]) + 1e-12;
  cloud->position_is_double = true;
  workshop.cloud = cloud;
  const auto session = workshop.painted();
  commit(*session, lift(0.5));
  const auto picture = session->committed_picture(1, false);
  REQUIRE(picture.ok());
  const auto edited = Session::edited_cloud(picture.value(), 1);
  const Cloud& now = *edited;
  CHECK(now.color == cloud->color);
  CHECK(now.id == cloud->id);
  CHECK(now.has_normals());
  for (std::size_t i = 0; i < 1600; ++i) {
    if (cloud->position[i].x() <= 0.2F) CHECK(now.exact_position[i] == cloud->exact_position[i]);
    if (cloud->position[i].x() >= 0.8F)
      CHECK(now.exact_position[i][2] == doctest::Approx(cloud->exact_position[i][2] + 0.5).epsilon(0.01));
  }
}
