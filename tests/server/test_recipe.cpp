#include "server/sessions/recipes.h"

#include <doctest/doctest.h>

#include <cmath>

#include "tests/server/workshop.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::Timing;

namespace {

constexpr float kLevels[] = {0.08F, 0.03F};

struct RecipeWorkshop : Workshop {
  explicit RecipeWorkshop(int threads = 0) : Workshop(threads) {
    hierarchy.scales.assign(std::begin(kLevels), std::end(kLevels));
  }
};

protocol::RecipeRequest request_of(const std::string& text, double s = 1.0,
                                   Timing timing = Timing::kSequence) {
  auto parsed = protocol::parse_body(R"({"recipe":)" + text + "}", {}, protocol::parse_recipe_request);
  REQUIRE(parsed.ok());
  protocol::RecipeRequest request = std::move(parsed).value();
  request.s = s;
  request.timing = timing;
  return request;
}

std::string exported(Session& session) {
  const auto recipe = export_recipe(session, 1ULL << 30U);
  REQUIRE(recipe.ok());
  CHECK(recipe.value().revision == session.document()->revision);
  return recipe.value().text;
}

void applied(Session& session, const protocol::RecipeRequest& request) {
  const auto document = apply_recipe(session, request, session.document()->revision);
  REQUIRE_MESSAGE(document.ok(), (document.ok() ? "" : document.problem().detail));
}

/// All levels of both, derived where they are not valid.
void check_same_surfaces(Session& a, Session& b) {
  const auto of_a = a.committed_picture(0, false);
  const auto of_b = b.committed_picture(0, false);
  REQUIRE(of_a.ok());
  REQUIRE(of_b.ok());
  for (std::size_t k = 0; k < of_a.value().surface->levels.size(); ++k)
    CHECK(of_a.value().surface->levels[k] == of_b.value().surface->levels[k]);
  CHECK(of_a.value().surface->detail == of_b.value().surface->detail);
}

std::vector<Deformation> every_kind() {
  const Vec3d point(0.5, 0.4, 0.1);
  const Translation shift{.vector = {0.01, -0.02, 0.1}};
  const Rotation turn{.point = point, .axis = {1, 2, -1}, .angle_rad = protocol::to_radians(33.3)};
  const Scaling grow{.center = point, .factors = {0.9, 1.2, 1.1}};
  const Twist twist{
      .point = point, .axis = {0, 1, 0.5}, .angle_rad = protocol::to_radians(-20.0), .length = 0.7};
  const TowardPoint away{.target = point, .amount = -0.1};
  const NormalOffset offset{.distance = -0.02};
  return {shift, turn, grow, twist, away, offset, Deformation({offset, grow, turn, shift, twist, away})};
}

/// Every kind of deformation, gains, all levels, paintings between edits and on surfaces that were undone.
void edit_everything(Session& session) {
  REQUIRE(session.paint(RegionKind::kZero, left_of(0.2)).ok());
  REQUIRE(session.paint(RegionKind::kOne, right_of(0.8)).ok());
  const std::vector<Deformation> kinds = every_kind();
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    EditParams edit{.level = static_cast<std::uint32_t>(i % 3),
                    .blend = static_cast<Blend>(i % 4),
                    .deformation = kinds[i]};
    if (i % 2 == 0) edit.gains = {1.3F, 0.1F};
    commit(session, edit);
    if (i == 2) {
      const PaintOperation patch{.shape = Sphere{.center = Vec3d(0.6, 0.5, 0.1), .radius = 0.15}};
      REQUIRE(session.paint(RegionKind::kOne, patch).ok());
      REQUIRE(session.committed_picture(0, false).ok());
    }
    if (i == 4) {
      // Painted where the surface stands now, used where it stood before.
      const PaintOperation narrow{.mode = PaintMode::kShrink, .distance = 0.05};
      REQUIRE(session.paint(RegionKind::kZero, narrow).ok());
      REQUIRE(session.move_head(3).ok());
    }
  }
}

