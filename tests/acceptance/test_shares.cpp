// Share links over restarts: what was acknowledged of them holds after kill -9.

#include <doctest/doctest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

std::string bearer(const std::string& secret) {
  return "Authorization: Bearer " + secret + "\r\n";
}

/// A folder that outlives its daemons, with a token for who edits and one for the admin.
struct Office {
  TemporaryFolder folder;
  std::string tokens = folder / "tokens.json";
  std::vector<std::string> arguments = {"--data", folder / "data", "--tokens", tokens};
  std::string bob = add("Bob", "edit");
  std::string root = add("Root", "admin");

  std::string add(const std::string& name, const std::string& scope) const {
    const Ended ended = run({POINTWRIGHTD_PATH, "token", "add", name, "--scope", scope, "--tokens", tokens});
    REQUIRE_MESSAGE(ended.status == 0, ended.err);
    return ended.out.substr(0, ended.out.find('\n'));
  }
  /// The path of a session of Bob's.
  [[nodiscard]] std::string open(Daemon& daemon) const {
    const Reply cloud = daemon.ask("POST", "/v1/clouds?name=sheet", file_of(wavy_sheet(20)),
                                   bearer(bob) + "Content-Type: application/x-ply\r\n");
    REQUIRE_MESSAGE(cloud.status == 201, cloud.body);
    const std::string id = cloud.json()["id"];
    const Reply made = daemon.ask("POST", "/v1/sessions", R"({"cloud":")" + id + R"(","scales":[0.05]})",
                                  bearer(bob) + "Content-Type: application/json\r\n");
    REQUIRE_MESSAGE(made.status == 202, made.body);
    return made.headers.at("location");
  }
  [[nodiscard]] Reply share(Daemon& daemon, const std::string& session,
                            const std::string& body = R"({"scope":"view"})",
                            const std::string& more = "") const {
    Reply made = daemon.ask("POST", session + "/shares", body, bearer(bob) + more);
    REQUIRE_MESSAGE(made.status == 201, made.body);
    return made;
  }
  [[nodiscard]] std::size_t links_of(Daemon& daemon, const std::string& session) const {
    const Reply listed = daemon.get(session + "/shares", bearer(bob));
    REQUIRE_MESSAGE(listed.status == 200, listed.body);
    return listed.json()["shares"].size();
  }
  /// Whether these bytes are in any of the folder's files.
  [[nodiscard]] bool holds(const std::string& text) const {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / "data")) {
      if (!entry.is_regular_file()) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(file), {}};
      if (bytes.find(text) != std::string::npos) return true;
    }
    return false;
  }
};

std::string capability_of(const Reply& made) {
  return made.json()["capability"];
}

int status_of(Daemon& daemon, const std::string& session, const std::string& capability) {
  return daemon.get(session, bearer(capability)).status;
}

}  // namespace

TEST_CASE(
    "a link opens its session after kill -9, one that was revoked does not, and no secret is on the disk") {
  const Office office;
  std::string session, other, kept, editor, revoked;
  {
    Daemon daemon(office.arguments);
    session = office.open(daemon);
    other = office.open(daemon);
    // The key does not make the answer be kept: it would hold the secret.
    const std::string key = "Idempotency-Key: once\r\n";
    const Reply first = office.share(daemon, session, R"({"scope":"view"})", key);
    CHECK(capability_of(office.share(daemon, session, R"({"scope":"view"})", key)) != capability_of(first));
    revoked = capability_of(first);
    REQUIRE(daemon.ask("DELETE", first.headers.at("location"), "", bearer(office.bob)).status == 204);
    editor = capability_of(office.share(daemon, session, R"({"scope":"edit"})"));
    kept = capability_of(office.share(daemon, session));
    daemon.stop(SIGKILL);
  }
  CHECK_FALSE(office.holds("pws_"));
  CHECK_FALSE(office.holds(kept.substr(4)));
  for (int round = 0; round < 2; ++round) {
    CAPTURE(round);
    Daemon daemon(office.arguments);
    CHECK(office.links_of(daemon, session) == 3);
    CHECK(status_of(daemon, session, kept) == 200);
    CHECK(daemon.get(session + "/samples?format=ply", bearer(kept)).status == 200);
    CHECK(status_of(daemon, other, kept) == 404);
    CHECK(status_of(daemon, session, revoked) == 401);
    const std::string paint = session + "/regions/zero/operations";
    CHECK(daemon.ask("POST", paint, kLeft, bearer(kept)).status == 403);
    CHECK(daemon.ask("POST", paint, kLeft, bearer(editor)).status == 200);
    daemon.stop(SIGKILL);
  }
}

TEST_CASE("links that ended with their session, their time or their token have ended after kill -9 as well") {
  const Office office;
  std::string deleted, session, of_deleted, brief, of_token;
  {
    Daemon daemon(office.arguments);
    deleted = office.open(daemon);
    session = office.open(daemon);
    of_deleted = capability_of(office.share(daemon, deleted));
    of_token = capability_of(office.share(daemon, session));
    brief =
        capability_of(office.share(daemon, session, R"({"scope":"view","expires":"2020-01-01T00:00:00Z"})"));
    REQUIRE(status_of(daemon, deleted, of_deleted) == 200);
    REQUIRE(daemon.ask("DELETE", deleted, "", bearer(office.bob) + "If-Match: *\r\n").status == 204);
    daemon.stop(SIGKILL);
  }
  {
    Daemon daemon(office.arguments);
    CHECK(status_of(daemon, deleted, of_deleted) == 401);
    CHECK(status_of(daemon, session, brief) == 401);
    CHECK(office.links_of(daemon, session) == 1);
    CHECK(status_of(daemon, session, of_token) == 200);
    const std::string id = daemon.get("/v1/info", bearer(office.bob)).json()["caller"]["token"];
    REQUIRE(daemon.ask("DELETE", "/v1/tokens/" + id, "", bearer(office.root)).status == 204);
    CHECK(status_of(daemon, session, of_token) == 401);
    daemon.stop(SIGKILL);
  }
  Daemon daemon(office.arguments);
  CHECK(status_of(daemon, session, of_token) == 401);
  CHECK(daemon.get(session + "/shares", bearer(office.root)).json()["shares"].empty());
}

TEST_CASE("links are bounded, and the answer names the limit") {
  Office office;
  office.arguments.insert(office.arguments.end(), {"--token-shares", "2"});
  Daemon daemon(office.arguments);
  const std::string session = office.open(daemon);
  for (int i = 0; i < 2; ++i) CHECK_FALSE(capability_of(office.share(daemon, session)).empty());
  const Reply third = daemon.ask("POST", session + "/shares", R"({"scope":"view"})", bearer(office.bob));
  CHECK(third.status == 429);
  CHECK(third.json()["limit"] == 2);
  CHECK(third.json()["detail"].get<std::string>().find("token_shares") != std::string::npos);
}
