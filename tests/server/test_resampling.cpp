// Edits that change the set of samples, with a stand-in for the resampler.

#include <doctest/doctest.h>

#include <algorithm>
#include <set>
#include <string>

#include "engine/io/cloud_io.h"
#include "server/sessions/recipes.h"
#include "tests/server/workshop.h"
#include "tests/support/surfaces.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;

namespace {

constexpr std::size_t kUploaded = 1600;
constexpr std::uint64_t kMuch = 1ULL << 30U;

EditParams stretch(double height, double collect = 0.0, std::uint32_t level = 0) {
  EditParams edit = lift(height, level);
  edit.resampling = ResamplingParams{.collect = collect};
  return edit;
}

/// All that a state is made of, shared; compared by value.
struct Snapshot {
  SurfaceState state;

  friend bool operator==(const Snapshot& a, const Snapshot& b) {
    const pointwright::Sampling& x = *a.state.samples->sampling;
    const pointwright::Sampling& y = *b.state.samples->sampling;
    const std::uint32_t first = std::max(a.state.first_valid_level, b.state.first_valid_level);
    bool same = a.state.surface->levels.size() == b.state.surface->levels.size();
    for (std::size_t k = first; same && k < a.state.surface->levels.size(); ++k)
      same = a.state.surface->levels[k] == b.state.surface->levels[k] &&
             (k == a.state.surface->band_count() || a.state.surface->detail[k] == b.state.surface->detail[k]);
    return same && x.cloud->id == y.cloud->id && x.cloud->color == y.cloud->color &&
           x.cloud->position == y.cloud->position && x.parent == y.parent && x.spacing == y.spacing &&
           x.cell_u == y.cell_u && x.cell_v == y.cell_v && x.graph->lanes == y.graph->lanes &&
           x.next_id == y.next_id && *a.state.samples->splat_radius == *b.state.samples->splat_radius &&
           a.state.samples->stretch == b.state.samples->stretch;
  }
};

Snapshot snapshot(const Session& session) {
  return {session.document()->surface};
}

void go(Session& session, std::size_t edit) {
  const auto moved = session.move_head(edit);
  REQUIRE(moved.ok());
  const Document& now = *moved.value();
  REQUIRE(now.head == edit);
  REQUIRE(now.marks->size() == now.surface.samples->size());
  CHECK(now.zero.samples == count_marked(*now.marks, RegionKind::kZero));
  CHECK(now.one.samples == count_marked(*now.marks, RegionKind::kOne));
}

std::size_t samples_now(const Session& session) {
  return session.describe(*session.document()).summary.sample_count;
}

std::uint8_t mark_of(const Session& session, std::uint32_t id) {
  const SharedDocument now = session.document();
  const auto& ids = now->surface.samples->cloud().id;
  const auto found = std::find(ids.begin(), ids.end(), id);
  REQUIRE(found != ids.end());
  return (*now->marks)[static_cast<std::size_t>(found - ids.begin())];
}

protocol::DecodedFrame decoded(const SharedFrame& frame) {
  REQUIRE(frame != nullptr);
  auto result = protocol::decode_frame(*frame);
  REQUIRE(result.ok());
  return std::move(result).value();
}

/// Edits of every level with and without resampling and collecting, paintings between them, levels that are
/// looked at; the states that they leave.
std::vector<Snapshot> edit_much(Session& session) {
  std::vector<Snapshot> states{snapshot(session)};
  const auto make = [&](const EditParams& edit) {
    commit(session, edit);
    states.push_back(snapshot(session));
  };
  make(lift(0.05, 2));
  make(stretch(0.1));
  make(turn(0.3, 1));
  REQUIRE(session.paint(RegionKind::kOne, right_of(0.7)).ok());
  make(stretch(0.2, 0.0, 1));
  REQUIRE(session.committed_picture(0, true).ok());
  make(stretch(0.05, 0.0, 2));
  make(stretch(0.1, 0.5));
  make(lift(-0.1));
  REQUIRE(session.committed_picture(0, false).ok());
  make(stretch(0.15, 0.5, 1));
  make(lift(0.02, 2));
  make(stretch(0.001));  // inserts nothing
  return states;
}

void check_history(std::uint64_t history_bytes, int threads) {
  Workshop workshop(threads);
  workshop.hierarchy.scales = {0.08F, 0.03F};
  const auto session = workshop.painted(history_bytes);
  const std::vector<Snapshot> states = edit_much(*session);
  const std::size_t last = states.size() - 1;
  for (std::size_t edit = last; edit-- > 0;) {
    CAPTURE(edit);
    go(*session, edit);
    CHECK(snapshot(*session) == states[edit]);
  }
  for (std::size_t edit = 1; edit <= last; ++edit) {
    CAPTURE(edit);
    go(*session, edit);
    CHECK(snapshot(*session) == states[edit]);
  }
  Random random(7);
  for (int jump = 0; jump < 30; ++jump) {
    const std::size_t edit = random.below(last + 1);
    CAPTURE(edit);
    go(*session, edit);
    CHECK(snapshot(*session) == states[edit]);
    if (jump % 7 == 3) REQUIRE(session->committed_picture(0, false).ok());
  }
}

}  // namespace

