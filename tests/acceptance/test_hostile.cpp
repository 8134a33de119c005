// What strangers send: every answer is a problem document, and the daemon lives.

#include <doctest/doctest.h>

#include <random>
#include <thread>

#include "engine/io/cloud_io.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/raw_client.h"
#include "tests/server/synthetic.h"

using namespace pointwright;
using namespace pointwright::test;

namespace {

std::string file_of(const Cloud& cloud, CloudFormat format) {
  const auto file = write_cloud(cloud, format, {});
  REQUIRE(file.ok());
  return {reinterpret_cast<const char*>(file.value().data()), file.value().size()};
}

std::string ply_header(const std::string& count) {
  return "ply\nformat binary_little_endian 1.0\nelement vertex " + count +
         "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
}

void check_refused(Daemon& daemon, const std::string& bytes, const std::string& type, const char* what) {
  const auto begin = std::chrono::steady_clock::now();
  Reply reply = daemon.upload(bytes, type);
  CHECK_MESSAGE(reply.status >= 400, what);
  CHECK_MESSAGE(reply.status < 500, what);
  CHECK_MESSAGE(reply.headers["content-type"] == "application/problem+json", what);
  CHECK_MESSAGE(reply.json().value("detail", "") != "", what);
  CHECK_MESSAGE(std::chrono::steady_clock::now() - begin < std::chrono::seconds(5), what);
  CHECK_MESSAGE(daemon.is_alive(), what);
}

/// The head of an upload that announces `bytes`, for those who send less or slower.
std::string upload_head(std::size_t bytes) {
  return "POST /v1/clouds HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
         "application/x-ply\r\nContent-Length: " +
         std::to_string(bytes) + "\r\n\r\n";
}

}  // namespace

TEST_CASE("bad uploads each get a problem, nothing is stored and a good one works right after") {
  Daemon daemon;
  const std::string ply = file_of(wavy_sheet(30), CloudFormat::kPly);
  const std::string drc = file_of(wavy_sheet(30), CloudFormat::kDraco);
  const std::size_t memory = daemon.resident_kilobytes();
  const std::string any = "application/octet-stream";
  check_refused(daemon, "", any, "empty");
  check_refused(daemon, std::string(1, '\0'), any, "one NUL");
  check_refused(daemon, "GIF89a and so on", any, "an image");
  check_refused(daemon, "hello", "text/plain", "prose");
  check_refused(daemon, "{}", "application/json", "a document");
  check_refused(daemon, ply.substr(0, ply.size() - 1), any, "PLY without its last byte");
  check_refused(daemon, ply.substr(0, 100), any, "PLY cut in its header");
  check_refused(daemon, drc.substr(0, drc.size() / 2), any, "half a Draco file");
  check_refused(daemon, drc.substr(0, 12), any, "the head of a Draco file");
  check_refused(daemon, ply, "model/x-draco", "PLY said to be Draco");
  check_refused(daemon, ply_header("1000000000"), any, "a billion points without a byte");
  check_refused(daemon, ply_header("99999999999999999999"), any, "a count beyond 64 bits");
  check_refused(daemon, ply_header("-1"), any, "a negative count");
  check_refused(daemon, ply_header("0"), any, "no points");
  check_refused(daemon, ply_header("1") + std::string("\x00\x00\xc0\x7f\x00\x00\x00\x00\x00\x00\x00\x00", 12),
                any, "NaN");
  check_refused(daemon, "1e38 0 0\n-1e38 0 0\n", "text/plain", "a span beyond all range");
  check_refused(daemon, "0 0 0\n1 1\n", "text/plain", "a short line");
  CHECK(daemon.get("/v1/clouds").json()["clouds"].empty());
  CHECK(daemon.resident_kilobytes() < memory + 64 * 1024);
  CHECK(daemon.upload(ply).status == 201);
  CHECK(daemon.upload(drc).status == 201);
}

