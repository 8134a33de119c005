// The whole way through the real daemon: upload, session, painting, previews, edits, download.

#include <doctest/doctest.h>

#include <csignal>
#include <set>
#include <thread>

#include "protocol/frames/frame.h"
#include "protocol/frames/stream_record.h"
#include "server/ingest/sandbox.h"
#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/acceptance/stream_reader.h"
#include "tests/server/raw_client.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {}  // namespace

TEST_CASE(
    "a cloud is uploaded, painted, previewed, edited and downloaded, and what was not touched keeps its "
    "bits") {
  Daemon daemon;
  const Cloud original = wavy_sheet(80);
  const Reply uploaded = daemon.upload(file_of(original), "application/x-ply", "?name=wavy%20sheet");
  REQUIRE(uploaded.status == 201);
  CHECK(uploaded.json()["name"] == "wavy sheet");
  CHECK(uploaded.json()["sample_count"] == 6400);
  const std::string session = daemon.open_session(uploaded.json()["id"]);

  REQUIRE(daemon.ask("POST", session + "/regions/zero/operations", kLeft).status == 200);
  const Reply painted = daemon.ask("POST", session + "/regions/one/operations", kRight);
  REQUIRE(painted.status == 200);
  CHECK(painted.json()["changed"] == 16 * 80);

  StreamReader stream(daemon, session + "/stream?attributes=normal,t,marks");
  auto first = stream.next();
  REQUIRE(first.has_value());
  CHECK(StreamReader::event(*first)["event"] == "session");
  auto frame = stream.next_frame();
  REQUIRE(frame.has_value());
  CHECK(frame->header.kind == protocol::FrameKind::kKey);

  for (int i = 1; i <= 20; ++i)
    CHECK(daemon.ask("PUT", session + "/preview", translation(0.02 * i, ",\"sequence\":" + std::to_string(i)))
              .status == 204);
  std::uint64_t last_shown = 0;
  while (frame && frame->header.sequence != 20) {
    frame = stream.next_frame();
    if (!frame) break;
    CHECK(frame->header.sequence >= last_shown);
    last_shown = frame->header.sequence;
  }
  CHECK(last_shown == 20);

  const Reply now = daemon.get(session);
  CHECK(now.headers.at("etag") == "\"r2\"");
  const Reply edit = daemon.ask("POST", session + "/edits", translation(0.4), "If-Match: \"r2\"\r\n");
  REQUIRE(edit.status == 201);
  CHECK(edit.headers.at("etag") == "\"r3\"");
  CHECK(edit.json()["moved_samples"].get<int>() > 16 * 80);
  while (frame && !(frame->header.sequence == 0 && frame->header.revision == 3)) frame = stream.next_frame();
  CHECK(frame.has_value());

  const Reply download = daemon.get(session + "/samples?format=ply");
  REQUIRE(download.status == 200);
  const Cloud before = in_caller_order(original);
  const Cloud after = cloud_of(download.body);
  REQUIRE(after.size() == before.size());
  CHECK(after.color == before.color);
  std::size_t kept = 0;
  std::size_t lifted = 0;
  for (std::size_t i = 0; i < after.size(); ++i) {
    const Vec3d a = model_position(before, i);
    const Vec3d b = model_position(after, i);
    if (a.x() <= 0.2) {
      CHECK(a == b);
      ++kept;
    } else if (a.x() >= 0.8) {
      CHECK(b.z() - a.z() == doctest::Approx(0.4).epsilon(0.01));
      ++lifted;
    }
  }
  CHECK(kept == 16 * 80);
  CHECK(lifted == 16 * 80);

  // Undo brings the upload's own bytes back, redo the edit's.
  CHECK(daemon.ask("PUT", session + "/head", R"({"edit":0})").status == 200);
  const Cloud undone = cloud_of(daemon.get(session + "/samples?format=ply").body);
  CHECK(undone.position == before.position);
  CHECK(daemon.ask("PUT", session + "/head", R"({"edit":1})").status == 200);
  CHECK(daemon.get(session + "/samples?format=ply").body == download.body);

  CHECK(daemon.ask("DELETE", session).status == 204);
  std::optional<protocol::StreamRecord> record;
  std::optional<protocol::StreamRecord> last;
  while ((record = stream.next())) last = record;
  REQUIRE(last.has_value());
  CHECK(StreamReader::event(*last)["event"] == "end");
  CHECK(daemon.get(session).status == 404);
  CHECK(daemon.stop(SIGTERM) == 0);
}

