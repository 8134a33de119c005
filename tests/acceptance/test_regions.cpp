// Regions under names, through the real daemon: kept, used, carried through edits, and brought back.

#include <doctest/doctest.h>

#include <csignal>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kAny = "If-Match: *\r\n";
const std::string kBall = R"({"mode":"add","shape":{"type":"sphere","center":[0.6,0.5,0],"radius":0.15}})";

std::string list_of(const std::string& operations) {
  return R"({"operations":[)" + operations + "]}";
}
std::string use(const std::string& name, const std::string& mode = "add") {
  return R"({"mode":")" + mode + R"(","shape":{"type":"region","region":")" + name + R"("}})";
}

json put(Daemon& daemon, const std::string& session, const std::string& region,
         const std::string& operations) {
  const Reply reply = daemon.ask("PUT", session + "/regions/" + region, list_of(operations));
  REQUIRE_MESSAGE(reply.status == 200, reply.body);
  return reply.json();
}

json paint(Daemon& daemon, const std::string& session, const std::string& region,
           const std::string& operation) {
  const Reply reply = daemon.ask("POST", session + "/regions/" + region + "/operations", operation);
  REQUIRE_MESSAGE(reply.status == 200, reply.body);
  return reply.json();
}

json named(const json& document, const std::string& name) {
  for (const json& region : document["regions"]["named"])
    if (region["region"] == name) return region;
  return nullptr;
}

std::string opened(Daemon& daemon, std::size_t side = 40) {
  const std::string cloud = daemon.upload(file_of(wavy_sheet(side)), "application/x-ply").json()["id"];
  return daemon.open_session(cloud, "[0.08,0.03]");
}

std::string samples(Daemon& daemon, const std::string& session) {
  const Reply reply = daemon.get(session + "/samples?format=ply");
  REQUIRE(reply.status == 200);
  return reply.body;
}

void edit(Daemon& daemon, const std::string& session, const std::string& body) {
  const Reply reply = daemon.ask("POST", session + "/edits", body, kAny);
  REQUIRE_MESSAGE(reply.status == 201, reply.body);
}

}  // namespace

TEST_CASE("a region is kept under a name, listed, added to, replaced and deleted") {
  Daemon daemon;
  const std::string session = opened(daemon);
  CHECK(daemon.get(session).json()["regions"]["named"].empty());
  CHECK(daemon.get(session + "/regions/left%20wing").status == 404);

  json document = put(daemon, session, "left%20wing", kLeft);
  const std::size_t left = named(document, "left wing")["samples"];
  CHECK(left == 320);  // 8 of 40 columns
  CHECK(document["revision"] == 1);
  CHECK(document["regions"]["zero"]["samples"] == 0);
  document = paint(daemon, session, "left%20wing", kBall);
  CHECK(document["changed"].get<std::size_t>() > 50);
  CHECK(named(document, "left wing")["samples"] == left + document["changed"].get<std::size_t>());
  CHECK(named(document, "left wing")["operations"] == 2);
  // Painting a name makes it; names are listed in their order, after zero and one.
  paint(daemon, session, "ball", kBall);
  paint(daemon, session, "one", kRight);
  const Reply listed = daemon.get(session + "/regions");
  CHECK(listed.status == 200);
  CHECK(listed.headers.at("etag") == "\"r4\"");
  std::vector<std::string> names;
  const json all = listed.json()["regions"];
  for (const json& region : all) names.push_back(region["region"]);
  CHECK(names == std::vector<std::string>{"zero", "one", "ball", "left wing"});
  CHECK(listed.json()["regions"][1]["samples"] == 320);

  const json painting = daemon.get(session + "/regions/left%20wing").json();
  CHECK(painting["region"] == "left wing");
  CHECK(painting["operations"].size() == 2);
  CHECK(painting["operations"][0]["shape"]["type"] == "box");
  // Put back whole, it is what it was; put back without its last operation, that is undone.
  CHECK(named(put(daemon, session, "left%20wing", painting["operations"][0].dump()),
              "left wing")["samples"] == left);
  // Growing, inverting and clearing work as on the two others.
  document = paint(daemon, session, "left%20wing", R"({"mode":"invert"})");
  CHECK(named(document, "left wing")["samples"] == 1600 - left);
  document = paint(daemon, session, "left%20wing", R"({"mode":"shrink","distance":0.03})");
  CHECK(named(document, "left wing")["samples"] == 1600 - left - 40);

  CHECK(daemon.ask("DELETE", session + "/regions/ball").status == 200);
  CHECK(daemon.get(session + "/regions/ball").status == 404);
  CHECK(daemon.ask("DELETE", session + "/regions/ball").status == 404);
  CHECK(daemon.get(session).json()["regions"]["named"].size() == 1);
  CHECK(daemon.ask("PUT", session + "/regions/left%20wing", list_of(kBall), "If-Match: \"r1\"\r\n").status ==
        412);
}

