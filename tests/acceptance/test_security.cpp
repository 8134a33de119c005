// Who may do what, from outside: every row of the route table without a token, with a wrong one, with a
// weaker one and with another owner's ids; pages of other origins; links; quotas.

#include <doctest/doctest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include "engine/io/cloud_io.h"
#include "server/routes/routes.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/raw_client.h"
#include "tests/server/synthetic.h"
#include "tests/support/png_file.h"

using namespace pointwright;
using namespace pointwright::test;
using server::BodyPolicy;
using server::Permission;
using server::Route;

namespace {

std::string line_of(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

std::string sheet() {
  const auto file = write_cloud(wavy_sheet(20), CloudFormat::kPly, {});
  REQUIRE(file.ok());
  return {reinterpret_cast<const char*>(file.value().data()), file.value().size()};
}

/// A file of tokens that the program made.
struct TokenFile {
  TemporaryFolder folder;
  std::string path = folder / "tokens.json";
  std::string add(const std::string& name, const std::string& scope, std::vector<std::string> more = {}) {
    std::vector<std::string> command = {POINTWRIGHTD_PATH, "token", "add",      name,
                                        "--scope",         scope,   "--tokens", path};
    command.insert(command.end(), more.begin(), more.end());
    const Ended ended = run(command);
    REQUIRE_MESSAGE(ended.status == 0, ended.err);
    return line_of(ended.out);
  }
};

/// A daemon with tokens: ann and bob edit, vera looks on, root is the admin.
struct Guarded : TokenFile {
  std::string ann = add("Ann", "edit");
  std::string bob = add("Bob", "edit");
  std::string vera = add("Vera", "view");
  std::string root = add("Root", "admin");
  Daemon daemon;

  explicit Guarded(std::vector<std::string> more = {}) : daemon(arguments(std::move(more))) {}
  std::vector<std::string> arguments(std::vector<std::string> more) const {
    more.insert(more.end(), {"--tokens", path});
    return more;
  }

  Reply ask(const std::string& token, const std::string& method, const std::string& target,
            const std::string& body = "", std::string headers = "") {
    if (!token.empty()) headers += "Authorization: Bearer " + token + "\r\n";
    return daemon.ask(method, target, body, headers);
  }
  Reply get(const std::string& token, const std::string& target) { return ask(token, "GET", target); }

  std::string upload(const std::string& token) {
    const Reply made =
        ask(token, "POST", "/v1/clouds?name=sheet", sheet(), "Content-Type: application/x-ply\r\n");
    REQUIRE_MESSAGE(made.status == 201, made.body);
    return made.json()["id"];
  }
  std::string open(const std::string& token, const std::string& cloud) {
    const Reply made = ask(token, "POST", "/v1/sessions", R"({"cloud":")" + cloud + R"(","scales":[0.05]})");
    REQUIRE_MESSAGE(made.status == 202, made.body);
    std::string id = made.json()["id"];
    for (int i = 0; i < 6000 && get(token, "/v1/sessions/" + id).json()["state"] == "building"; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    REQUIRE(get(token, "/v1/sessions/" + id).json()["state"] == "ready");
    return id;
  }
};

/// What one owner has, to try every row on.
struct Belongings {
  std::string cloud, image, session, share, capability, upload, import, job;
  Belongings(Guarded& guarded, const std::string& token) {
    cloud = guarded.upload(token);
    const Reply made = guarded.ask(token, "POST", "/v1/images",
                                   grey_png(2, 2, [](std::uint32_t, std::uint32_t) { return 9; }),
                                   "Content-Type: image/png\r\n");
    REQUIRE_MESSAGE(made.status == 201, made.body);
    image = made.json()["id"];
    session = guarded.open(token, cloud);
    const Reply begun =
        guarded.ask(token, "POST", "/v1/uploads", "", "Tus-Resumable: 1.0.0\r\nUpload-Length: 10\r\n");
    REQUIRE_MESSAGE(begun.status == 201, begun.body);
    upload = begun.headers.at("location").substr(std::string("/v1/uploads/").size());
    // One that fails: it is there, and adds no cloud.
    const Reply later = guarded.ask(token, "POST", "/v1/clouds", "no cloud",
                                    "Content-Type: application/x-ply\r\nPrefer: respond-async\r\n");
    REQUIRE_MESSAGE(later.status == 202, later.body);
    import = later.json()["id"];
    const Reply submitted =
        guarded.ask(token, "POST", "/v1/jobs", R"({"session":")" + session + R"(","mode":"memory"})");
    REQUIRE_MESSAGE(submitted.status == 202, submitted.body);
    job = submitted.json()["jobID"];
    const Reply shared =
        guarded.ask(token, "POST", "/v1/sessions/" + session + "/shares", R"({"scope":"view"})");
    REQUIRE_MESSAGE(shared.status == 201, shared.body);
    share = shared.json()["id"];
    capability = shared.json()["capability"];
  }
  /// The row's path with these ids in it.
  [[nodiscard]] std::string path_of(const Route& route) const {
    std::string path(route.pattern);
    const auto put = [&](const std::string& placeholder, const std::string& text, std::size_t from = 0) {
      const std::size_t at = path.find(placeholder, from);
      if (at != std::string::npos) path.replace(at, placeholder.size(), text);
    };
    put("/clouds/{id}", "/clouds/" + cloud);
    put("/images/{id}", "/images/" + image);
    put("/imports/{id}", "/imports/" + import);
    put("/jobs/{id}", "/jobs/" + job);
    put("/sessions/{id}", "/sessions/" + session);
    put("/shares/{id}", "/shares/" + share);
    put("/tokens/{id}", "/tokens/" + session);  // no token has that id
    put("/uploads/{id}", "/uploads/" + upload);
    put("{edit}", "1");
    put("{region}", "zero");
    put("{file}", "result.ply");
    put("{slug}", "not-found");
    REQUIRE(path.find('{') == std::string::npos);
    return path;
  }
};

bool belongs_to_one(const Route& route) {
  for (const char* prefix : {"/v1/clouds/{id}", "/v1/images/{id}", "/v1/imports/{id}", "/v1/jobs/{id}",
                             "/v1/sessions/{id}", "/v1/uploads/{id}"})
    if (route.pattern.rfind(prefix, 0) == 0) return true;
  return false;
}

std::string method_of(const Route& route) {
  return std::string(server::method_name(route.method));
}

std::string type_of(const Route& route) {
  if (route.body == BodyPolicy::Kind::kCloud) return "Content-Type: application/x-ply\r\n";
  if (route.body == BodyPolicy::Kind::kImage) return "Content-Type: image/png\r\n";
  return {};
}

bool takes_body(const Route& route) {
  return route.body != BodyPolicy::Kind::kNone;
}

}  // namespace

TEST_CASE("without a token, or with a wrong one, only the open rows answer") {
  Guarded guarded;
  const Belongings bobs(guarded, guarded.bob);
  int wrong = 0;
  for (const Route& route : server::all_routes()) {
    const std::string path = bobs.path_of(route);
    CAPTURE(path);
    const std::string body = takes_body(route) ? "{}" : "";
    const Reply bare = guarded.ask("", method_of(route), path, body, type_of(route));
    if (route.permission == Permission::kOpen) {
      CHECK(bare.status == 200);
      continue;
    }
    CHECK(bare.status == 401);
    CHECK(bare.headers.at("www-authenticate").rfind("Bearer", 0) == 0);
    const Reply refused =
        guarded.ask("pw_" + std::string(43, 'A'), method_of(route), path, body, type_of(route));
    // After some from one address they are not even looked at.
    CHECK(refused.status == (wrong++ < 20 ? 401 : 429));
  }
  REQUIRE(wrong > 20);
  CHECK(guarded.get(guarded.bob, "/v1/sessions/" + bobs.session).status == 200);
  CHECK(guarded.get(guarded.bob + "x", "/v1/info").status == 429);
  for (const std::string& header :
       {std::string("Authorization: Basic YTpi\r\n"), std::string("Authorization: Bearer\r\n"),
        "Authorization: Bearer " + guarded.bob + "\r\nAuthorization: Bearer " + guarded.ann + "\r\n"})
    CHECK(guarded.daemon.get("/v1/info", header).status == 401);
  CHECK(guarded.daemon.get("/v1/info?token=" + guarded.bob).status == 401);
}

TEST_CASE("what belongs to another does not exist, on every row and in every list") {
  Guarded guarded;
  const Belongings bobs(guarded, guarded.bob);
  const std::string before = guarded.get(guarded.bob, "/v1/sessions/" + bobs.session).body;
  for (const Route& route : server::all_routes()) {
    if (!belongs_to_one(route)) continue;
    const std::string path = bobs.path_of(route);
    CAPTURE(path);
    const std::string body = takes_body(route) ? "{}" : "";
    for (const std::string& token : {guarded.ann, guarded.vera})
      CHECK(guarded.ask(token, method_of(route), path, body, type_of(route)).status == 404);
  }
  for (const char* list : {"clouds", "images", "imports", "sessions", "uploads"}) {
    CHECK(guarded.get(guarded.ann, std::string("/v1/") + list).json()[list].empty());
    CHECK(guarded.get(guarded.bob, std::string("/v1/") + list).json()[list].size() == 1);
    CHECK(guarded.get(guarded.root, std::string("/v1/") + list).json()[list].size() == 1);
  }
  // Foreign clouds and images cannot be used either, and read as unknown ones do.
  const std::string unknown(22, 'A');
  const auto refused = [&](const std::string& token, const std::string& cloud) {
    auto reply = guarded.ask(token, "POST", "/v1/sessions", R"({"cloud":")" + cloud + "\"}").json();
    reply.erase("request_id");
    return reply;
  };
  CHECK(refused(guarded.ann, bobs.cloud)["status"] == 404);
  CHECK(refused(guarded.ann, bobs.cloud) == refused(guarded.ann, unknown));
  const std::string cloud = guarded.upload(guarded.ann);
  const std::string session = guarded.open(guarded.ann, cloud);
  const std::string shape =
      R"({"mode":"add","shape":{"type":"model","matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],)"
      R"("thickness":0.1,"cloud":")" +
      bobs.cloud + "\"}}";
  const Reply painted =
      guarded.ask(guarded.ann, "POST", "/v1/sessions/" + session + "/regions/zero/operations", shape);
  CHECK(painted.status == 422);
  CHECK(painted.body.find("there is no such cloud") != std::string::npos);
  CHECK(guarded.get(guarded.bob, "/v1/sessions/" + bobs.session).body == before);
  CHECK(guarded.get(guarded.root, "/v1/sessions/" + bobs.session).body == before);
}