TEST_CASE("a frame rendered for a tool shows what the same edit would give") {
  Daemon daemon;
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(40))).json()["id"]);
  REQUIRE(daemon.ask("PUT", session + "/regions/zero", R"({"operations":[)" + kLeft + "]}").status == 200);
  REQUIRE(daemon.ask("PUT", session + "/regions/one", R"({"operations":[)" + kRight + "]}").status == 200);
  const Reply reply =
      daemon.ask("POST", session + "/preview?attributes=normal,ids", translation(0.3, ",\"sequence\":1"));
  REQUIRE(reply.status == 200);
  CHECK(reply.headers.at("content-type") == "application/vnd.pointwright.frame");
  const auto frame = protocol::decode_frame(std::as_bytes(std::span(reply.body.data(), reply.body.size())));
  REQUIRE(frame.ok());
  std::size_t lifted = 0;
  for (const auto& block : frame.value().blocks)
    for (const Vec3d& p : protocol::decode_positions(frame.value().header, block))
      if (p.z() > 0.25) ++lifted;
  CHECK(lifted > 8 * 40 - 20);
  CHECK(daemon.get(session).json()["history"]["edits"] == 0);
}

TEST_CASE("every kind of deformation goes in over HTTP and comes back in the history") {
  Daemon daemon;
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(40))).json()["id"]);
  REQUIRE(daemon.ask("PUT", session + "/regions/zero", R"({"operations":[)" + kLeft + "]}").status == 200);
  REQUIRE(daemon.ask("PUT", session + "/regions/one", R"({"operations":[)" + kRight + "]}").status == 200);
  const std::vector<std::string> deformations = {
      R"({"type":"along_normal","distance":0.1})",
      R"({"type":"toward_point","target":[0.5,0.5,1.0],"amount":0.25})",
      R"({"type":"scale","center":[0.5,0.5,0.0],"factors":[1.0,1.0,2.0]})",
      R"({"type":"twist","axis":{"point":[0.0,0.5,0.0],"direction":[1.0,0.0,0.0]},"angle_deg":90.0,"length":1.0})",
      R"({"type":"sequence","steps":[{"type":"translation","vector":[0.0,0.0,0.1]},{"type":"rotation","axis":{"point":[0.5,0.5,0.0],"direction":[0.0,1.0,0.0]},"angle_deg":10.0}]})"};
  for (const std::string& deformation : deformations) {
    CAPTURE(deformation);
    const json edit = {
        {"level", 0}, {"blend", "quintic"}, {"deformation", json::parse(deformation)}, {"gains", {0.5}}};
    const Reply current = daemon.get(session);
    const Reply reply = daemon.ask("POST", session + "/edits", edit.dump(),
                                   "If-Match: " + current.headers.at("etag") + "\r\n");
    REQUIRE(reply.status == 201);
    CHECK(reply.json()["edit"]["deformation"] == json::parse(deformation));
    CHECK(reply.json()["edit"]["gains"] == json({0.5}));
    CHECK(reply.json()["moved_samples"] > 300);
  }
  const Reply current = daemon.get(session);
  const Reply wrong =
      daemon.ask("POST", session + "/edits",
                 R"({"level":0,"deformation":{"type":"along_normal","distance":1},"gains":[1,1]})",
                 "If-Match: " + current.headers.at("etag") + "\r\n");
  CHECK(wrong.status == 422);
  CHECK(wrong.json()["errors"][0]["pointer"] == "/gains");
}

