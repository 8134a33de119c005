// Recipes through the real daemon: exported, applied elsewhere, played part of the way.

#include <doctest/doctest.h>

#include <cmath>
#include <set>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kScales = "[0.08,0.03]";
const std::string kAny = "If-Match: *\r\n";

void paint(Daemon& daemon, const std::string& session, const std::string& region,
           const std::string& operations) {
  REQUIRE(
      daemon.ask("PUT", session + "/regions/" + region, R"({"operations":[)" + operations + "]}").status ==
      200);
}

void edit(Daemon& daemon, const std::string& session, const std::string& body) {
  const Reply reply = daemon.ask("POST", session + "/edits", body, kAny);
  REQUIRE_MESSAGE(reply.status == 201, reply.body);
}

Reply apply(Daemon& daemon, const std::string& session, const json& recipe, const std::string& more = "",
            const std::string& match = kAny) {
  return daemon.ask("POST", session + "/recipe", R"({"recipe":)" + recipe.dump() + more + "}", match);
}

std::string samples(Daemon& daemon, const std::string& session, const std::string& query) {
  const Reply reply = daemon.get(session + "/samples?format=ply" + query);
  REQUIRE_MESSAGE(reply.status == 200, reply.body);
  return reply.body;
}

/// Every kind of deformation, gains, levels, paintings between, one of them on a surface that was undone.
void edit_everything(Daemon& daemon, const std::string& session) {
  paint(daemon, session, "zero", kLeft);
  paint(daemon, session, "one", kRight);
  edit(daemon, session, translation(0.1, R"(,"gains":[1.5,0.25])"));
  edit(daemon, session,
       R"({"level":2,"blend":"cosine","deformation":{"type":"along_normal","distance":-0.02}})");
  edit(
      daemon, session,
      R"({"level":0,"deformation":{"type":"rotation","angle_deg":12.3,"axis":{"point":[0.5,0.5,0],"direction":[1,2,3]}}})");
  paint(daemon, session, "one",
        R"({"mode":"add","shape":{"type":"sphere","center":[0.6,0.5,0],"radius":0.2}})");
  edit(daemon, session,
       R"({"level":1,"deformation":{"type":"scale","center":[0.5,0.5,0],"factors":[1.1,1,0.9]}})");
  paint(daemon, session, "zero",
        R"({"mode":"add","shape":{"type":"half_space","point":[0.25,0,0],"normal":[-1,0,0.1]}})");
  REQUIRE(daemon.ask("PUT", session + "/head", R"({"edit":3})").status == 200);
  edit(
      daemon, session,
      R"({"level":1,"blend":"cubic","deformation":{"type":"twist","angle_deg":-20,"length":0.7,"axis":{"point":[0.5,0.5,0],"direction":[0,1,0]}}})");
  edit(
      daemon, session,
      R"({"level":2,"blend":"quintic","deformation":{"type":"toward_point","target":[0.6,0.5,0.4],"amount":0.2},"gains":[1,-1]})");
  edit(
      daemon, session,
      R"({"level":0,"deformation":{"type":"sequence","steps":[{"type":"translation","vector":[0,0,0.05]},{"type":"scale","center":[0.7,0.5,0],"factors":[1,1.2,1]}]}})");
}

}  // namespace

TEST_CASE("a recipe gives another session of the same cloud the same bits, with one thread and with two") {
  const std::string file = file_of(wavy_sheet(40));
  std::string recipe;
  std::vector<std::string> levels;
  for (const char* threads : {"1", "2"}) {
    Daemon daemon({"--threads", threads});
    const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
    if (recipe.empty()) {
      const std::string session = daemon.open_session(cloud, kScales);
      edit_everything(daemon, session);
      const Reply exported = daemon.get(session + "/recipe");
      REQUIRE(exported.status == 200);
      CHECK(exported.headers.at("etag") == daemon.get(session).headers.at("etag"));
      CHECK(
          daemon.get(session + "/recipe", "If-None-Match: " + exported.headers.at("etag") + "\r\n").status ==
          304);
      recipe = exported.body;
      CHECK(exported.json()["edits"].size() == 6);
      for (const char* level : {"&level=0", "&level=1", "&level=2"})
        levels.push_back(samples(daemon, session, level));
    }
    const std::string fresh = daemon.open_session(cloud, kScales);
    const Reply applied = apply(daemon, fresh, json::parse(recipe), "", "If-Match: \"r0\"\r\n");
    REQUIRE_MESSAGE(applied.status == 200, applied.body);
    CHECK(applied.headers.at("etag") == "\"r1\"");
    CHECK(applied.json()["history"]["head"] == 6);
    CHECK(applied.json()["regions"]["one"]["samples"].get<int>() > 0);
    CHECK(daemon.get(fresh + "/recipe").body == recipe);
    for (std::size_t level = 0; level < levels.size(); ++level)
      CHECK(samples(daemon, fresh, "&level=" + std::to_string(level)) == levels[level]);
  }
}

