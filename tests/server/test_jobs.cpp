// A recipe on a preview, without a session, and what it says about other samplings.
#include <doctest/doctest.h>

#include "engine/resampling/resampled_edit.h"
#include "protocol/json/parse.h"
#include "server/jobs/recipe_script.h"
#include "server/sessions/recipes.h"
#include "tests/server/workshop.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::Timing;

namespace {

struct JobWorkshop : Workshop {
  JobWorkshop() {
    hierarchy.scales = {0.08F, 0.03F};
    resample = apply_resampled_edit;
  }
};

EditParams edit_by(ElementaryDeformation step, std::uint32_t level) {
  EditParams edit{.level = level};
  edit.deformation.steps = {std::move(step)};
  return edit;
}

/// Edits of all levels, so that coarser ones are derived in between; repainted; one that inserts samples.
void edit_much(Session& session) {
  REQUIRE(session.paint(RegionKind::kZero, left_of(0.2)).ok());
  REQUIRE(session.paint(RegionKind::kOne, right_of(0.8)).ok());
  commit(session, edit_by(Translation{.vector = {0.02, 0.0, 0.1}}, 0));
  commit(session, edit_by(Rotation{.point = Vec3d(0.5, 0.4, 0.1),
                                   .axis = {0, 1, 0},
                                   .angle_rad = protocol::to_radians(20.0)},
                          2));
  const PaintOperation patch{.shape = Sphere{.center = Vec3d(0.6, 0.5, 0.1), .radius = 0.15}};
  REQUIRE(session.paint(RegionKind::kOne, patch).ok());
  EditParams stretch = edit_by(Translation{.vector = {0.8, 0.0, 0.0}}, 0);
  stretch.resampling = ResamplingParams{};
  commit(session, stretch);
  EditParams weighed = edit_by(Translation{.vector = {0.0, 0.0, 0.2}}, 1);
  weighed.gains = {1.0F, 0.5F};
  commit(session, weighed);
}

protocol::RecipeRequest recipe_of(Session& session, double s, Timing timing) {
  const auto text = export_recipe(session, 1ULL << 30U);
  REQUIRE(text.ok());
  auto parsed =
      protocol::parse_body(R"({"recipe":)" + text.value().text + "}", {}, protocol::parse_recipe_request);
  REQUIRE(parsed.ok());
  protocol::RecipeRequest request = std::move(parsed).value();
  request.s = s;
  request.timing = timing;
  return request;
}

}  // namespace

TEST_CASE(
    "a recipe on a preview gives a session's bits, and its script gives the preview's samples the same") {
  JobWorkshop workshop;
  const auto session = workshop.ready();
  edit_much(*session);
  for (const auto& how : {std::pair(1.0, Timing::kSequence), std::pair(0.6, Timing::kSequence),
                          std::pair(0.5, Timing::kTogether), std::pair(0.0, Timing::kSequence)}) {
    CAPTURE(how.first);
    const auto request = recipe_of(*session, how.first, how.second);
    const auto other = workshop.ready();
    const auto applied = apply_recipe(*other, request, other->document()->revision);
    REQUIRE(applied.ok());
    const Level expected = finest(*other);

    const ExecutionContext context;
    const auto played = play_on_preview(request, workshop.cloud, workshop.hierarchy, context);
    REQUIRE_MESSAGE(played.ok(), (played.ok() ? "" : played.problem().detail));
    CHECK(played.value().result == expected.position);
    CHECK(played.value().inserted == expected.position.size() - workshop.cloud->size());

    const AnchorIndex anchors(played.value().script.rest);
    const auto made = transfer_edits(played.value().script, anchors, workshop.cloud, context);
    REQUIRE(made.ok());
    CHECK(made.value().surface.finest() == expected);
  }
}

TEST_CASE("a recipe's levels become fractions of the preview's diagonal") {
  JobWorkshop workshop;
  const auto session = workshop.ready();
  edit_much(*session);
  auto request = recipe_of(*session, 1.0, Timing::kSequence);
  const auto params = hierarchy_for(request.recipe, *workshop.cloud, 12);
  REQUIRE(params.ok());
  CHECK(params.value().neighbors == 12);
  REQUIRE(params.value().scales.size() == 2);
  CHECK(params.value().scales[0] == doctest::Approx(0.08));
  CHECK(params.value().scales[1] == doctest::Approx(0.03));
  request.recipe.level_scales[0] *= 1000.0;
  const auto beyond = hierarchy_for(request.recipe, *workshop.cloud, 12);
  REQUIRE_FALSE(beyond.ok());
  CHECK(beyond.problem().errors.front().pointer == "/recipe/level_scales");
}

TEST_CASE("a recipe that cannot be played says which edit and why, and stops when it is asked to") {
  JobWorkshop workshop;
  const auto session = workshop.ready();
  edit_much(*session);
  auto request = recipe_of(*session, 1.0, Timing::kSequence);
  const ExecutionContext context;
  request.recipe.edits[1].edit.level = 7;
  const auto beyond = play_on_preview(request, workshop.cloud, workshop.hierarchy, context);
  REQUIRE_FALSE(beyond.ok());
  CHECK(beyond.problem().detail.find("edit 2") != std::string::npos);
  CHECK(beyond.problem().errors.front().pointer.starts_with("/recipe/edits/1"));
  request.recipe.edits[1].edit.level = 2;
  request.recipe.edits[0].one.clear();
  const auto empty = play_on_preview(request, workshop.cloud, workshop.hierarchy, context);
  REQUIRE_FALSE(empty.ok());
  CHECK(empty.problem().detail.find("edit 1") != std::string::npos);
  context.cancel();
  CHECK_FALSE(play_on_preview(request, workshop.cloud, workshop.hierarchy, context).ok());
}