double distance_to_nearest(const Points& points, const std::vector<std::size_t>& among, const Vec3f& p) {
  float best = 1e30F;
  for (const std::size_t i : among) best = std::min(best, (points[i] - p).norm());
  return static_cast<double>(best);
}

}  // namespace

TEST_CASE("a recipe gives a fresh session of the same cloud the same bits, and its export the same bytes") {
  std::string first;
  for (const int threads : {1, 2}) {
    RecipeWorkshop workshop(threads);
    const auto original = workshop.ready();
    edit_everything(*original);
    REQUIRE(original->document()->head == 5);
    const std::string text = exported(*original);
    if (first.empty()) first = text;
    CHECK(text == first);
    CHECK(exported(*original) == text);
    RecipeWorkshop other(3 - threads);
    const auto fresh = other.ready();
    applied(*fresh, request_of(text));
    CHECK(fresh->document()->revision == 1);
    CHECK(fresh->document()->head == 5);
    CHECK(*fresh->document()->marks == *original->document()->edits->at(4)->marks);
    CHECK(exported(*fresh) == text);
    check_same_surfaces(*original, *fresh);
    for (std::size_t edit = 5; edit-- > 0;) {
      REQUIRE(fresh->move_head(edit).ok());
      REQUIRE(original->move_head(edit).ok());
      check_same_surfaces(*original, *fresh);
    }
  }
}

TEST_CASE("a recipe is appended to what is applied, with the regions of its last edit") {
  RecipeWorkshop workshop;
  const auto session = workshop.painted();
  commit(*session, lift(0.1));
  const std::string text = exported(*session);
  commit(*session, turn(0.2));
  REQUIRE(session->move_head(1).ok());
  REQUIRE(session->replace_painting(RegionKind::kOne, {}).ok());
  const std::uint64_t revision = session->document()->revision;
  applied(*session, request_of(text));
  const SharedDocument now = session->document();
  CHECK(now->revision == revision + 1);
  CHECK(now->head == 2);
  CHECK(now->edits->size() == 2);  // the undone one is gone
  CHECK(now->edits->at(1)->params == lift(0.1));
  CHECK(now->edits->at(1)->index == 2);
  CHECK(now->one.samples > 0);
  CHECK(now->one.samples == now->edits->at(1)->one_samples);
  CHECK(now->edits->at(1)->moved_samples > 0);
  CHECK_FALSE(now->one.operations->empty());
  CHECK(now->one.vertices > 0);
  // Edits go on from there.
  commit(*session, turn(0.1));
  REQUIRE(session->move_head(0).ok());
  CHECK(finest(*session).position == workshop.cloud->position);
}

TEST_CASE("an empty history is an empty recipe, and an empty recipe changes nothing") {
  RecipeWorkshop workshop;
  const auto session = workshop.painted();
  const std::string text = exported(*session);
  CHECK(request_of(text).recipe.edits.empty());
  const SharedDocument before = session->document();
  applied(*session, request_of(text));
  CHECK(session->document() == before);
  commit(*session, lift(0.1));
  const SharedDocument edited = session->document();
  applied(*session, request_of(exported(*session), 0.0));  // nothing of a sequence
  CHECK(session->document() == edited);
}