TEST_CASE("an edit with resampling records what it did to the samples") {
  Workshop workshop;
  const auto session = workshop.painted();
  const auto plain = commit(*session, lift(0.1));
  CHECK(plain->change.inserted == 0);
  CHECK(plain->sample_count == kUploaded);
  const auto stretched = commit(*session, stretch(0.3));
  CHECK(stretched->change.inserted > 50);
  CHECK(stretched->change.removed == 0);
  CHECK(stretched->sample_count == kUploaded + stretched->change.inserted);
  CHECK(samples_now(*session) == stretched->sample_count);
  CHECK(stretched->moved_samples > 500);
  CHECK(stretched->moved_samples < kUploaded);
  const auto collected = commit(*session, stretch(0.3, 0.5));
  CHECK(collected->change.inserted > 50);
  CHECK(collected->change.removed > 20);
  CHECK(collected->sample_count ==
        stretched->sample_count + collected->change.inserted - collected->change.removed);
  CHECK(collected->moved_samples < stretched->sample_count);
  CHECK(session->describe(*session->document()).spacing > 0.0);
  go(*session, 0);
  CHECK(samples_now(*session) == kUploaded);
}

TEST_CASE("edits with resampling are undone, redone and jumped over to the bit") {
  check_history(kMuch, 0);
}

TEST_CASE("edits with resampling come back to the bit where their history was dropped") {
  // Room for a state or two, with their samples, beside the paintings.
  check_history(1600 * 4 * 20 * 4, 1);
  check_history(1, 2);
}

TEST_CASE("samples that states share are counted once, and dropped with them") {
  Workshop workshop;
  const auto session = workshop.painted();
  const auto memory = [&] { return session->fork({}).value().history.memory(); };
  const std::uint64_t rest = memory();
  commit(*session, stretch(0.3));
  const SampleSet& samples = *session->document()->surface.samples;
  const std::uint64_t sampling = memory_of(*samples.sampling);
  const std::uint64_t surface = memory_of(session->document()->surface);
  CHECK(memory() > rest + surface + sampling);
  const std::uint64_t one = memory();
  go(*session, 0);
  CHECK(memory() < one);              // the surface is the rest again
  CHECK(memory() > rest + sampling);  // redoing brings the samples back
  go(*session, 1);
  CHECK(memory() == one);

  Workshop small;
  const auto thrifty = small.painted(1);
  for (int i = 0; i < 8; ++i) commit(*thrifty, stretch(0.02));
  const auto fork = thrifty->fork({});
  const SampleSet& now = *thrifty->document()->surface.samples;
  // The rest and the current surface, the current samples, a few paintings; no step is left.
  CHECK(fork.value().history.kept_steps() <= 3);
  CHECK(fork.value().history.memory() <
        6 * memory_of(thrifty->document()->surface) + 3 * memory_of(*now.sampling));
}