TEST_CASE("a scope permits what it says") {
  TemporaryFolder folder;
  std::ofstream(folder / "sheet.ply", std::ios::binary) << sheet();
  Guarded guarded({"--sample", folder / "sheet.ply"});
  const std::string cloud = guarded.get(guarded.vera, "/v1/clouds").json()["clouds"][0]["id"];
  CHECK(guarded.ask(guarded.vera, "POST", "/v1/sessions", R"({"cloud":")" + cloud + "\"}").status == 403);
  CHECK(guarded.ask(guarded.vera, "POST", "/v1/clouds", sheet(), "Content-Type: application/x-ply\r\n")
            .status == 403);
  // What the operator loaded belongs to all: used by everybody, deleted by the admin.
  CHECK(guarded.ask(guarded.ann, "DELETE", "/v1/clouds/" + cloud).status == 403);
  const std::string session = guarded.open(guarded.ann, cloud);
  CHECK(guarded.ask(guarded.ann, "DELETE", "/v1/sessions/" + session).status == 204);
  CHECK(guarded.ask(guarded.root, "DELETE", "/v1/clouds/" + cloud).status == 204);
  for (const std::string& token : {guarded.ann, guarded.vera}) {
    CHECK(guarded.get(token, "/v1/tokens").status == 403);
    CHECK(guarded.ask(token, "POST", "/v1/tokens", R"({"name":"x","scope":"admin"})").status == 403);
  }
  const auto caller = guarded.get(guarded.vera, "/v1/info").json()["caller"];
  CHECK(caller["scope"] == "view");
  CHECK(caller["name"] == "Vera");
}

