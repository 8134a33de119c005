// Sessions on a part of their cloud, through the real daemon.

#include <doctest/doctest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kAny = "If-Match: *\r\n";

json create(Daemon& daemon, const std::string& cloud, const std::string& more) {
  const Reply reply =
      daemon.ask("POST", "/v1/sessions", R"({"cloud":")" + cloud + R"(","scales":[0.08,0.03])" + more + "}");
  REQUIRE_MESSAGE(reply.status == 202, reply.body);
  return reply.json();
}

std::string path_of(const json& session) {
  return "/v1/sessions/" + session["id"].get<std::string>();
}

json ready(Daemon& daemon, const std::string& session) {
  for (int i = 0; i < 6000; ++i) {
    const json document = daemon.get(session).json();
    if (document["state"] != "building") {
      REQUIRE_MESSAGE(document["state"] == "ready", document.dump());
      return document;
    }
    ::usleep(5000);
  }
  FAIL("it is never built");
  return {};
}

void edit(Daemon& daemon, const std::string& session) {
  for (const auto& [region, operation] : {std::pair{"/regions/zero", kLeft}, {"/regions/one", kRight}})
    REQUIRE(daemon.ask("PUT", session + region, R"({"operations":[)" + operation + "]}").status == 200);
  REQUIRE(daemon.ask("POST", session + "/edits", translation(0.3), kAny).status == 201);
}

Cloud samples(Daemon& daemon, const std::string& session, const std::string& query = "") {
  const Reply reply = daemon.get(session + "/samples?format=ply" + query);
  REQUIRE_MESSAGE(reply.status == 200, reply.body);
  return cloud_of(reply.body);
}

std::vector<std::uint32_t> indices_of(const Cloud& cloud) {
  REQUIRE(cloud.scalars.size() == 1);
  REQUIRE(cloud.scalars[0].name == "cloud_index");
  return std::get<std::vector<std::uint32_t>>(cloud.scalars[0].values);
}

}  // namespace

TEST_CASE("a preview has the cloud's own samples, evenly spread, and after kill -9 the same bits") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  const std::string file = file_of(wavy_sheet(100));
  std::string session;
  json document;
  std::string edited;
  {
    Daemon daemon(arguments);
    const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
    const json made = create(daemon, cloud, R"(,"preview":{"count":2500})");
    CHECK(made["preview"] == json{{"count", 2500}, {"of", 10000}});
    CHECK(made["sample_count"] == 2500);
    session = path_of(made);
    const json built = ready(daemon, session);
    CHECK(built["sample_count"] == 2500);
    CHECK(built["timings_ms"].contains("subsample"));
    CHECK(daemon.get("/v1/sessions").json()["sessions"][0]["preview"]["of"] == 10000);

    const Cloud whole = cloud_of(file);
    const Cloud part = samples(daemon, session, "&attributes=color,cloud_index");
    const std::vector<std::uint32_t> index = indices_of(part);
    REQUIRE(part.size() == 2500);
    CHECK(std::is_sorted(index.begin(), index.end()));
    CHECK(std::set(index.begin(), index.end()).size() == 2500);
    for (std::size_t i = 0; i < part.size(); ++i) {
      CHECK(model_position(part, i) == model_position(whole, index[i]));
      CHECK(part.color[i] == whole.color[index[i]]);
    }
    // Evenly spread: a quarter of a grid is about two of its steps apart, and no place is left out.
    constexpr double kStep = 1.0 / 99.0;
    double farthest = 0.0;
    for (std::size_t i = 0; i < whole.size(); i += 7) {
      double nearest = 1.0;
      for (std::size_t k = 0; k < part.size(); ++k)
        nearest = std::min(nearest, (model_position(whole, i) - model_position(part, k)).norm());
      farthest = std::max(farthest, nearest);
    }
    CHECK(farthest < 3.0 * kStep);
    // The levels mean what they mean on the whole cloud.
    const json full = ready(daemon, path_of(create(daemon, cloud, "")));
    CHECK(full["levels"] == built["levels"]);
    CHECK_FALSE(full.contains("preview"));

    edit(daemon, session);
    document = daemon.get(session).json();
    edited = daemon.get(session + "/samples?format=ply").body;
    daemon.stop(SIGKILL);
  }
  Daemon daemon(arguments);
  const json listed = daemon.get("/v1/sessions").json()["sessions"][0];
  CHECK(listed["state"] == "asleep");
  CHECK(listed["preview"] == json{{"count", 2500}, {"of", 10000}});
  json woken = ready(daemon, session);
  for (json* each : {&woken, &document}) each->erase("timings_ms");
  CHECK(woken == document);
  CHECK(daemon.get(session + "/samples?format=ply").body == edited);
  CHECK(daemon.get(session + "/samples?format=ply&attributes=cloud_index").status == 200);
}

