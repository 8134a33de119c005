#include "protocol/json/recipe.h"

#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <random>

#include "engine/editing/partial_edit.h"
#include "tests/protocol/request_checks.h"

using namespace pointwright;
using namespace pointwright::protocol;
using namespace pointwright::test;

namespace {

const std::string kRegions =
    R"("zero":{"operations":[{"mode":"add","shape":{"type":"all"}}]},"one":{"operations":[{"mode":"flood","seed":[0,0,0]},{"mode":"invert"}]})";
const std::string kEdit = R"("level":0,"deformation":{"type":"translation","vector":[0,0,1]})";

std::string recipe_with(const std::string& edits, const std::string& more = "") {
  return R"({"recipe":{"format":"pointwright-recipe","version":1,"level_scales":[0.5,0],"edits":[)" + edits +
         "]}" + more + "}";
}

}  // namespace

TEST_CASE("a recipe is read with its regions, parts and timing") {
  const auto request = accepted(
      recipe_with("{" + kRegions + "," + kEdit + "},{" + kEdit + "}", R"(,"s":0.25,"timing":"together")"),
      parse_recipe_request);
  CHECK(request.s == 0.25);
  CHECK(request.timing == Timing::kTogether);
  CHECK(request.recipe.level_scales == std::vector<double>{0.5, 0.0});
  REQUIRE(request.recipe.edits.size() == 2);
  const RecipeEdit& first = request.recipe.edits[0];
  CHECK(first.paints);
  CHECK(first.zero.size() == 1);
  REQUIRE(first.one.size() == 2);
  CHECK(first.one[0].mode == PaintMode::kFlood);
  CHECK(first.one[1].mode == PaintMode::kInvert);
  CHECK(first.edit.deformation == Deformation(Translation{.vector = {0, 0, 1}}));
  CHECK_FALSE(request.recipe.edits[1].paints);
  const auto plain = accepted(recipe_with(""), parse_recipe_request);
  CHECK(plain.s == 1.0);
  CHECK(plain.timing == Timing::kSequence);
  CHECK(plain.recipe.edits.empty());
}

TEST_CASE("everything that is wrong with a recipe is named with its place") {
  const auto pointers = [](const std::string& text) { return refused(text, parse_recipe_request); };
  CHECK(pointers("{}") == Pointers{"/recipe"});
  CHECK(pointers(R"({"recipe":7})") == Pointers{"/recipe"});
  CHECK(pointers(R"({"recipe":{}})") ==
        Pointers{"/recipe/format", "/recipe/version", "/recipe/level_scales", "/recipe/edits"});
  CHECK(pointers(R"({"recipe":{"format":"other","version":1,"level_scales":[1,0],"edits":[]}})") ==
        Pointers{"/recipe/format"});
  for (const char* version : {"2", "0", "1.5", "\"1\"", "null"})
    CHECK(pointers(R"({"recipe":{"format":"pointwright-recipe","level_scales":[1,0],"edits":[],"version":)" +
                   std::string(version) + "}}") == Pointers{"/recipe/version"});
  CHECK(pointers(R"({"recipe":{"format":"pointwright-recipe","version":1,"level_scales":[1],"edits":[]}})") ==
        Pointers{"/recipe/level_scales"});
  CHECK(pointers(
            R"({"recipe":{"format":"pointwright-recipe","version":1,"level_scales":[-1,0],"edits":{}}})") ==
        Pointers{"/recipe/level_scales/0", "/recipe/edits"});
  CHECK(pointers(recipe_with("", R"(,"s":1.5)")) == Pointers{"/s"});
  CHECK(pointers(recipe_with("", R"(,"s":-0.5)")) == Pointers{"/s"});
  CHECK(pointers(recipe_with("", R"(,"timing":"at once")")) == Pointers{"/timing"});
  CHECK(pointers(recipe_with("", R"(,"speed":1)")) == Pointers{"/speed"});
  CHECK(pointers(recipe_with("7")) == Pointers{"/recipe/edits/0"});
  CHECK(pointers(recipe_with("{" + kEdit + "}")) == Pointers{"/recipe/edits/0/zero", "/recipe/edits/0/one"});
  CHECK(pointers(recipe_with("{" + kRegions + "," + kEdit + R"(},{"zero":{"operations":[]},)" + kEdit +
                             "}")) == Pointers{"/recipe/edits/1/one"});
  CHECK(pointers(recipe_with("{" + kRegions + "," + kEdit + R"(,"colour":1})")) ==
        Pointers{"/recipe/edits/0/colour"});
  CHECK(
      pointers(recipe_with("{" + kRegions + R"(,"level":0,"deformation":{"type":"rotation","angle_deg":1,)" +
                           R"("axis":{"point":[0,0,0],"direction":[0,0,0]}}})")) ==
      Pointers{"/recipe/edits/0/deformation/axis/direction"});
  CHECK(pointers(recipe_with(R"({"one":{"operations":[{"mode":"add","shape":{"type":"sphere","radius":-1,)"
                             R"("center":[0,0,0]}}]},"zero":{"operations":[{"mode":"grow"}],"x":1},)" +
                             kEdit + "}")) == Pointers{"/recipe/edits/0/zero/operations/0/distance",
                                                       "/recipe/edits/0/zero/x",
                                                       "/recipe/edits/0/one/operations/0/shape/radius"});
}