TEST_CASE("pages of other origins change nothing, on any row") {
  Guarded guarded;
  const Belongings bobs(guarded, guarded.bob);
  const std::string before = guarded.get(guarded.bob, "/v1/sessions/" + bobs.session).body;
  const std::string bearer = "Authorization: Bearer " + guarded.root + "\r\n";
  for (const Route& route : server::all_routes()) {
    if (!server::changes_state(route.method)) continue;
    const std::string path = bobs.path_of(route);
    CAPTURE(path);
    const std::string body = takes_body(route) ? "{}" : "";
    for (const char* origin : {"null", "https://evil.example", "http://localhost.evil.example"})
      CHECK(guarded.daemon
                .ask(method_of(route), path, body, bearer + type_of(route) + "Origin: " + origin + "\r\n")
                .status == 403);
    for (const char* type :
         {"application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "text/html"}) {
      const Reply form =
          guarded.daemon.ask(method_of(route), path, "a=1", bearer + "Content-Type: " + type + "\r\n");
      const bool speaks_tus = path.rfind("/v1/uploads", 0) == 0;  // no form does
      CHECK((form.status == 415 || form.status == 413 || (speaks_tus && form.status == 412)));
    }
  }
  for (const char* host :
       {"evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "169.254.169.254"}) {
    std::string request = "GET /v1/info HTTP/1.1\r\nHost: ";
    request.append(host).append("\r\n").append(bearer).append("\r\n");
    CHECK(status_of(exchange(guarded.daemon.port(), request)) == 403);
  }
  CHECK(guarded.get(guarded.bob, "/v1/sessions/" + bobs.session).body == before);
}

TEST_CASE("origins that the operator lists may ask and read, and no others") {
  Guarded guarded({"--cors-origins", "https://App.example:443", "--cors-origins", "http://localhost:5173"});
  const std::string asking = "Access-Control-Request-Method: PUT\r\n";
  const Reply allowed =
      guarded.daemon.ask("OPTIONS", "/v1/sessions", "", "Origin: https://app.example\r\n" + asking);
  CHECK(allowed.status == 204);
  CHECK(allowed.headers.at("access-control-allow-origin") == "https://app.example");
  CHECK(allowed.headers.at("access-control-allow-methods").find("PATCH") != std::string::npos);
  CHECK(allowed.headers.at("access-control-allow-headers").find("Authorization") != std::string::npos);
  CHECK(allowed.headers.at("vary").find("Origin") != std::string::npos);
  CHECK(allowed.headers.count("access-control-allow-credentials") == 0);
  for (const char* origin :
       {"https://app.example.evil", "http://app.example", "null", "https://app.example:444"}) {
    const Reply refused =
        guarded.daemon.ask("OPTIONS", "/v1/sessions", "", std::string("Origin: ") + origin + "\r\n" + asking);
    CHECK(refused.headers.count("access-control-allow-origin") == 0);
    CHECK(refused.headers.count("access-control-allow-methods") == 0);
  }
  const Reply read = guarded.ask(guarded.ann, "GET", "/v1/info", "", "Origin: http://localhost:5173\r\n");
  CHECK(read.headers.at("access-control-allow-origin") == "http://localhost:5173");
  for (const char* name :
       {"ETag", "Location", "Upload-Offset", "Tus-Resumable", "Retry-After", "Server-Timing"})
    CHECK(read.headers.at("access-control-expose-headers").find(name) != std::string::npos);
  // Problems can be read too, and changes be made.
  const Reply missing = guarded.daemon.ask("DELETE", "/v1/sessions/" + std::string(22, 'A'), "",
                                           "Origin: https://app.example\r\n");
  CHECK(missing.status == 401);
  CHECK(missing.headers.at("access-control-allow-origin") == "https://app.example");
}

TEST_CASE("a link opens one session, as far as it says, until it is revoked") {
  Guarded guarded;
  const Belongings bobs(guarded, guarded.bob);
  const std::string other = guarded.open(guarded.bob, bobs.cloud);
  const std::string path = "/v1/sessions/" + bobs.session;
  const std::string& link = bobs.capability;
  CHECK(guarded.get(link, path).status == 200);
  CHECK(guarded.get(link, path + "/samples?format=ply").status == 200);
  CHECK(guarded.get(link, "/v1/sessions/" + other).status == 404);
  CHECK(guarded.get(link, "/v1/clouds/" + bobs.cloud).status == 404);
  CHECK(guarded.get(link, "/v1/sessions").json()["sessions"].size() == 1);
  CHECK(guarded.get(link, "/v1/info").json()["caller"]["session"] == bobs.session);
  const std::string ball = R"({"mode":"add","shape":{"type":"sphere","center":[0,0.5,0],"radius":0.3}})";
  CHECK(guarded.ask(link, "POST", path + "/regions/zero/operations", ball).status == 403);
  for (const char* target : {"/metrics", "/v1/tokens"}) CHECK(guarded.get(link, target).status == 403);
  CHECK(guarded.get(link, path + "/shares").status == 403);
  CHECK(guarded.ask(link, "DELETE", path).status == 403);

  const Reply edit = guarded.ask(guarded.bob, "POST", path + "/shares", R"({"scope":"edit"})");
  const std::string editor = edit.json()["capability"];
  CHECK(guarded.ask(editor, "POST", path + "/regions/zero/operations", ball).status == 200);
  CHECK(guarded.ask(editor, "POST", path + "/shares", R"({"scope":"edit"})").status == 403);
  CHECK(guarded.ask(editor, "POST", "/v1/sessions", R"({"cloud":")" + bobs.cloud + "\"}").status == 403);
  CHECK(guarded.get(guarded.bob, path + "/shares").json()["shares"].size() == 2);
  CHECK(guarded.get(guarded.bob, path + "/shares").body.find("pws_") == std::string::npos);

  CHECK(guarded.ask(guarded.bob, "DELETE", path + "/shares/" + bobs.share).status == 204);
  CHECK(guarded.get(link, path).status == 401);
  const Reply past = guarded.ask(guarded.bob, "POST", path + "/shares",
                                 R"({"scope":"view","expires":"2020-01-01T00:00:00Z"})");
  CHECK(guarded.get(past.json().value("capability", ""), path).status == 401);
  // With the token goes what came from it.
  const std::string id = guarded.get(guarded.bob, "/v1/info").json()["caller"]["token"];
  CHECK(guarded.ask(guarded.root, "DELETE", "/v1/tokens/" + id).status == 204);
  CHECK(guarded.get(guarded.bob, path).status == 401);
  CHECK(guarded.get(editor, path).status == 401);
}

TEST_CASE("tokens come and go while the daemon runs") {
  Guarded guarded;
  const Reply made = guarded.ask(guarded.root, "POST", "/v1/tokens",
                                 R"({"name":"Eve","scope":"view","quotas":{"sessions":0}})");
  REQUIRE_MESSAGE(made.status == 201, made.body);
  const std::string eve = made.json()["secret"];
  CHECK(guarded.get(eve, "/v1/info").json()["caller"]["quotas"]["sessions"]["limit"] == 0);
  CHECK(guarded.get(guarded.root, "/v1/tokens").body.find(eve) == std::string::npos);
  CHECK(guarded.get(guarded.root, "/v1/tokens").json()["tokens"].size() == 5);
  // By hand, and read again when told to.
  const std::string max = guarded.add("Max", "view");
  CHECK(guarded.get(max, "/v1/info").status == 401);
  ::kill(guarded.daemon.pid(), SIGHUP);
  int status = 0;
  for (int i = 0; i < 500 && status != 200; ++i) {
    status = guarded.get(max, "/v1/info").status;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(status == 200);
  CHECK(guarded.get(eve, "/v1/info").status == 200);
  const std::string log = guarded.daemon.log();
  for (const std::string& secret : {guarded.ann, guarded.root, eve, max})
    CHECK(log.find(secret) == std::string::npos);
  std::ifstream file(guarded.path);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  CHECK(text.find(eve) == std::string::npos);
  CHECK(text.find("\"Eve\"") != std::string::npos);
  namespace fs = std::filesystem;
  CHECK((fs::status(guarded.path).permissions() & (fs::perms::group_all | fs::perms::others_all)) ==
        fs::perms::none);
}

TEST_CASE("quotas bound one token, with the limit in the answer, and nobody else") {
  Guarded guarded;
  const std::string small = guarded.add(
      "Small", "edit", {"--sessions", "1", "--stored-bytes", std::to_string(sheet().size() + 10)});
  const std::string few = guarded.add("Few", "edit", {"--clouds", "1", "--images", "0"});
  const std::string slow = guarded.add("Slow", "view", {"--requests-per-second", "1"});
  const std::string daily = guarded.add("Daily", "edit", {"--upload-bytes-per-day", "100"});
  ::kill(guarded.daemon.pid(), SIGHUP);
  for (int i = 0; i < 500 && guarded.get(daily, "/v1/info").status != 200; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));

  const std::string cloud = guarded.upload(small);
  const Reply second =
      guarded.ask(small, "POST", "/v1/clouds", sheet(), "Content-Type: application/x-ply\r\n");
  CHECK(second.status == 429);
  CHECK(second.json()["limit"] == sheet().size() + 10);
  // Time does not lift it.
  CHECK(second.headers.count("retry-after") == 0);
  const std::string session = guarded.open(small, cloud);
  const Reply more = guarded.ask(small, "POST", "/v1/sessions", R"({"cloud":")" + cloud + "\"}");
  CHECK(more.status == 429);
  CHECK(more.json()["limit"] == 1);
  CHECK(more.json()["actual"] == 2);
  const auto quotas = guarded.get(small, "/v1/info").json()["caller"]["quotas"];
  CHECK(quotas["sessions"]["used"] == 1);
  CHECK(quotas["samples"]["used"] == 400);
  CHECK(quotas["stored_bytes"]["used"] == sheet().size());
  // However small they are, their number is bounded, too.
  const std::string only = guarded.upload(few);
  const Reply other = guarded.ask(few, "POST", "/v1/clouds", sheet(), "Content-Type: application/x-ply\r\n");
  CHECK(other.status == 429);
  CHECK(other.json()["detail"].get<std::string>().find("quota clouds") != std::string::npos);
  CHECK(guarded
            .ask(few, "POST", "/v1/images", grey_png(1, 1, [](auto, auto) { return 0; }),
                 "Content-Type: image/png\r\n")
            .json()["detail"]
            .get<std::string>()
            .find("quota images") != std::string::npos);
  CHECK(guarded.get(few, "/v1/info").json()["caller"]["quotas"]["clouds"]["used"] == 1);
  CHECK(guarded.ask(few, "DELETE", "/v1/clouds/" + only).status == 204);
  guarded.upload(few);
  // What is deleted counts no more.
  CHECK(guarded.ask(small, "DELETE", "/v1/sessions/" + session).status == 204);
  CHECK(guarded.get(small, "/v1/info").json()["caller"]["quotas"]["sessions"]["used"] == 0);
  guarded.open(small, cloud);

  const Reply upload =
      guarded.ask(daily, "POST", "/v1/clouds", sheet(), "Content-Type: application/x-ply\r\n");
  CHECK(upload.status == 429);
  CHECK(upload.json()["limit"] == 100);
  int refused = 0;
  for (int i = 0; i < 20; ++i) {
    const Reply reply = guarded.get(slow, "/v1/info");
    refused += reply.status == 429 ? 1 : 0;
    CHECK(reply.headers.count("retry-after") == (reply.status == 429 ? 1U : 0U));
  }
  CHECK(refused > 0);
  CHECK(guarded.get(guarded.ann, "/v1/info").status == 200);
}