TEST_CASE("inserted samples have their parents' marks, splats and colours") {
  Workshop workshop;
  const auto session = workshop.painted();
  commit(*session, stretch(0.3));
  const SharedDocument now = session->document();
  const SampleSet& samples = *now->surface.samples;
  REQUIRE(samples.size() > kUploaded);
  for (std::size_t i = 0; i < kUploaded; ++i) CHECK(samples.sampling->parent[i] == kNoParent);
  std::set<std::uint8_t> seen;
  for (std::size_t i = kUploaded; i < samples.size(); ++i) {
    const auto& ids = samples.cloud().id;
    const auto parent = static_cast<std::size_t>(
        std::find(ids.begin(), ids.end(), samples.sampling->parent[i]) - ids.begin());
    REQUIRE(parent < kUploaded);
    CHECK((*now->marks)[i] == (*now->marks)[parent]);
    CHECK((*samples.splat_radius)[i] == (*samples.splat_radius)[parent]);
    CHECK(samples.cloud().color[i] == samples.cloud().color[parent]);
    CHECK(samples.stretch[i] == doctest::Approx(2.0));
    seen.insert((*now->marks)[i]);
  }
  CHECK(seen == std::set<std::uint8_t>{0, 2});
  CHECK(samples.stretch[0] <= 2.0F);
  CHECK(samples.stretch_range == 2.0F);
}

TEST_CASE("marks travel over undo and redo, and what was painted meanwhile with them") {
  Workshop workshop;
  const auto session = workshop.painted();
  commit(*session, stretch(0.3, 0.5));
  const SharedDocument after = session->document();
  const SampleSet& samples = *after->surface.samples;
  const auto pulled = static_cast<std::size_t>(
      std::find(after->marks->begin() + kUploaded, after->marks->end(), 2) - after->marks->begin());
  REQUIRE(pulled < samples.size());
  const std::uint32_t inserted = samples.cloud().id[pulled];
  const std::uint32_t parent = samples.sampling->parent[pulled];
  REQUIRE(parent < kUploaded);
  std::set<std::uint32_t> left(samples.cloud().id.begin(), samples.cloud().id.end());
  std::vector<std::uint32_t> removed;
  for (std::uint32_t id = 0; id < kUploaded; ++id)
    if (left.count(id) == 0) removed.push_back(id);
  REQUIRE_FALSE(removed.empty());
  CHECK(mark_of(*session, inserted) == 2);

  // All of the one-region goes, and everything there is becomes the zero-region.
  REQUIRE(session->replace_painting(RegionKind::kOne, {}).ok());
  REQUIRE(session->paint(RegionKind::kZero, right_of(-1.0)).ok());
  CHECK(mark_of(*session, inserted) == 1);
  go(*session, 0);
  CHECK(session->document()->marks->size() == kUploaded);
  CHECK(mark_of(*session, parent) == 1);
  // What comes back was not there to be painted: it has what the edit was made with.
  const SharedDocument undone = session->document();
  const Marks& recorded = *(*undone->edits)[0]->marks;
  const auto& ids = undone->surface.samples->cloud().id;
  for (std::size_t i = 0; i < ids.size(); ++i)
    CHECK((*undone->marks)[i] == (left.count(ids[i]) == 0 ? recorded[i] : 1));
  REQUIRE(session->replace_painting(RegionKind::kZero, {left_of(0.1)}).ok());
  go(*session, 1);
  CHECK(mark_of(*session, parent) == 0);
  CHECK(mark_of(*session, inserted) == 0);
  CHECK(session->document()->zero.samples < 400);
}

