// Imports that nobody waits for, through the real daemon: asked how far they are, ended, refused.

#include <doctest/doctest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kLater = "Prefer: wait=1, respond-async\r\n";

Reply post(Daemon& daemon, const std::string& bytes, const std::string& type = "application/octet-stream",
           const std::string& query = "?name=sheet") {
  return daemon.ask("POST", "/v1/clouds" + query, bytes, "Content-Type: " + type + "\r\n" + kLater);
}

json ended(Daemon& daemon, const std::string& import) {
  for (int i = 0; i < 6000; ++i) {
    const json document = daemon.get(import).json();
    if (document["state"] == "successful" || document["state"] == "failed") return document;
    ::usleep(5000);
  }
  FAIL("it never ends");
  return {};
}

/// A long text of samples: seconds of decoding.
std::string long_text() {
  std::string text;
  constexpr int kLines = 2'000'000;
  text.reserve(std::size_t{kLines} * 24);
  for (int i = 0; i < kLines; ++i)
    text += std::to_string(i % 1999) + ".125 " + std::to_string(i / 1999) + ".0625 0.5\n";
  return text;
}

std::size_t decoders_of(pid_t daemon) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream status(entry.path() / "status");
    std::string line;
    while (std::getline(status, line))
      if (line == "PPid:\t" + std::to_string(daemon)) ++count;
  }
  return count;
}

std::string uploaded(Daemon& daemon, const std::string& bytes) {
  const std::string tus = "Tus-Resumable: 1.0.0\r\n";
  const Reply made =
      daemon.ask("POST", "/v1/uploads", "", tus + "Upload-Length: " + std::to_string(bytes.size()) + "\r\n");
  REQUIRE(made.status == 201);
  const std::string path = made.headers.at("location");
  REQUIRE(daemon
              .ask("PATCH", path, bytes,
                   tus + "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n")
              .status == 204);
  return path;
}

}  // namespace

TEST_CASE("a cloud comes while its client goes on, and is the one that it would be otherwise") {
  Daemon daemon;
  const std::string file = file_of(wavy_sheet(50));
  const Reply begun = post(daemon, file);
  CHECK(begun.status == 202);
  CHECK(begun.headers.at("preference-applied") == "respond-async");
  const std::string import = begun.headers.at("location");
  CHECK(import == "/v1/imports/" + begun.json()["id"].get<std::string>());
  CHECK(begun.json()["name"] == "sheet");
  CHECK(begun.json()["bytes"] == file.size());
  const json end = ended(daemon, import);
  REQUIRE(end["state"] == "successful");
  CHECK(end["progress"] == json{{"phase", "ready"}, {"fraction", 1.0}});
  CHECK_FALSE(end.contains("problem"));
  const std::string cloud = end["cloud"]["id"];
  CHECK(daemon.get("/v1/clouds/" + cloud).json() == end["cloud"]);
  const Reply waited = daemon.upload(file);
  CHECK(waited.status == 201);
  CHECK(waited.json()["report"] == end["cloud"]["report"]);
  CHECK(daemon.get("/v1/clouds/" + cloud + "/data?format=ply").body ==
        daemon.get("/v1/clouds/" + waited.json()["id"].get<std::string>() + "/data?format=ply").body);
  // It is remembered until it is forgotten; its cloud stays.
  CHECK(daemon.get("/v1/imports").json()["imports"].size() == 1);
  CHECK(daemon.ask("DELETE", import).status == 204);
  CHECK(daemon.get(import).status == 404);
  CHECK(daemon.ask("DELETE", import).status == 404);
  CHECK(daemon.get("/v1/clouds/" + cloud).status == 200);
}