TEST_CASE("what a token holds counts after a restart, and full quotas refuse no repeated request") {
  const TemporaryFolder folder;
  const std::vector<std::string> kept = {"--data", folder / "data"};
  Guarded guarded(kept);
  const std::string one = guarded.add("One", "edit", {"--clouds", "1", "--images", "1"});
  ::kill(guarded.daemon.pid(), SIGHUP);
  for (int i = 0; i < 500 && guarded.get(one, "/v1/info").status != 200; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const std::string page = grey_png(2, 2, [](auto, auto) { return 9; });
  const std::string bearer = "Authorization: Bearer " + one + "\r\n";
  const auto cloud = [&](Daemon& daemon, const std::string& key) {
    return daemon.ask("POST", "/v1/clouds", sheet(),
                      bearer + "Content-Type: application/x-ply\r\nIdempotency-Key: " + key + "\r\n");
  };
  const auto image = [&](Daemon& daemon, const std::string& key) {
    return daemon.ask("POST", "/v1/images", page,
                      bearer + "Content-Type: image/png\r\nIdempotency-Key: " + key + "\r\n");
  };
  const auto later = [&](Daemon& daemon, const std::string& key) {
    return daemon.ask(
        "POST", "/v1/clouds", sheet(),
        bearer + "Content-Type: application/x-ply\r\nPrefer: respond-async\r\nIdempotency-Key: " + key +
            "\r\n");
  };
  const auto used = [&](Daemon& daemon, const char* quota) {
    return daemon.get("/v1/info", bearer).json()["caller"]["quotas"][quota]["used"].get<std::size_t>();
  };
  // One that is made later, and is gone again, has its answer as well, while it is known.
  const Reply begun = later(guarded.daemon, "l");
  REQUIRE(begun.status == 202);
  const std::string import = begun.headers.at("location");
  const auto state = [&] { return guarded.daemon.get(import, bearer).json()["state"].get<std::string>(); };
  for (int i = 0; i < 500 && state() != "successful"; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  REQUIRE(used(guarded.daemon, "clouds") == 1);
  CHECK(later(guarded.daemon, "l2").status == 429);
  const Reply repeated = later(guarded.daemon, "l");
  CHECK(repeated.status == 202);
  CHECK(repeated.headers.at("location") == import);
  const auto stored = guarded.daemon.get(import, bearer).json();
  REQUIRE(stored["state"] == "successful");
  const std::string made = "/v1/clouds/" + stored["cloud"]["id"].get<std::string>();
  REQUIRE(guarded.daemon.ask("DELETE", made, "", bearer).status == 204);

  const Reply first_cloud = cloud(guarded.daemon, "c");
  const Reply first_image = image(guarded.daemon, "i");
  REQUIRE(first_cloud.status == 201);
  REQUIRE(first_image.status == 201);
  const auto check = [&](Daemon& daemon) {
    CHECK(used(daemon, "clouds") == 1);
    CHECK(used(daemon, "images") == 1);
    CHECK(used(daemon, "stored_bytes") == sheet().size() + page.size());
    const std::size_t before = used(daemon, "upload_bytes_per_day");
    CHECK(cloud(daemon, "c2").status == 429);
    CHECK(image(daemon, "i2").status == 429);
    // Refused by their heads: their bytes do not count.
    CHECK(used(daemon, "upload_bytes_per_day") == before);
    const Reply same_cloud = cloud(daemon, "c");
    const Reply same_image = image(daemon, "i");
    CHECK(same_cloud.status == 201);
    CHECK(same_cloud.body == first_cloud.body);
    CHECK(same_image.status == 201);
    CHECK(same_image.body == first_image.body);
    CHECK(same_image.headers.at("etag") == first_image.headers.at("etag"));
    CHECK(same_image.headers.at("idempotency-replayed") == "true");
    CHECK(daemon.get("/v1/images", bearer).json()["images"].size() == 1);
  };
  check(guarded.daemon);
  CHECK(guarded.daemon.stop(SIGTERM) == 0);
  Daemon again(guarded.arguments(kept));
  check(again);
}

TEST_CASE("tokens are bounded, and so is each one's part of the resumable uploads") {
  Guarded guarded({"--max-tokens", "5", "--token-uploads", "2", "--token-upload-file-bytes", "1000"});
  const auto add = [&] {
    return guarded.ask(guarded.root, "POST", "/v1/tokens", R"({"name":"E","scope":"view"})");
  };
  const Reply fifth = add();
  CHECK(fifth.status == 201);
  const Reply sixth = add();
  CHECK(sixth.status == 429);
  CHECK(sixth.json()["limit"] == 5);
  CHECK(sixth.json()["detail"].get<std::string>().find("max_tokens") != std::string::npos);
  CHECK(guarded.get(guarded.ann, "/v1/info").json()["limits"]["max_tokens"] == 5);
  CHECK(guarded.ask(guarded.root, "DELETE", fifth.headers.at("location")).status == 204);
  CHECK(add().status == 201);

  const auto begin = [&](const std::string& token, int bytes) {
    return guarded.ask(token, "POST", "/v1/uploads", "",
                       "Tus-Resumable: 1.0.0\r\nUpload-Length: " + std::to_string(bytes) + "\r\n");
  };
  CHECK(begin(guarded.ann, 1001).status == 429);
  const Reply first = begin(guarded.ann, 600);
  CHECK(first.status == 201);
  const Reply large = begin(guarded.ann, 401);
  CHECK(large.status == 429);
  CHECK(large.json()["limit"] == 1000);
  CHECK(large.json()["actual"] == 1001);
  CHECK(begin(guarded.ann, 1).status == 201);
  const Reply third = begin(guarded.ann, 1);
  CHECK(third.status == 429);
  CHECK(third.json()["limit"] == 2);
  CHECK(third.json()["detail"].get<std::string>().find("token_uploads") != std::string::npos);
  CHECK(begin(guarded.bob, 600).status == 201);
  CHECK(guarded.ask(guarded.ann, "DELETE", first.headers.at("location"), "", "Tus-Resumable: 1.0.0\r\n")
            .status == 204);
  CHECK(begin(guarded.ann, 999).status == 201);
}

TEST_CASE("a body that is refused by its head does not count for the day") {
  Guarded guarded;
  const std::string daily =
      guarded.add("Daily", "edit", {"--upload-bytes-per-day", std::to_string(sheet().size() + 100)});
  ::kill(guarded.daemon.pid(), SIGHUP);
  for (int i = 0; i < 500 && guarded.get(daily, "/v1/info").status != 200; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const auto used = [&] {
    return guarded.get(daily, "/v1/info")
        .json()["caller"]["quotas"]["upload_bytes_per_day"]["used"]
        .get<int>();
  };
  CHECK(guarded.ask(daily, "POST", "/v1/clouds", sheet(), "Content-Type: text/html\r\n").status == 415);
  CHECK(used() == 0);
  CHECK(guarded.ask(daily, "POST", "/v1/clouds", sheet(), "Content-Type: application/x-ply\r\n").status ==
        201);
  CHECK(used() > 1000);
  CHECK(guarded.ask(daily, "POST", "/v1/clouds", sheet(), "Content-Type: application/x-ply\r\n").status ==
        429);
}

TEST_CASE("a file of tokens that others may read, and an open address, are refused") {
  TokenFile tokens;
  tokens.add("Ann", "edit");
  CHECK(run({POINTWRIGHTD_PATH, "token", "add", "x", "--scope", "root", "--tokens", tokens.path}).status ==
        2);
  CHECK(run({POINTWRIGHTD_PATH, "token", "revoke", std::string(22, 'A'), "--tokens", tokens.path}).status ==
        1);
  CHECK(run({POINTWRIGHTD_PATH, "token", "list"}).status == 2);
  const Ended listed = run({POINTWRIGHTD_PATH, "token", "list", "--tokens", tokens.path});
  CHECK(listed.status == 0);
  CHECK(listed.out.find("\"Ann\"") != std::string::npos);
  CHECK(run({POINTWRIGHTD_PATH, "--host", "0.0.0.0", "--port", "0"}).status == 2);
  CHECK(run({POINTWRIGHTD_PATH, "--host", "0.0.0.0", "--port", "0", "--tokens", tokens.path}).status == 2);
  std::filesystem::permissions(tokens.path, std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  const Ended open = run({POINTWRIGHTD_PATH, "--port", "0", "--tokens", tokens.path});
  CHECK(open.status == 1);
  CHECK(open.err.find("0600") != std::string::npos);
}

TEST_CASE("a stream ends soon after its link or its token was revoked") {
  Guarded guarded({"--heartbeat-ms", "200"});
  const Belongings bobs(guarded, guarded.bob);
  const std::string session = "/v1/sessions/" + bobs.session;
  const auto watch = [&](const std::string& secret) {
    auto client = std::make_unique<RawClient>(guarded.daemon.port());
    client->send("GET " + session + "/events HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + secret +
                 "\r\n\r\n");
    return client;
  };
  const auto sees = [](RawClient& client, std::string& text, const std::string& wanted) {
    while (text.find(wanted) == std::string::npos)
      if (!client.receive_some(text, std::chrono::seconds(20))) return false;
    return true;
  };
  const auto guest = watch(bobs.capability);
  const auto owner = watch(guarded.bob);
  std::string heard, own;
  REQUIRE(sees(*guest, heard, ": alive"));
  REQUIRE(guarded.ask(guarded.bob, "DELETE", session + "/shares/" + bobs.share).status == 204);
  CHECK(sees(*guest, heard, "has expired or was revoked"));
  // The owner's goes on.
  own.clear();
  REQUIRE(guarded.ask(guarded.bob, "PATCH", session, R"({"name":"still here"})").status == 200);
  CHECK(sees(*owner, own, "still here"));
}