TEST_CASE("a recipe moves the same part of a denser sampling by the same deformation") {
  Workshop coarse;
  const auto session = coarse.ready();
  const auto disc = [](double radius) {
    return PaintOperation{.shape = Sphere{.center = Vec3d(0.5, 0.5, 0), .radius = radius}};
  };
  PaintOperation all{.shape = Everything{}};
  PaintOperation hole = disc(0.4);
  hole.mode = PaintMode::kRemove;
  REQUIRE(session->replace_painting(RegionKind::kZero, {all, hole}).ok());
  REQUIRE(session->replace_painting(RegionKind::kOne, {disc(0.2)}).ok());
  const Rotation rotation{.point = Vec3d(0.5, 0.5, 0.2), .axis = Vec3d(0, 1, 0), .angle_rad = 0.5};
  commit(*session, {.level = 0, .deformation = rotation});

  Workshop dense;
  dense.cloud = std::make_shared<const Cloud>(wavy_sheet(80));
  const double scale = session->describe(*session->document()).level_scales[0];
  dense.hierarchy.scales = {
      static_cast<float>(scale / static_cast<double>(bounds_of(dense.cloud->position).diagonal()))};
  const auto finer = dense.ready();
  applied(*finer, request_of(exported(*session)));

  const Points& rest = coarse.cloud->position;
  const Marks& marks = *session->document()->marks;
  std::vector<std::size_t> one;
  std::vector<std::size_t> others;
  for (std::size_t i = 0; i < marks.size(); ++i)
    (marks[i] == static_cast<std::uint8_t>(RegionKind::kOne) ? one : others).push_back(i);
  // A ball reaches at most to the middle between samples of the region and others, so what it holds of
  // another sampling is within a spacing of the border: the longest edge of the coarse sheet, its slope of
  // 0.8 included. Between balls a sample may stay without a mark, but marked ones are around it.
  const double spacing = 1.3 / 39.0;
  const Points& fine = dense.cloud->position;
  const Marks& fine_marks = *finer->document()->marks;
  const Points& moved = finest(*finer).position;
  const Mat3d turned = Eigen::AngleAxisd(rotation.angle_rad, rotation.axis).toRotationMatrix();
  std::size_t inside = 0;
  std::size_t unmarked = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const bool is_one = fine_marks[i] == static_cast<std::uint8_t>(RegionKind::kOne);
    if (is_one) CHECK(distance_to_nearest(rest, one, fine[i]) < spacing);
    if (fine_marks[i] == static_cast<std::uint8_t>(RegionKind::kZero)) CHECK(moved[i] == fine[i]);
    if (distance_to_nearest(rest, others, fine[i]) < spacing) continue;
    ++inside;
    if (!is_one) ++unmarked;
    const Vec3d expected = rotation.point + turned * (fine[i].cast<double>() - rotation.point);
    CHECK((moved[i].cast<double>() - expected).norm() < 2e-6);
  }
  CHECK(unmarked * 20 < inside);
  CHECK(inside > 300);
}

TEST_CASE(
    "regions that touch are told apart on a denser sampling too, and a recipe is never larger than allowed") {
  RecipeWorkshop workshop;
  const auto session = workshop.ready();
  REQUIRE(session->paint(RegionKind::kZero, {.shape = Everything{}}).ok());
  REQUIRE(session
              ->paint(RegionKind::kOne,
                      {.shape = Sphere{.center = Vec3d(0.5, 0.5, 0.0), .radius = 0.25}, .steal = true})
              .ok());
  commit(*session, lift(0.1));
  protocol::RecipeRequest request = request_of(exported(*session));
  RecipeWorkshop dense;
  dense.cloud = std::make_shared<const Cloud>(wavy_sheet(117));
  const auto other = dense.ready();
  request.recipe.level_scales = other->describe(*other->document()).level_scales;
  applied(*other, request);
  CHECK(other->document()->one.samples > 8 * session->document()->one.samples);
  CHECK(other->document()->zero.samples + other->document()->one.samples <= 117 * 117);

  const auto large = export_recipe(*session, 100);
  REQUIRE_FALSE(large.ok());
  CHECK(kind_of(large) == ProblemKind::kOutOfSpace);
  CHECK(large.problem().limit == 100.0);
}