TEST_CASE("edits without painting, on unknown sessions or with wrong values are refused with problems") {
  Daemon daemon;
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(20))).json()["id"]);
  const auto problem = [](const Reply& reply) {
    return reply.json().value("type", "") + " " + std::to_string(reply.status);
  };
  CHECK(problem(daemon.ask("POST", session + "/edits", translation(1), "If-Match: \"r0\"\r\n")) ==
        "/problems/empty-region 422");
  CHECK(problem(daemon.ask("POST", session + "/edits", translation(1))) == "/problems/revision-required 428");
  CHECK(problem(daemon.ask("POST", session + "/edits", "{", "If-Match: \"r0\"\r\n")) ==
        "/problems/malformed-json 400");
  CHECK(problem(daemon.ask("POST", session + "/edits",
                           R"({"level":7,"deformation":{"type":"translation","vector":[0,0,1]}})",
                           "If-Match: \"r0\"\r\n")) == "/problems/invalid-value 422");
  CHECK(problem(daemon.get("/v1/sessions/AAAAAAAAAAAAAAAAAAAAAA")) == "/problems/not-found 404");
  CHECK(problem(daemon.ask("POST", "/v1/sessions", R"({"cloud":"AAAAAAAAAAAAAAAAAAAAAA"})")) ==
        "/problems/not-found 404");
  CHECK(problem(daemon.ask("POST", session + "/edits", translation(1),
                           "If-Match: \"r0\"\r\nOrigin: http://evil.example\r\n")) ==
        "/problems/origin-not-allowed 403");
  CHECK(daemon.get(session).headers.at("etag") == "\"r0\"");
}

TEST_CASE(
    "two clouds of the same bytes edited the same way give the same bytes, with one thread and with all") {
  const std::string upload = file_of(wavy_sheet(60));
  std::set<std::string> results;
  for (const char* threads : {"1", "0", "0"}) {
    Daemon daemon({"--threads", threads});
    const std::string session = daemon.open_session(daemon.upload(upload).json()["id"]);
    daemon.ask("POST", session + "/regions/zero/operations", kLeft);
    daemon.ask("POST", session + "/regions/one/operations", kRight);
    const std::string rotation =
        R"({"level":0,"deformation":{"type":"rotation","axis":{"point":[0.5,0.5,0],"direction":[0,1,0]},"angle_deg":35}})";
    REQUIRE(daemon.ask("POST", session + "/edits", rotation, "If-Match: \"r2\"\r\n").status == 201);
    REQUIRE(daemon.ask("POST", session + "/edits", translation(0.2), "If-Match: \"r3\"\r\n").status == 201);
    results.insert(daemon.get(session + "/samples?format=ply").body);
  }
  CHECK(results.size() == 1);
}

TEST_CASE("every change can be made to depend on the revision that it was made for") {
  Daemon daemon;
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(30))).json()["id"]);
  const std::string stale = "If-Match: \"r7\"\r\n";
  const std::string any = "If-Match: *\r\n";
  const std::string zero = session + "/regions/zero";
  const std::string preview = translation(0.1, R"(,"sequence":1)");
  REQUIRE(daemon.ask("POST", session + "/regions/one/operations", kRight).status == 200);
  struct Change {
    std::string method, target, body;
    int status;
  };
  for (const Change& change :
       {Change{"POST", zero + "/operations", kLeft, 200}, Change{"PUT", session + "/preview", preview, 204},
        Change{"POST", session + "/edits", translation(0.1), 201},
        Change{"PUT", session + "/head", R"({"edit":0})", 200},
        Change{"PUT", zero, R"({"operations":[]})", 200}, Change{"DELETE", zero, "", 200},
        Change{"DELETE", session, "", 204}}) {
    const std::string now = daemon.get(session).headers.at("etag");
    const Reply refused = daemon.ask(change.method, change.target, change.body, stale);
    CHECK_MESSAGE(refused.status == 412, change.method, " ", change.target);
    CHECK(refused.json().value("type", "") == "/problems/stale-revision");
    CHECK(daemon.ask(change.method, change.target, change.body, "If-Match: W/\"r1\"\r\n").status == 400);
    CHECK(daemon.get(session).headers.at("etag") == now);
    const std::string matching = change.method == "PUT" ? any : "If-Match: " + now + "\r\n";
    CHECK_MESSAGE(daemon.ask(change.method, change.target, change.body, matching).status == change.status,
                  change.method, " ", change.target);
  }
  CHECK(daemon.get(session).status == 404);
}