TEST_CASE("a session plays from the rest to its edits in every format, and tags say which part") {
  Daemon daemon;
  const std::string file = file_of(wavy_sheet(40));
  const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
  const std::string session = daemon.open_session(cloud, kScales);
  const std::string rest = samples(daemon, session, "");
  paint(daemon, session, "zero", kLeft);
  paint(daemon, session, "one", kRight);
  edit(
      daemon, session,
      R"({"level":0,"deformation":{"type":"rotation","angle_deg":90,"axis":{"point":[0.5,0.5,0],"direction":[0,1,0]}}})");
  const std::string whole = samples(daemon, session, "");
  const Cloud before = cloud_of(rest);
  std::vector<Cloud> frames;
  for (int i = 0; i <= 10; ++i) {
    const std::string s = i == 10 ? "1" : "0." + std::to_string(i);
    const std::string part = samples(daemon, session, "&s=" + s);
    if (i == 0) CHECK(part == rest);
    if (i == 10) CHECK(part == whole);
    CHECK(samples(daemon, session, "&timing=together&s=" + s) == part);  // one edit plays the same either way
    frames.push_back(cloud_of(part));
  }
  // Each sample of the one-region keeps its distance from the axis and turns by as much in each frame.
  const Vec3d axis_point(0.5, 0.5, 0);
  for (std::size_t sample = 0; sample < before.size(); ++sample) {
    const Vec3d start = model_position(before, sample);
    if (start.x() <= 0.2)
      for (const Cloud& frame : frames) CHECK(model_position(frame, sample) == start);
    if (start.x() < 0.8) continue;
    for (int i = 0; i <= 10; ++i) {
      const Mat3d turned = Eigen::AngleAxisd(std::acos(-1.0) / 20.0 * i, Vec3d::UnitY()).toRotationMatrix();
      const Vec3d expected = axis_point + turned * (start - axis_point);
      CHECK((model_position(frames[static_cast<std::size_t>(i)], sample) - expected).norm() < 2e-6);
    }
  }

  const std::string half = session + "/samples?s=0.5&format=";
  std::set<std::string> tags;
  for (const char* format : {"ply", "draco", "xyz", "frame"}) {
    const Reply reply = daemon.get(half + format);
    CHECK(reply.status == 200);
    tags.insert(reply.headers.at("etag"));
    CHECK(daemon.get(half + format, "If-None-Match: " + reply.headers.at("etag") + "\r\n").status == 304);
  }
  tags.insert(daemon.get(half + "ply&timing=together").headers.at("etag"));
  tags.insert(daemon.get(half + "ply&level=0").headers.at("etag"));
  tags.insert(daemon.get(session + "/samples?s=0.25&format=ply").headers.at("etag"));
  tags.insert(daemon.get(session + "/samples?format=ply").headers.at("etag"));
  CHECK(tags.size() == 8);
  for (const char* query : {"s=1.5", "s=-0.1", "s=nan", "s=", "s=0.5x", "timing=slow", "s=0.1&s=0.2"}) {
    const Reply refused = daemon.get(session + "/samples?" + query);
    CHECK(refused.status == 422);
    CHECK(refused.json()["errors"][0]["pointer"].get<std::string>().substr(0, 2) ==
          std::string("?") + query[0]);
  }
  CHECK(daemon.get(session).headers.at("etag") == "\"r3\"");  // nothing was recorded
}

TEST_CASE("what a recipe is refused for") {
  Daemon daemon({"--max-recipe-bytes", "4000"});
  const std::string cloud = daemon.upload(file_of(wavy_sheet(40)), "application/x-ply").json()["id"];
  const std::string session = daemon.open_session(cloud, kScales);
  const Reply empty = daemon.get(session + "/recipe");
  REQUIRE(empty.status == 200);
  const json none = empty.json();
  CHECK(none["format"] == "pointwright-recipe");
  CHECK(none["version"] == 1);
  CHECK(none["level_scales"].size() == 3);
  CHECK(none["edits"] == json::array());
  CHECK(apply(daemon, session, none).status == 200);
  CHECK(daemon.get(session).headers.at("etag") == "\"r0\"");

  json recipe = none;
  recipe["edits"] = json::array({json::parse(translation(0.1))});
  recipe["edits"][0]["zero"] = {{"operations", {json::parse(kLeft)}}};
  recipe["edits"][0]["one"] = {{"operations", {json::parse(kRight)}}};
  const auto pointer_of = [&](const json& wrong) {
    const Reply reply = apply(daemon, session, wrong);
    CHECK_MESSAGE(reply.status == 422, reply.body);
    return reply.json()["errors"][0]["pointer"].get<std::string>();
  };
  CHECK(apply(daemon, session, recipe, "", "").status == 428);
  CHECK(apply(daemon, session, recipe, "", "If-Match: \"r7\"\r\n").status == 412);
  json wrong = recipe;
  wrong["version"] = 2;
  CHECK(pointer_of(wrong) == "/recipe/version");
  wrong = recipe;
  wrong["level_scales"][0] = 1.0;
  CHECK(pointer_of(wrong) == "/recipe/level_scales");
  wrong = recipe;
  wrong["edits"][0]["one"]["operations"][0]["shape"]["min"] = {5, 5, 5};
  CHECK(pointer_of(wrong) == "/recipe/edits/0/one/operations/0/shape/min");
  wrong = recipe;
  wrong["edits"][0]["one"]["operations"][0]["shape"]["min"] = {1.5, -1, -1};
  CHECK(pointer_of(wrong) == "/recipe/edits/0/one");
  wrong = recipe;
  wrong["edits"][0]["level"] = 7;
  CHECK(pointer_of(wrong) == "/recipe/edits/0/level");
  CHECK(daemon.ask("POST", session + "/recipe", std::string(5000, ' '), kAny).status == 413);
  CHECK(daemon.get(session).headers.at("etag") == "\"r0\"");
  CHECK(daemon.get("/v1/info").json()["limits"]["max_recipe_bytes"] == 4000);

  CHECK(apply(daemon, session, recipe, R"(,"s":0.5,"timing":"together")").status == 200);
  const json edits = daemon.get(session + "/edits").json();
  CHECK(edits["edits"][0]["edit"]["deformation"]["vector"][2] == 0.05);
}