TEST_CASE("what a recipe is refused for is named with its place, and nothing of it is applied") {
  RecipeWorkshop workshop;
  workshop.max_edits = 3;
  const auto session = workshop.painted();
  commit(*session, lift(0.1));
  commit(*session, turn(protocol::to_radians(6.0)));
  const SharedDocument before = session->document();
  const protocol::RecipeRequest good = request_of(exported(*session));
  const auto check_refused = [&](const protocol::RecipeRequest& request, ProblemKind kind,
                                 const std::string& pointer) {
    REQUIRE(session->move_head(0).ok());
    const SharedDocument undone = session->document();
    const auto refused = apply_recipe(*session, request, {});
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.problem().kind == kind);
    REQUIRE(refused.problem().errors.size() == 1);
    CHECK(refused.problem().errors[0].pointer == pointer);
    CHECK(session->document() == undone);
    REQUIRE(session->move_head(2).ok());  // what was undone is still there
    CHECK(session->document()->surface.surface->finest() == before->surface.surface->finest());
  };
  auto recipe = good;
  recipe.recipe.level_scales[1] *= 1.0 + 2e-3;
  check_refused(recipe, ProblemKind::kInvalidValue, "/recipe/level_scales");
  recipe.recipe.level_scales = {1.0, 0.0};
  check_refused(recipe, ProblemKind::kInvalidValue, "/recipe/level_scales");
  recipe = good;
  recipe.recipe.edits[1].edit.level = 9;
  check_refused(recipe, ProblemKind::kInvalidValue, "/recipe/edits/1/level");
  recipe = good;
  recipe.recipe.edits[1].edit.gains = {1.0F};
  check_refused(recipe, ProblemKind::kInvalidValue, "/recipe/edits/1/gains");
  recipe = good;
  recipe.recipe.edits[1].paints = true;
  recipe.recipe.edits[1].zero = {left_of(0.2)};
  check_refused(recipe, ProblemKind::kEmptyRegion, "/recipe/edits/1/one");
  recipe.recipe.edits[1].one = {left_of(0.1)};
  REQUIRE(session->move_head(0).ok());
  const auto meeting = apply_recipe(*session, recipe, {});
  REQUIRE_FALSE(meeting.ok());
  CHECK(meeting.problem().kind == ProblemKind::kRegionsIntersect);
  CHECK(meeting.problem().errors.at(0).pointer.starts_with("/recipe/edits/1"));
  recipe = good;
  recipe.recipe.edits[1].edit.deformation =
      Deformation({Translation{.vector = Vec3d(1e9, 0, 0)}, Scaling{.factors = Vec3d(1e3, 1e3, 1e3)},
                   Scaling{.factors = Vec3d(1e3, 1, 1)}});
  check_refused(recipe, ProblemKind::kInvalidValue, "/recipe/edits/1/deformation");
  recipe = good;
  recipe.recipe.edits[0].one.assign(6, right_of(0.9));
  check_refused(recipe, ProblemKind::kTooMany, "/recipe/edits/0/one/operations/5");
  recipe = good;
  recipe.recipe.edits.insert(recipe.recipe.edits.end(), 2, good.recipe.edits[1]);
  check_refused(recipe, ProblemKind::kTooMany, "/recipe/edits");
  CHECK(apply_recipe(*session, good, before->revision + 100).problem().kind == ProblemKind::kStaleRevision);
  REQUIRE(session->move_head(0).ok());
  applied(*session, good);
  CHECK(session->document()->surface.surface->finest() == before->surface.surface->finest());
}

TEST_CASE("a part of a recipe records what is made then, and a recipe of that leads to the same bits") {
  RecipeWorkshop workshop;
  const auto session = workshop.painted();
  for (const Deformation& kind : every_kind())
    commit(*session, {.level = 1, .deformation = kind, .gains = {1.2F, 0.8F}});
  const std::string text = exported(*session);
  for (const Timing timing : {Timing::kSequence, Timing::kTogether}) {
    for (const double s : {0.0, 0.3, 0.5, 0.9, 1.0}) {
      const auto part = workshop.ready();
      applied(*part, request_of(text, s, timing));
      const SharedDocument now = part->document();
      const std::size_t count =
          timing == Timing::kTogether ? 7 : static_cast<std::size_t>(std::ceil(s * 7.0));
      CHECK(now->head == count);
      const auto shown = partial_picture(*session, 2, {.s = s, .timing = timing}, false);
      REQUIRE(shown.ok());
      CHECK(shown.value().surface->finest() == finest(*part));
      if (s == 1.0) CHECK(finest(*part) == finest(*session));
      if (s == 0.0) CHECK(finest(*part).position == workshop.cloud->position);
      const auto again = workshop.ready();
      applied(*again, request_of(exported(*part)));
      CHECK(finest(*again) == finest(*part));
    }
  }
}