TEST_CASE("a painting holds as many vertices as the limit says") {
  Daemon daemon({"--max-painting-vertices", "5"});
  CHECK(daemon.get("/v1/info").json()["limits"]["max_painting_vertices"] == 5);
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(20))).json()["id"]);
  const std::string stroke =
      R"({"mode":"add","shape":{"type":"stroke","vertices":[[0,0,0],[0,1,0],[1,1,0]],"radius":0.05}})";
  const std::string zero = session + "/regions/zero";
  CHECK(daemon.ask("POST", zero + "/operations", stroke).status == 200);
  const Reply refused = daemon.ask("POST", zero + "/operations", stroke);
  CHECK(refused.status == 413);
  CHECK(refused.json()["limit"] == 5);
  CHECK(refused.json()["actual"] == 6);
  CHECK(daemon.ask("PUT", zero, R"({"operations":[)" + stroke + "]}").status == 200);
  CHECK(daemon.ask("PUT", zero, R"({"operations":[)" + stroke + "," + stroke + "]}").status == 413);
  CHECK(daemon.get(zero).json()["operations"].size() == 1);
}

TEST_CASE("what was deleted is given back to the system") {
  Daemon daemon;
  const std::size_t before = daemon.resident_kilobytes();
  const std::string file = file_of(wavy_sheet(300));
  for (int round = 0; round < 2; ++round) {
    const Reply cloud = daemon.upload(file);
    const std::string session = daemon.open_session(cloud.json()["id"]);
    REQUIRE(daemon.ask("POST", session + "/regions/zero/operations", kLeft).status == 200);
    REQUIRE(daemon.ask("POST", session + "/regions/one/operations", kRight).status == 200);
    REQUIRE(daemon.ask("POST", session + "/edits", translation(0.1), "If-Match: *\r\n").status == 201);
    CHECK(daemon.get(session + "/samples").status == 200);
    CHECK(daemon.ask("DELETE", session).status == 204);
    CHECK(daemon.ask("DELETE", cloud.headers.at("location")).status == 204);
  }
  if (kSanitizedBuild) return;  // sanitizers keep what is freed, to see who still reads it
  for (int i = 0; i < 300 && daemon.resident_kilobytes() > before + 32 * 1024; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  CHECK(daemon.resident_kilobytes() < before + 32 * 1024);
}

TEST_CASE("clients that are cut off in mid-stream leave nothing behind") {
  Daemon daemon;
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(40))).json()["id"]);
  const std::size_t before = daemon.descriptors();
  for (int round = 0; round < 5; ++round) {
    std::vector<std::unique_ptr<StreamReader>> readers;
    for (int i = 0; i < 12; ++i) {
      readers.push_back(std::make_unique<StreamReader>(daemon, session + "/stream"));
      CHECK(readers.back()->next().has_value());
    }
    for (auto& reader : readers) reader->close();
  }
  for (int i = 0; i < 500 && daemon.descriptors() > before; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  CHECK(daemon.descriptors() <= before);
  CHECK(daemon.get("/healthz").status == 200);
}

TEST_CASE("a stop ends open streams with a marked record and exits well") {
  Daemon daemon;
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(20))).json()["id"]);
  std::vector<std::unique_ptr<StreamReader>> readers;
  for (int i = 0; i < 8; ++i) {
    readers.push_back(std::make_unique<StreamReader>(daemon, session + "/stream"));
    REQUIRE(readers.back()->next_frame().has_value());
  }
  const auto begin = std::chrono::steady_clock::now();
  CHECK(daemon.stop(SIGTERM) == 0);
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(10));
  for (auto& reader : readers) {
    std::optional<protocol::StreamRecord> last;
    while (auto record = reader->next()) last = record;
    REQUIRE(last.has_value());
    CHECK(StreamReader::event(*last) == json{{"event", "end"}, {"reason", "the server is stopping"}});
  }
  CHECK(daemon.log().find("\"event\":\"stopped\"") != std::string::npos);
}

TEST_CASE("a stop while a session builds cancels the building") {
  Daemon daemon;
  const Reply cloud = daemon.upload(file_of(wavy_sheet(400)));
  REQUIRE(cloud.status == 201);
  REQUIRE(
      daemon.ask("POST", "/v1/sessions", R"({"cloud":")" + cloud.json()["id"].get<std::string>() + R"("})")
          .status == 202);
  const auto begin = std::chrono::steady_clock::now();
  CHECK(daemon.stop(SIGINT) == 0);
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(10));
}