TEST_CASE("an upload that is imported goes; one that cannot be is kept, and the import says why") {
  Daemon daemon;
  const std::string good = uploaded(daemon, file_of(wavy_sheet(30)));
  const auto import = [&](const std::string& upload) {
    const std::string body = json{{"upload", upload.substr(upload.rfind('/') + 1)}}.dump();
    return post(daemon, body, "application/json", "");
  };
  const json end = ended(daemon, import(good).headers.at("location"));
  CHECK(end["state"] == "successful");
  CHECK(end["cloud"]["sample_count"] == 900);
  CHECK(daemon.ask("HEAD", good, "", "Tus-Resumable: 1.0.0\r\n").status == 404);

  const std::string bad = uploaded(daemon, file_of(wavy_sheet(30)).substr(0, 5000));
  const json refused = ended(daemon, import(bad).headers.at("location"));
  CHECK(refused["state"] == "failed");
  CHECK(refused["problem"]["status"] == 422);
  CHECK(refused["problem"]["type"] == "/problems/malformed-cloud");
  CHECK_FALSE(refused.contains("cloud"));
  CHECK(daemon.ask("HEAD", bad, "", "Tus-Resumable: 1.0.0\r\n").status == 200);
  // What can be told at once is told at once.
  CHECK(post(daemon, R"({"upload":"AAAAAAAAAAAAAAAAAAAAAA"})", "application/json", "").status == 422);
  CHECK(post(daemon, "x", "application/octet-stream", "?nonfinite=maybe").status == 422);
  CHECK(post(daemon, "").status == 400);
}

TEST_CASE("an import that is ended leaves no decoder, no cloud and its memory free") {
  Daemon daemon({"--max-decoders", "1", "--max-imports", "2"});
  const std::string text = long_text();
  const std::string running = post(daemon, text, "text/plain").headers.at("location");
  for (int i = 0; i < 2000 && decoders_of(daemon.pid()) == 0; ++i) ::usleep(1000);
  REQUIRE(decoders_of(daemon.pid()) == 1);
  CHECK(daemon.get(running).json()["progress"]["phase"] == "decoding");
  const Reply waiting = post(daemon, text, "text/plain");
  CHECK(daemon.get(waiting.headers.at("location")).json()["state"] == "accepted");
  const Reply full = post(daemon, "0 0 0\n1 0 0\n0 1 0\n", "text/plain");
  CHECK(full.status == 429);
  CHECK(full.json()["limit"] == 2);

  CHECK(daemon.ask("DELETE", waiting.headers.at("location")).status == 204);
  CHECK(daemon.ask("DELETE", running).status == 204);
  for (int i = 0; i < 1000 && decoders_of(daemon.pid()) > 0; ++i) ::usleep(5000);
  CHECK(decoders_of(daemon.pid()) == 0);
  CHECK(daemon.get("/v1/imports").json()["imports"].empty());
  CHECK(daemon.get("/v1/clouds").json()["clouds"].empty());
  // Another one has its turn, and the memory of the bodies is there again.
  const json next = ended(daemon, post(daemon, file_of(wavy_sheet(20))).headers.at("location"));
  CHECK(next["state"] == "successful");
  CHECK(daemon.get("/v1/clouds").json()["clouds"].size() == 1);
  CHECK(daemon.stop(SIGTERM) == 0);
}

TEST_CASE("a daemon that stops ends its imports in time") {
  Daemon daemon({"--max-decoders", "1"});
  const std::string text = long_text();
  REQUIRE(post(daemon, text, "text/plain").status == 202);
  REQUIRE(post(daemon, text, "text/plain").status == 202);
  CHECK(daemon.stop(SIGTERM, std::chrono::seconds(10)) == 0);
}

TEST_CASE("an import that a request with a key has begun is begun once; a crash leaves the key free") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  const std::string headers =
      "Content-Type: application/x-ply\r\nPrefer: respond-async\r\nIdempotency-Key: once\r\n";
  const std::string file = file_of(wavy_sheet(60));
  {
    Daemon daemon(arguments);
    const Reply first = daemon.ask("POST", "/v1/clouds", file, headers);
    REQUIRE(first.status == 202);
    const Reply same = daemon.ask("POST", "/v1/clouds", file, headers);
    CHECK(same.status == 202);
    CHECK(same.json()["id"] == first.json()["id"]);
    daemon.stop(SIGKILL);
  }
  Daemon daemon(arguments);
  const Reply again = daemon.ask("POST", "/v1/clouds", file, headers);
  REQUIRE_MESSAGE(again.status == 202, again.body);
  CHECK(ended(daemon, again.headers.at("location"))["state"] == "successful");
}

TEST_CASE("a token has its share of imports, and what ended makes room where most is held") {
  Daemon daemon({"--max-imports", "3"});
  for (int i = 0; i < 5; ++i)
    CHECK(ended(daemon, daemon
                            .ask("POST", "/v1/clouds", "no cloud",
                                 "Content-Type: application/x-ply\r\nPrefer: respond-async\r\n")
                            .headers.at("location"))["state"] == "failed");
  CHECK(daemon.get("/v1/imports").json()["imports"].size() == 3);
}