TEST_CASE("a session's edits play from the rest to the committed state, and nothing is recorded") {
  RecipeWorkshop workshop;
  const auto session = workshop.painted();
  const double angle = 1.5;
  commit(*session, turn(angle));
  commit(*session, lift(0.25, 1));
  REQUIRE(session->move_head(1).ok());
  const SharedDocument before = session->document();
  const Marks& marks = *before->marks;
  const Points& rest = workshop.cloud->position;
  const Vec3d point(0.5, 0.5, 0);
  for (const Timing timing : {Timing::kSequence, Timing::kTogether}) {
    for (int frame = 0; frame <= 10; ++frame) {
      const double s = frame / 10.0;
      const auto picture = partial_picture(*session, 2, {.s = s, .timing = timing}, true);
      REQUIRE(picture.ok());
      CHECK(picture.value().revision == before->revision);
      CHECK(picture.value().t != nullptr);
      const auto cloud = Session::edited_cloud(picture.value(), 2);
      if (frame == 0) CHECK(cloud->position == rest);
      if (frame == 10) CHECK(cloud->position == finest(*session).position);
      const Mat3d turned = Eigen::AngleAxisd(s * angle, Vec3d::UnitY()).toRotationMatrix();
      for (std::size_t i = 0; i < rest.size(); ++i) {
        if (marks[i] == static_cast<std::uint8_t>(RegionKind::kZero)) CHECK(cloud->position[i] == rest[i]);
        if (marks[i] != static_cast<std::uint8_t>(RegionKind::kOne)) continue;
        const Vec3d expected = point + turned * (rest[i].cast<double>() - point);
        CHECK((cloud->position[i].cast<double>() - expected).norm() < 2e-6);
      }
    }
  }
  REQUIRE(session->move_head(2).ok());
  // A sequence of two: at one half the first is whole; played together both are half-way.
  REQUIRE(session->move_head(1).ok());
  const Level first = finest(*session);
  REQUIRE(session->move_head(2).ok());
  const auto half = partial_picture(*session, 2, {.s = 0.5}, false);
  REQUIRE(half.ok());
  CHECK(half.value().surface->finest() == first);
  const auto both = partial_picture(*session, 2, {.s = 0.5, .timing = Timing::kTogether}, false);
  REQUIRE(both.ok());
  const Mat3d turned = Eigen::AngleAxisd(angle / 2, Vec3d::UnitY()).toRotationMatrix();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (marks[i] != static_cast<std::uint8_t>(RegionKind::kOne)) continue;
    const Vec3d expected = point + turned * (rest[i].cast<double>() - point) + Vec3d(0, 0, 0.125);
    CHECK((both.value().surface->finest().position[i].cast<double>() - expected).norm() < 2e-6);
  }
  CHECK(session->document()->head == 2);
  CHECK(session->document()->edits->size() == 2);
}

TEST_CASE("recipes of sessions that are not ready are refused") {
  RecipeWorkshop workshop;
  const auto failed = workshop.open(
      1, [](const Cloud&, const HierarchyParams&, const ExecutionContext&) -> Result<Hierarchy> {
        return Error{.code = ErrorCode::kEmptyCloud, .message = "no", .field = {}};
      });
  REQUIRE(comes_true([&] { return failed->document()->state == protocol::SessionState::kFailed; }));
  CHECK(kind_of(export_recipe(*failed, 1ULL << 30U)) == ProblemKind::kWrongState);
  CHECK(kind_of(apply_recipe(*failed, {}, {})) == ProblemKind::kWrongState);
  CHECK(kind_of(partial_picture(*failed, 0, {}, false)) == ProblemKind::kWrongState);
  const auto closed = workshop.painted();
  commit(*closed, lift(0.1));
  const auto recipe = request_of(exported(*closed));
  closed->close("gone");
  CHECK(kind_of(export_recipe(*closed, 1ULL << 30U)) == ProblemKind::kNotFound);
  CHECK(kind_of(apply_recipe(*closed, recipe, {})) == ProblemKind::kNotFound);
}