TEST_CASE("a preview shows fewer samples than the edit that is recorded, which is made anew") {
  Workshop workshop;
  const auto session = workshop.painted();
  REQUIRE(session->put_preview({.edit = stretch(0.3), .sequence = 1}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 1; }));
  const Picture shown = session->display().picture();
  CHECK(shown.samples->size() > kUploaded);
  CHECK(shown.marks->size() == shown.samples->size());
  const auto record = commit(*session, stretch(0.3));
  CHECK(record->sample_count > shown.samples->size());
  const auto other = workshop.painted();
  commit(*other, stretch(0.3));
  CHECK(snapshot(*other) == snapshot(*session));
  // Without resampling the edit is what the preview showed, and cells go along.
  REQUIRE(session->put_preview({.edit = lift(0.1), .sequence = 2}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 2; }));
  const Points previewed = session->display().picture().surface->finest().position;
  commit(*session, lift(0.1));
  CHECK(finest(*session).position == previewed);
  commit(*other, lift(0.1));
  CHECK(snapshot(*other) == snapshot(*session));
}

TEST_CASE("viewers get a key frame for every other set of samples, and deltas between") {
  Workshop workshop;
  const auto session = workshop.painted();
  const std::uint16_t attributes = protocol::kAllFrameAttributes;
  std::uint64_t seen = 0;
  const auto update = [&] {
    const auto frame = session->display().frame_since(seen, attributes);
    seen = frame.version;
    return decoded(frame.bytes);
  };
  const auto show = [&](const EditParams& edit, std::uint64_t sequence) {
    REQUIRE(session->put_preview({.edit = edit, .sequence = sequence}).ok());
    REQUIRE(comes_true([&] { return session->display().picture().sequence == sequence; }));
    return update();
  };
  REQUIRE(session->committed_picture(0, true).ok());
  CHECK(update().header.sample_count == kUploaded);
  std::set<std::uint32_t> counts;
  std::uint64_t sequence = 0;
  for (const double height : {0.02, 0.1, 0.3, 0.1, 0.016}) {
    const auto frame = show(stretch(height), ++sequence);
    CHECK(frame.header.kind == protocol::FrameKind::kKey);
    CHECK(frame.header.sample_count == session->display().picture().samples->size());
    counts.insert(frame.header.sample_count);
  }
  CHECK(counts.size() >= 3);
  CHECK(show(lift(0.1), ++sequence).header.kind == protocol::FrameKind::kKey);
  CHECK(show(lift(0.2), ++sequence).header.kind == protocol::FrameKind::kDelta);
  commit(*session, stretch(0.3));
  const auto key = update();
  CHECK(key.header.kind == protocol::FrameKind::kKey);
  CHECK(key.header.stretch_range == 2.0F);
  std::set<std::uint32_t> ids;
  std::size_t stretched = 0;
  for (const auto& block : key.blocks) {
    ids.insert(block.ids.begin(), block.ids.end());
    stretched += static_cast<std::size_t>(std::count(block.stretch.begin(), block.stretch.end(), 65535));
    CHECK(std::count(block.radius.begin(), block.radius.end(), 0) == 0);
  }
  CHECK(ids.size() == samples_now(*session));
  CHECK(*ids.rbegin() == samples_now(*session) - 1);
  CHECK(stretched == 2 * (samples_now(*session) - kUploaded));
  CHECK(show(lift(0.2), ++sequence).header.kind == protocol::FrameKind::kDelta);
  CHECK(show(lift(0.25), ++sequence).header.kind == protocol::FrameKind::kDelta);
  go(*session, 0);
  const auto back = update();
  CHECK(back.header.kind == protocol::FrameKind::kKey);
  CHECK(back.header.sample_count == kUploaded);
  CHECK(back.header.stretch_range == 0.0F);
  const auto rendered = session->render_preview({.edit = stretch(0.3), .sequence = 9}, attributes);
  REQUIRE(rendered.ok());
  CHECK(decoded(rendered.value()).header.sample_count > kUploaded);
}