TEST_CASE("degenerate clouds are edited or refused, never crashed on") {
  Daemon daemon;
  std::string line;
  std::string same;
  for (int i = 0; i < 200; ++i) {
    line += std::to_string(i) + " 0 0\n";
    same += "1 2 3\n";
  }
  int edits = 0;
  for (const std::string& cloud : {std::string("0 0 0\n"), std::string("0 0 0\n1 0 0\n"), line, same}) {
    const Reply uploaded = daemon.upload(cloud, "text/plain");
    CHECK(uploaded.status < 500);
    if (uploaded.status != 201) continue;
    const Reply made = daemon.ask("POST", "/v1/sessions",
                                  R"({"cloud":")" + uploaded.json()["id"].get<std::string>() + R"("})");
    CHECK(made.status < 500);
    if (made.status != 202) continue;
    const std::string path = made.headers.at("location");
    std::string state = "building";
    for (int i = 0; i < 3000 && state == "building"; ++i) {
      state = daemon.get(path).json().value("state", "");
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    CHECK(state != "building");
    if (state == "ready") {
      // The zero-region about the first sample, the one-region everything else.
      const std::string ball = R"({"shape":{"type":"sphere","center":[0,0,0],"radius":0.5},"mode":)";
      daemon.ask("POST", path + "/regions/zero/operations", ball + R"("add"})");
      daemon.ask("POST", path + "/regions/one/operations", R"({"mode":"add","shape":{"type":"all"}})");
      daemon.ask("POST", path + "/regions/one/operations", ball + R"("remove"})");
      Reply edit = daemon.ask("POST", path + "/edits",
                              R"({"level":0,"deformation":{"type":"translation","vector":[0,0,1]}})",
                              "If-Match: *\r\n");
      if (edit.status != 201) {
        CHECK(edit.status >= 400);
        CHECK(edit.status < 500);
        CHECK(edit.headers["content-type"] == "application/problem+json");
        CHECK(edit.json().value("type", "").rfind("/problems/", 0) == 0);
      }
      edits += edit.status == 201 ? 1 : 0;
    }
    CHECK(daemon.get(path + "/samples?format=xyz").body.find("nan") == std::string::npos);
    CHECK(daemon.is_alive());
  }
  CHECK(edits > 0);
}

TEST_CASE("mutated files are accepted whole or refused, and the daemon lives") {
  Daemon daemon;
  const std::vector<std::string> seeds = {file_of(wavy_sheet(8), CloudFormat::kPly),
                                          file_of(wavy_sheet(8), CloudFormat::kDraco)};
  std::mt19937 random(20260101);
  for (int round = 0; round < 60; ++round) {
    std::string bytes = seeds[random() % seeds.size()];
    for (unsigned i = 0; i <= random() % 6; ++i) bytes[random() % bytes.size()] = static_cast<char>(random());
    if (random() % 4 == 0) bytes.resize(random() % bytes.size());
    const Reply reply = daemon.upload(bytes);
    CHECK(reply.status != 0);
    CHECK(reply.status < 500);
    if (reply.status == 201) {
      const auto document = reply.json();
      for (const auto& coordinate : document["bounds"]["min"]) CHECK(coordinate.is_number());
      CHECK(daemon.ask("DELETE", "/v1/clouds/" + document["id"].get<std::string>()).status == 204);
    }
  }
  CHECK(daemon.is_alive());
  CHECK(daemon.get("/v1/clouds").json()["clouds"].empty());
}

TEST_CASE("uploads that are cut off leave neither clouds nor descriptors") {
  Daemon daemon;
  const std::string ply = file_of(wavy_sheet(60), CloudFormat::kPly);
  const std::size_t before = daemon.descriptors();
  std::mt19937 random(7);
  for (int i = 0; i < 50; ++i) {
    RawClient client(daemon.port());
    client.send(
        "POST /v1/clouds HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/x-ply\r\nContent-Length: " +
        std::to_string(ply.size()) + "\r\n\r\n" + ply.substr(0, random() % ply.size()));
  }
  for (int i = 0; i < 500 && daemon.descriptors() > before; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  CHECK(daemon.descriptors() <= before);
  CHECK(daemon.get("/v1/clouds").json()["clouds"].empty());
}

TEST_CASE("slow, idle and unread connections do not keep an honest client waiting") {
  Daemon daemon;
  const std::string session =
      daemon.open_session(daemon.upload(file_of(wavy_sheet(60), CloudFormat::kPly)).json()["id"]);
  std::vector<std::unique_ptr<RawClient>> others;
  for (int i = 0; i < 100; ++i) {
    others.push_back(std::make_unique<RawClient>(daemon.port()));
    others.back()->send("GET / HTTP/1.1\r\nHost: l");
  }
  for (int i = 0; i < 100; ++i) others.push_back(std::make_unique<RawClient>(daemon.port()));
  for (int i = 0; i < 40; ++i) {
    others.push_back(std::make_unique<RawClient>(daemon.port()));
    others.back()->send("GET " + session + "/stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  for (int i = 0; i < 20; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    CHECK(daemon.get("/healthz").status == 200);
    CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(2));
  }
}

TEST_CASE("uploads that are announced and never sent take no room from others and end soon") {
  Daemon daemon({"--body-grace-ms", "2000", "--least-body-rate", "1000000"});
  const std::string session =
      daemon.open_session(daemon.upload(file_of(wavy_sheet(20), CloudFormat::kPly)).json()["id"]);
  const std::string head = upload_head(1073741824);
  RawClient silent(daemon.port());
  RawClient stalled(daemon.port());
  const auto begin = std::chrono::steady_clock::now();
  silent.send(head);
  // What was sent fast does not pay for a pause later.
  stalled.send(head + std::string(20'000'000, '0'));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  CHECK(daemon.ask("POST", session + "/regions/one/operations", R"({"mode":"add","shape":{"type":"all"}})")
            .status == 200);
  CHECK(daemon.upload(file_of(wavy_sheet(20), CloudFormat::kPly)).status == 201);
  CHECK(parse_reply(silent.receive_all()).status == 408);
  CHECK(parse_reply(stalled.receive_all()).status == 408);
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(10));
}

TEST_CASE("uploads that fill the memory for uploads leave documents theirs") {
  Daemon daemon({"--max-upload-memory", "1000000"});
  const std::string session =
      daemon.open_session(daemon.upload(file_of(wavy_sheet(20), CloudFormat::kPly)).json()["id"]);
  const std::string head = upload_head(1000000);
  RawClient first(daemon.port());
  first.send(head + std::string(999'999, '0'));
  // Not before all of it is held: two that ask for the rest at once are both refused.
  const auto held = [&] {
    const std::string text = daemon.get("/metrics").body;
    const std::string name = "pointwright_budget_held{budget=\"uploads\"} ";
    const std::size_t at = text.find(name);
    return at == std::string::npos ? 0.0 : std::stod(text.substr(at + name.size()));
  };
  for (int i = 0; i < 500 && held() < 999'999.0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const Reply refused = daemon.upload(std::string(900'000, '0'), "text/plain");
  CHECK(refused.status == 503);
  CHECK(refused.headers.count("retry-after") == 1);
  CHECK(daemon.ask("POST", session + "/regions/one/operations", R"({"mode":"add","shape":{"type":"all"}})")
            .status == 200);
}

TEST_CASE("foreign hosts and origins are refused on every kind of request") {
  Daemon daemon;
  const Reply cloud = daemon.upload("0 0 0\n1 0 0\n0 1 0\n", "text/plain");
  REQUIRE(cloud.status == 201);
  for (const char* host : {"evil.example", "evil.example:80", "192.168.0.1", "localhost.evil.example"})
    for (const char* target : {"/", "/healthz", "/v1/clouds", "/assets/x.js"})
      CHECK(parse_reply(exchange(daemon.port(),
                                 "GET " + std::string(target) + " HTTP/1.1\r\nHost: " + host + "\r\n\r\n"))
                .status == 403);
  const std::string path = "/v1/clouds/" + cloud.json()["id"].get<std::string>();
  for (const char* origin : {"http://evil.example", "null", "http://localhost:1"})
    CHECK(daemon.ask("DELETE", path, "", "Origin: " + std::string(origin) + "\r\n").status == 403);
  CHECK(daemon.get(path).status == 200);
}

TEST_CASE("a body beyond the configured limit is refused unread") {
  Daemon daemon({"--max-upload-bytes", "1000"});
  const Reply refused = daemon.upload(std::string(1001, '0'), "text/plain");
  CHECK(refused.status == 413);
  CHECK(refused.json()["limit"] == 1000);
  RawClient client(daemon.port());
  client.send(
      "POST /v1/clouds HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/x-ply\r\nContent-Length: "
      "4000000000\r\n\r\n");
  CHECK(parse_reply(client.receive_all()).status == 413);
  CHECK(daemon.get("/v1/info").json()["limits"]["max_upload_bytes"] == 1000);
}