TEST_CASE("a recipe is read back as it was written, to the bit") {
  std::mt19937_64 random(11);
  const auto number = [&] {
    std::uniform_real_distribution<double> mantissa(-1.0, 1.0);
    return std::ldexp(mantissa(random), static_cast<int>(random() % 40U) - 20);
  };
  const auto vector = [&] { return Vec3d(number(), number(), number()); };
  std::vector<RecipeEdit> edits;
  for (int i = 0; i < 200; ++i) {
    PointSet balls;
    for (int j = 0; j < 5; ++j) {
      balls.points.push_back(vector());
      balls.radii.push_back(std::max(std::abs(number()), 1e-200));
    }
    // Such angles as degrees stand for: what a session records.
    const double angle = to_radians(to_degrees(number() * 5e-4));
    Deformation deformation({NormalOffset{.distance = number()}, Translation{.vector = vector()},
                             Rotation{.point = vector(), .axis = vector(), .angle_rad = angle},
                             TowardPoint{.target = vector(), .amount = -std::abs(number()) * 1e-5},
                             Twist{.point = vector(), .axis = vector(), .angle_rad = -angle, .length = 0.1}});
    edits.push_back({.paints = i % 3 == 0,
                     .edit = {.level = 1,
                              .blend = static_cast<Blend>(i % 4),
                              .deformation = scaled(deformation, 1.0),
                              .gains = {static_cast<float>(number() * 1e-6), 0.1F}}});
    if (i % 3 != 0) continue;
    edits.back().zero = {{.shape = balls}};
    balls.points.resize(1);
    balls.radii = {1e-200};
    edits.back().one = {{.mode = PaintMode::kSet, .shape = balls, .steal = true}};
  }
  const std::vector<double> scales{0.1, 1.0 / 3.0, 0.0};
  std::string text = R"({"recipe":)" + recipe_head(scales);
  for (std::size_t i = 0; i < edits.size(); ++i) text += (i > 0 ? ",\n" : "") + to_json(edits[i]).dump();
  text += std::string(recipe_tail()) + "}";
  const Recipe read = accepted(text, parse_recipe_request).recipe;
  CHECK(read.level_scales == scales);
  REQUIRE(read.edits.size() == edits.size());
  for (std::size_t i = 0; i < edits.size(); ++i) {
    REQUIRE(read.edits[i].edit == edits[i].edit);
    REQUIRE(read.edits[i].paints == edits[i].paints);
    if (!edits[i].paints) continue;
    const auto& balls = std::get<PointSet>(read.edits[i].zero[0].shape);
    const auto& written = std::get<PointSet>(edits[i].zero[0].shape);
    REQUIRE(balls.points == written.points);
    REQUIRE(balls.radii == written.radii);
    REQUIRE(read.edits[i].one[0].steal);
    REQUIRE(std::get<PointSet>(read.edits[i].one[0].shape).radii == std::vector<double>{1e-200});
  }
}