TEST_CASE("a kept region is painted with, by every mode, and the painting outlives it") {
  Daemon daemon;
  const std::string session = opened(daemon);
  put(daemon, session, "ball", kBall);
  const std::size_t ball = named(daemon.get(session).json(), "ball")["samples"];
  const auto one = [&] { return daemon.get(session).json()["regions"]["one"]["samples"].get<std::size_t>(); };
  paint(daemon, session, "one", use("ball"));
  CHECK(one() == ball);
  // What is recorded are volumes: the list holds by itself.
  const json recorded = daemon.get(session + "/regions/one").json()["operations"];
  REQUIRE(recorded.size() == 1);
  CHECK(recorded[0]["shape"]["type"] == "points");
  paint(daemon, session, "one", kRight);
  CHECK(one() == ball + 320);
  paint(daemon, session, "one", use("ball", "remove"));
  CHECK(one() == 320);
  paint(daemon, session, "one", use("ball", "set"));
  CHECK(one() == ball);
  put(daemon, session, "part",
      R"({"mode":"add","shape":{"type":"half_space","point":[0.6,0,0],"normal":[1,0,0]}})");
  paint(daemon, session, "one", use("part", "intersect"));
  const std::size_t part = one();
  CHECK(part > 0);
  CHECK(part < ball);
  // The regions of edits can be kept, and names be made of names.
  put(daemon, session, "kept", use("one", "set"));
  put(daemon, session, "both", use("kept") + "," + kLeft);
  CHECK(named(daemon.get(session).json(), "both")["samples"] == part + 320);
  // Zero and one never share: stealing takes the samples from the other, names from nobody.
  const json document = paint(daemon, session, "zero",
                              R"({"mode":"add","steal":true,"shape":{"type":"region","region":"both"}})");
  CHECK(document["regions"]["zero"]["samples"] == part + 320);
  CHECK(document["regions"]["one"]["samples"] == 0);
  CHECK(named(document, "ball")["samples"] == ball);
  const json zero = daemon.get(session + "/regions/zero").json();
  for (const char* name : {"ball", "part", "kept", "both"})
    REQUIRE(daemon.ask("DELETE", session + "/regions/" + name).status == 200);
  CHECK(daemon.get(session + "/regions/zero").json() == zero);
  CHECK(put(daemon, session, "zero", zero["operations"][0].dump())["regions"]["zero"]["samples"].get<int>() >
        0);
}