TEST_CASE("a session has no more samples than it may, and a drag goes on without more") {
  Workshop workshop;
  workshop.max_samples = 1610;
  const auto session = workshop.painted();
  const auto refused = session->commit(stretch(0.3), {});
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.problem().kind == ProblemKind::kTooManySamples);
  REQUIRE(refused.problem().errors.size() == 1);
  CHECK(refused.problem().errors[0].pointer == "/resampling/max_samples");
  CHECK(refused.problem().limit == 1610.0);
  CHECK(refused.problem().actual.value() > 1610.0);
  CHECK(session->document()->head == 0);
  REQUIRE(session->put_preview({.edit = stretch(0.3), .sequence = 1}).ok());
  REQUIRE(comes_true([&] { return session->display().picture().sequence == 1; }));
  CHECK(session->display().picture().samples->size() == kUploaded);
  CHECK(session->display().picture().surface->finest().position != finest(*session).position);
  CHECK(kind_of(session->render_preview({.edit = stretch(0.3), .sequence = 2}, 0)) ==
        ProblemKind::kTooManySamples);
  EditParams few = stretch(0.3);
  workshop.max_samples = 1'000'000;
  few.resampling->max_samples = 1601;
  const auto other = workshop.painted();
  const auto own = other->commit(few, {});
  REQUIRE_FALSE(own.ok());
  CHECK(own.problem().limit == 1601.0);
  few.resampling->max_samples = 5000;
  CHECK(other->commit(few, {}).ok());
}

TEST_CASE("room for samples is memory that is held for good") {
  Budget budget(1000);
  auto memory = budget.hold(200);
  SampleRoom room(100, memory, 20, 10);
  CHECK(room.most() == 100);
  CHECK(room.take(15).ok());
  CHECK(budget.held() == 200);
  CHECK(room.take(70).ok());
  CHECK(budget.held() == 700);
  CHECK(room.take(30).ok());
  CHECK(budget.held() == 700);
  auto others = budget.hold(150);
  CHECK(room.most() == 85);
  const auto refused = room.take(90);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().code == ErrorCode::kTooLarge);
  CHECK(refused.error().field == "resampling.max_samples");
  CHECK(refused.error().limit == 85.0);
  CHECK(refused.error().actual == 90.0);
  CHECK(budget.held() == 850);
  others.reset();
  CHECK(room.take(90).ok());
  memory.reset();  // the session was deleted
  CHECK(budget.held() == 0);
  CHECK(room.most() == 90);
  CHECK(room.take(80).ok());
  CHECK(room.take(91).error().code == ErrorCode::kCancelled);
  CHECK(SampleRoom(7).most() == 7);
}

TEST_CASE("a recipe with resampling gives a fresh session the same bits, and its export the same bytes") {
  Workshop workshop;
  workshop.hierarchy.scales = {0.08F, 0.03F};
  workshop.max_operations = 100;
  const auto session = workshop.painted();
  edit_much(*session);
  const auto recipe = export_recipe(*session, kMuch);
  REQUIRE(recipe.ok());
  auto request =
      protocol::parse_body(R"({"recipe":)" + recipe.value().text + "}", {}, protocol::parse_recipe_request);
  REQUIRE(request.ok());
  const auto other = workshop.ready();
  const auto applied = apply_recipe(*other, request.value(), other->document()->revision);
  REQUIRE_MESSAGE(applied.ok(), (applied.ok() ? "" : applied.problem().detail));
  CHECK(snapshot(*other) == snapshot(*session));
  CHECK(*other->document()->marks == *session->document()->marks);
  CHECK(export_recipe(*other, kMuch).value().text == recipe.value().text);
  for (std::size_t i = 0; i < other->document()->edits->size(); ++i) {
    const RecordedEdit& a = *(*session->document()->edits)[i];
    const RecordedEdit& b = *(*other->document()->edits)[i];
    CHECK(a.sample_count == b.sample_count);
    CHECK(a.change.inserted == b.change.inserted);
    CHECK(a.moved_samples == b.moved_samples);
  }

  // Part of the way there are fewer samples; what is recorded then is what plays.
  for (const auto timing : {protocol::Timing::kSequence, protocol::Timing::kTogether}) {
    for (const double s : {0.0, 0.15, 0.45, 0.75, 1.0}) {
      CAPTURE(s);
      CAPTURE(static_cast<int>(timing));
      // The stand-in collects where nothing moves, too: its edits at 0 are not the rest.
      if (s == 0.0 && timing == protocol::Timing::kTogether) continue;
      const auto played = partial_picture(*session, 2, {.s = s, .timing = timing}, true);
      REQUIRE_MESSAGE(played.ok(), (played.ok() ? "" : played.problem().detail));
      const Picture& picture = played.value();
      CHECK(picture.marks->size() == picture.samples->size());
      CHECK(picture.surface->sample_count() == picture.samples->size());
      protocol::RecipeRequest part = request.value();
      part.s = s;
      part.timing = timing;
      const auto third = workshop.ready();
      const auto made = apply_recipe(*third, part, third->document()->revision);
      REQUIRE_MESSAGE(made.ok(), (made.ok() ? "" : made.problem().detail));
      CHECK(finest(*third) == picture.surface->finest());
      CHECK(third->document()->surface.samples->cloud().id == picture.samples->cloud().id);
      CHECK(third->document()->marks->size() == picture.samples->size());
    }
  }
}