TEST_CASE("the recipe of a preview moves the whole cloud as it moved the preview") {
  Daemon daemon;
  const std::string file = file_of(wavy_sheet(100));
  const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
  const std::string part = path_of(create(daemon, cloud, R"(,"preview":{"count":4000})"));
  ready(daemon, part);
  edit(daemon, part);
  const std::string whole = path_of(create(daemon, cloud, ""));
  ready(daemon, whole);
  const Reply applied =
      daemon.ask("POST", whole + "/recipe", R"({"recipe":)" + daemon.get(part + "/recipe").body + "}", kAny);
  REQUIRE_MESSAGE(applied.status == 200, applied.body);
  const Cloud small = samples(daemon, part, "&attributes=cloud_index");
  const Cloud large = samples(daemon, whole);
  REQUIRE(large.size() == 10000);
  const std::vector<std::uint32_t> index = indices_of(small);
  double most = 0.0;
  double moved = 0.0;
  const Cloud rest = cloud_of(file);
  for (std::size_t i = 0; i < small.size(); ++i) {
    most = std::max(most, (model_position(small, i) - model_position(large, index[i])).norm());
    moved = std::max(moved, (model_position(small, i) - model_position(rest, index[i])).norm());
  }
  CHECK(moved > 0.29);
  CHECK(most < 0.03);  // the regions' borders differ by a spacing
}

TEST_CASE("what a preview's count can be") {
  Daemon daemon;
  const std::string cloud = daemon.upload(file_of(wavy_sheet(30)), "application/x-ply").json()["id"];
  const auto refused = [&](const std::string& preview) {
    const Reply reply =
        daemon.ask("POST", "/v1/sessions", R"({"cloud":")" + cloud + R"(","preview":)" + preview + "}");
    CHECK(reply.status == 422);
    return reply.json()["errors"][0]["pointer"].get<std::string>();
  };
  for (const char* count : {"0", "-7", "1.5", "\"9\"", "4294967296"})
    CHECK(refused(std::string(R"({"count":)") + count + "}") == "/preview/count");
  CHECK(refused("{}") == "/preview/count");
  CHECK(refused("7") == "/preview");
  CHECK(refused(R"({"count":7,"method":"quadrics"})") == "/preview/method");
  for (const char* count : {"900", "901", "4294967295"}) {
    const json made = create(daemon, cloud, std::string(R"(,"preview":{"count":)") + count + "}");
    const json built = ready(daemon, path_of(made));
    CHECK_FALSE(built.contains("preview"));
    CHECK(built["sample_count"] == 900);
  }
  // One sample is a session, as a cloud of one is.
  const json one = create(daemon, cloud, R"(,"preview":{"count":1})");
  CHECK(ready(daemon, path_of(one))["sample_count"] == 1);
}

TEST_CASE("a preview counts with its own samples where memory is counted") {
  // Room for some thousands of samples, not for 40,000.
  Daemon daemon({"--max-session-bytes", "15000000", "--history-bytes", "1000000"});
  const std::string cloud = daemon.upload(file_of(wavy_sheet(200)), "application/x-ply").json()["id"];
  const std::string whole = R"({"cloud":")" + cloud + R"("})";
  const Reply refused = daemon.ask("POST", "/v1/sessions", whole);
  CHECK(refused.status == 507);
  CHECK(refused.json()["type"] == "/problems/out-of-space");
  ready(daemon, path_of(create(daemon, cloud, R"(,"preview":{"count":1000})")));
  // Choosing needs memory as well, and is refused where there is none: for a large part, not for a small one.
  CHECK(
      daemon.ask("POST", "/v1/sessions", R"({"cloud":")" + cloud + R"(","preview":{"count":5000}})").status ==
      507);
}

TEST_CASE("a deleted preview stops being built") {
  Daemon daemon;
  const std::string cloud = daemon.upload(file_of(wavy_sheet(300)), "application/x-ply").json()["id"];
  const std::string session = path_of(create(daemon, cloud, R"(,"preview":{"count":30000})"));
  CHECK(daemon.ask("DELETE", session).status == 204);
  CHECK(daemon.get(session).status == 404);
  for (int i = 0; i < 2000 && daemon.ask("DELETE", "/v1/clouds/" + cloud).status != 204; ++i) ::usleep(5000);
  CHECK(daemon.get("/v1/clouds/" + cloud).status == 404);
}