TEST_CASE("kept regions stay with their samples through edits, resampling, undo and kill -9") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  std::string session;
  json regions, wing;
  std::string after;
  {
    Daemon daemon(arguments);
    session = opened(daemon);
    put(daemon, session, "right", kRight);
    put(daemon, session, "middle",
        R"({"mode":"add","shape":{"type":"box","min":[0.4,-1,-1],"max":[0.6,2,1]}})");
    const std::size_t middle = named(daemon.get(session).json(), "middle")["samples"];
    put(daemon, session, "zero", kLeft);
    paint(daemon, session, "one", use("right"));
    edit(daemon, session, translation(0.3));
    // The surface has moved away from the box that painted them; the region has its samples.
    CHECK(named(daemon.get(session).json(), "right")["samples"] == 320);
    paint(daemon, session, "one", R"({"mode":"clear"})");
    CHECK(paint(daemon, session, "one", use("right"))["regions"]["one"]["samples"] == 320);
    edit(daemon, session,
         R"({"level":0,"deformation":{"type":"translation","vector":[1,0,0]},"resampling":{"bound":1.3}})");
    const std::size_t stretched = named(daemon.get(session).json(), "middle")["samples"];
    CHECK(stretched > middle + 50);  // inserted samples are where their parents are
    REQUIRE(daemon.ask("PUT", session + "/head", R"({"edit":1})").status == 200);
    CHECK(named(daemon.get(session).json(), "middle")["samples"] == middle);
    REQUIRE(daemon.ask("PUT", session + "/head", R"({"edit":2})").status == 200);
    CHECK(named(daemon.get(session).json(), "middle")["samples"] == stretched);
    regions = daemon.get(session + "/regions").json();
    wing = daemon.get(session + "/regions/middle").json();
    after = samples(daemon, session);
    daemon.stop(SIGKILL);
  }
  for (int round = 0; round < 2; ++round) {
    Daemon daemon(arguments);
    for (int i = 0; i < 2000 && daemon.get(session).json()["state"] != "ready"; ++i) ::usleep(5000);
    CHECK(daemon.get(session + "/regions").json() == regions);
    CHECK(daemon.get(session + "/regions/middle").json() == wing);
    CHECK(samples(daemon, session) == after);
    if (round == 1) {
      // What was used travels in the recipe as volumes: it replays on a session that knows no names.
      const std::string cloud = daemon.get(session).json()["cloud"];
      const std::string fresh = daemon.open_session(cloud, "[0.08,0.03]");
      const Reply applied = daemon.ask("POST", fresh + "/recipe",
                                       R"({"recipe":)" + daemon.get(session + "/recipe").body + "}", kAny);
      REQUIRE_MESSAGE(applied.status == 200, applied.body);
      CHECK(samples(daemon, fresh) == after);
      CHECK(applied.json()["regions"]["named"].empty());
    }
    daemon.stop(SIGKILL);
  }
}

TEST_CASE("what regions under names are refused for") {
  Daemon daemon({"--max-named-regions", "2"});
  const std::string session = opened(daemon, 20);
  const auto status = [&](const std::string& region, const std::string& operation) {
    return daemon.ask("POST", session + "/regions/" + region + "/operations", operation).status;
  };
  for (const std::string& name : {std::string("t"), std::string("a%2Fb"), std::string("%C3%B6"),
                                  std::string(65, 'x'), std::string("a%0A")})
    CHECK(daemon.ask("PUT", session + "/regions/" + name, list_of(kBall)).status >= 400);
  const auto pointer = [&](const std::string& region, const std::string& operation) {
    const Reply reply = daemon.ask("POST", session + "/regions/" + region + "/operations", operation);
    CHECK(reply.status == 422);
    return reply.json()["errors"][0]["pointer"].get<std::string>();
  };
  CHECK(pointer("one", use("nobody")) == "/shape/region");
  CHECK(pointer("one", use("a/b")) == "/shape/region");
  CHECK(pointer("a", R"({"mode":"add","steal":true,"shape":{"type":"all"}})") == "/steal");
  CHECK(pointer("a", R"({"mode":"flood","seed":[0,0,0],"stop_at_other":true})") == "/stop_at_other");
  const Reply listed = daemon.ask("PUT", session + "/regions/zero", list_of(kLeft + "," + use("nobody")));
  CHECK(listed.status == 422);
  CHECK(listed.json()["errors"][0]["pointer"] == "/operations/1/shape/region");
  CHECK(daemon.get(session).json()["revision"] == 0);

  CHECK(status("a", kBall) == 200);
  CHECK(status("b", kBall) == 200);
  const Reply full = daemon.ask("PUT", session + "/regions/c", list_of(kBall));
  CHECK(full.status == 429);
  CHECK(full.json()["limit"] == 2);
  CHECK(status("a", kRight) == 200);
  CHECK(daemon.get("/v1/info").json()["limits"]["max_named_regions"] == 2);

  put(daemon, session, "zero", kLeft);
  put(daemon, session, "one", kRight);
  edit(daemon, session, translation(0.1));
  json recipe = daemon.get(session + "/recipe").json();
  recipe["edits"][0]["one"]["operations"] = json::array({json::parse(use("a"))});
  const Reply refused = daemon.ask("POST", session + "/recipe", json{{"recipe", recipe}}.dump(), kAny);
  CHECK(refused.status == 422);
  CHECK(refused.json()["errors"][0]["pointer"] == "/recipe/edits/0/one/operations/0/shape/type");
}