TEST_CASE("exports hold the inserted samples after the uploaded ones") {
  Workshop workshop;
  const auto session = workshop.painted();
  commit(*session, stretch(0.3));
  const auto picture = session->committed_picture(1, false);
  REQUIRE(picture.ok());
  const Cloud cloud = in_caller_order(*Session::edited_cloud(picture.value(), 1));
  REQUIRE(cloud.size() == samples_now(*session));
  for (std::uint32_t i = 0; i < cloud.size(); ++i) REQUIRE(cloud.id[i] == i);
  CHECK(validate(cloud).ok());
}

TEST_CASE("files hold the samples that are left, by ascending id") {
  Workshop workshop;
  const auto session = workshop.painted();
  REQUIRE(commit(*session, stretch(0.3, 0.5))->change.removed > 0);
  const auto picture = session->committed_picture(1, false);
  REQUIRE(picture.ok());
  const auto cloud = Session::edited_cloud(picture.value(), 1);
  for (const CloudFormat format : {CloudFormat::kPly, CloudFormat::kXyz, CloudFormat::kDraco}) {
    const auto file = write_cloud(*cloud, format, {});
    REQUIRE(file.ok());
    const auto again = read_cloud(file.value(), format, {});
    REQUIRE(again.ok());
    CHECK(again.value().cloud.size() == cloud->size());
    if (format != CloudFormat::kPly) continue;
    CHECK(in_caller_order(again.value().cloud).position == in_caller_order(*cloud).position);
  }
}

TEST_CASE("columns find their sources by id, through parents that are gone") {
  const auto sampling = [](std::vector<std::uint32_t> ids, std::vector<std::uint32_t> parents,
                           std::uint32_t next) {
    Cloud cloud;
    cloud.position.resize(ids.size());
    cloud.id = std::move(ids);
    return pointwright::Sampling{.cloud = std::make_shared<const Cloud>(std::move(cloud)),
                                 .graph = nullptr,
                                 .spacing = {},
                                 .parent = std::move(parents),
                                 .cell_u = {},
                                 .cell_v = {},
                                 .next_id = next};
  };
  using Sources = std::vector<std::uint32_t>;
  constexpr std::uint32_t kNone = kNoParent;
  const pointwright::Sampling rest = sampling({2, 0, 1}, {}, 3);
  const pointwright::Sampling split = sampling({2, 0, 1, 3, 4}, {kNone, kNone, kNone, 0, 3}, 5);
  CHECK(sources_of(rest, split) == Sources{0, 1, 2, 1, 1});
  CHECK(sources_of(split, rest) == Sources{0, 1, 2});
  // 3 was collected: 4 cannot tell where it came from, but finds itself.
  const pointwright::Sampling collected = sampling({2, 1, 4}, {kNone, kNone, 3}, 5);
  CHECK(sources_of(rest, collected) == Sources{0, 2, kNoSource});
  CHECK(sources_of(split, collected) == Sources{0, 2, 4});
  CHECK(sources_of(collected, rest) == Sources{0, kNoSource, 1});
  CHECK(sources_of(split, split, 3) == Sources{0, 1, 2, 1, 1});
  CHECK(carried(std::vector<int>{5, 6, 7}, Sources{1, kNoSource}, -1) == std::vector<int>{6, -1});
}
