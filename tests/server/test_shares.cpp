// Share links: how many there may be, and what of them outlives a service.

#include <doctest/doctest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "server/access/secret.h"
#include "server/access/share_store.h"
#include "server/base/random_id.h"
#include "server/store/share_archive.h"
#include "tests/server/sql.h"
#include "tests/server/temporary_folder.h"
#include "tests/server/test_service.h"

using namespace pointwright;
using namespace pointwright::test;
using protocol::ProblemKind;
using protocol::Scope;
using namespace std::chrono_literals;

namespace {

std::string id_of(const std::string& path) {
  return path.substr(path.rfind('/') + 1);
}

Answer share(TestService& service, const std::string& path, const std::string& body = R"({"scope":"view"})") {
  Answer made = service.ask(Method::kPost, path + "/shares", body);
  REQUIRE(made.status == 201);
  return made;
}

int status_of(TestService& service, const std::string& path, const std::string& capability) {
  return service.get(path, {{"authorization", "Bearer " + capability}}).status;
}

std::size_t shares_of(TestService& service, const std::string& path) {
  const json listed = service.get(path + "/shares").body;
  REQUIRE(listed.contains("shares"));
  return listed["shares"].size();
}

std::string rfc3339(std::chrono::system_clock::time_point time) {
  return protocol::to_rfc3339(time);
}

/// A keeper that refuses, as a full disk does.
class FullDisk : public ShareKeeper {
 public:
  bool is_full = false;
  Outcome<Done> keep(const Share&) override { return answer(); }
  Outcome<Done> forget(const std::string&) override { return answer(); }
  Outcome<Done> forget_owner(const std::string&) override { return answer(); }
  Outcome<Done> forget_expired() override { return answer(); }

 private:
  [[nodiscard]] Outcome<Done> answer() const {
    if (is_full) return Problem{.kind = ProblemKind::kOutOfDisk, .detail = "full"};
    return Done{};
  }
};

}  // namespace

TEST_CASE("links are bounded by session, by token and in all, and the problem names the limit") {
  ShareStore store(3, 5, nullptr);
  const protocol::ShareRequest view{.scope = Scope::kView};
  const std::string ann = random_id();
  const auto refusal = [&](const std::string& owner) {
    const auto made = store.add(random_id(), owner, view);
    REQUIRE_FALSE(made.ok());
    CHECK(made.problem().kind == ProblemKind::kTooMany);
    return made.problem();
  };
  for (int i = 0; i < 3; ++i) REQUIRE(store.add(random_id(), ann, view).ok());
  const auto of_token = refusal(ann);
  CHECK(of_token.detail.find("token_shares") != std::string::npos);
  CHECK(of_token.limit == 3.0);
  CHECK(of_token.actual == 4.0);
  // One that has expired makes room at once.
  const std::string session = random_id();
  const auto past = std::chrono::system_clock::now() - 1s;
  REQUIRE(store.add(session, "", {.scope = Scope::kView, .expires = past}).ok());
  for (int i = 0; i < 2; ++i) REQUIRE(store.add(random_id(), "", view).ok());
  const auto of_all = refusal("");
  CHECK(of_all.detail.find("max_shares") != std::string::npos);
  CHECK(of_all.limit == 5.0);
  store.forget_owner(ann);
  CHECK(store.add(random_id(), ann, view).ok());

  ShareStore roomy(1000, 1000, nullptr);
  for (std::size_t i = 0; i < ShareStore::kMaxPerSession; ++i) REQUIRE(roomy.add(session, "", view).ok());
  CHECK(roomy.add(session, "", view).problem().limit == static_cast<double>(ShareStore::kMaxPerSession));
  CHECK(roomy.add(random_id(), "", view).ok());
}

TEST_CASE("a link that cannot be kept is not made, and one that cannot be ended stays") {
  FullDisk disk;
  ShareStore store(10, 10, &disk);
  const std::string session = random_id();
  const auto made = store.add(session, "", {.scope = Scope::kView});
  REQUIRE(made.ok());
  disk.is_full = true;
  CHECK(store.add(session, "", {.scope = Scope::kView}).problem().kind == ProblemKind::kOutOfDisk);
  CHECK(store.list(session).size() == 1);
  const std::string id = made.value().share.document.id;
  CHECK(store.revoke(session, id).problem().kind == ProblemKind::kOutOfDisk);
  CHECK(store.find_secret(made.value().capability).has_value());
  disk.is_full = false;
  CHECK(store.revoke(session, id).ok());
  CHECK_FALSE(store.find_secret(made.value().capability).has_value());
  CHECK(store.revoke(session, id).problem().kind == ProblemKind::kNotFound);
}

TEST_CASE("links come back with their terms, and as digests alone; those that were revoked do not") {
  const TemporaryFolder folder;
  const Config config = lasting(folder);
  std::string path, view, edit, revoked;
  json listed;
  {
    TestService service(config);
    path = service.open_session();
    view = share(service, path).body["capability"];
    edit = share(service, path,
                 R"({"scope":"edit","expires":")" + rfc3339(std::chrono::system_clock::now() + 1h) + "\"}")
               .body["capability"];
    const Answer third = share(service, path);
    revoked = third.body["capability"];
    REQUIRE(service.ask(Method::kDelete, third.header("Location")).status == 204);
    listed = service.get(path + "/shares").body;
    REQUIRE(listed["shares"].size() == 2);
  }
  for (const auto& entry : std::filesystem::recursive_directory_iterator(config.data)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    CHECK(bytes.find(view) == std::string::npos);
    CHECK(bytes.find("pws_") == std::string::npos);
  }
  for (int round = 0; round < 2; ++round) {
    CAPTURE(round);
    TestService service(config);
    CHECK(service.notes.empty());
    CHECK(service.get(path + "/shares").body == listed);
    CHECK(status_of(service, path, view) == 200);
    CHECK(status_of(service, path, edit) == 200);
    CHECK(status_of(service, path, revoked) == 401);
    const auto paint = [&](const std::string& capability) {
      return service
          .ask(Method::kPost, path + "/regions/zero/operations", kSphere,
               {{"authorization", "Bearer " + capability}})
          .status;
    };
    CHECK(paint(view) == 403);
    CHECK(paint(edit) == 200);
  }
}

TEST_CASE("links go with their session, whether it is deleted or expires, and with their end") {
  const TemporaryFolder folder;
  const Config config = lasting(folder);
  const auto rows = [](TestService& service) {
    return service.service.database.read([](Database::Access& access) {
      Statement row = access.query("SELECT count(*) FROM shares");
      REQUIRE(row.step());
      return row.integer(0);
    });
  };
  std::string kept, capability;
  {
    TestService service(config);
    const std::string deleted = service.open_session();
    const std::string of_deleted = share(service, deleted).body["capability"];
    const std::string expired = service.open_session();
    const std::string of_expired = share(service, expired).body["capability"];
    CHECK(rows(service) == 2);
    REQUIRE(service.ask(Method::kDelete, deleted).status == 204);
    CHECK(rows(service) == 1);
    CHECK(status_of(service, deleted, of_deleted) == 401);
    CHECK(service.expire_idle(1) == 1);
    CHECK(rows(service) == 0);
    CHECK(status_of(service, expired, of_expired) == 401);
    CHECK(service.service.access.shares.list(id_of(expired)).empty());
    // A session that is gone gets none.
    const auto late = service.service.access.shares.add(id_of(deleted), "", {.scope = Scope::kView});
    REQUIRE_FALSE(late.ok());
    CHECK(late.problem().kind == ProblemKind::kNotFound);

    kept = service.open_session();
    const std::string past = rfc3339(std::chrono::system_clock::now() - 1h);
    const std::string body = R"({"scope":"view","expires":")" + past + "\"}";
    CHECK(status_of(service, kept, share(service, kept, body).body["capability"]) == 401);
    capability = share(service, kept).body["capability"];  // which sweeps the one before
    CHECK(rows(service) == 1);
    share(service, kept, body);
    CHECK(rows(service) == 2);
  }
  TestService service(config);
  CHECK(rows(service) == 1);  // the start has swept
  CHECK(shares_of(service, kept) == 1);
  CHECK(status_of(service, kept, capability) == 200);
}

TEST_CASE("a folder of the layout before keeps its sessions, which can then be shared") {
  const TemporaryFolder folder;
  const Config config = lasting(folder);
  constexpr int kBeforeShares = 3;
  std::string path;
  {
    TestService service(config);
    path = service.open_painted();
  }
  run_sql(config.data + "/pointwright.db",
          "DROP TABLE shares; DROP TABLE jobs; PRAGMA user_version=" + std::to_string(kBeforeShares));
  std::string capability;
  {
    TestService service(config);
    CHECK(service.notes.empty());
    CHECK(service.get(path).status == 200);
    CHECK(service.get(path + "/regions/zero").body["operations"].size() == 1);
    CHECK(shares_of(service, path) == 0);
    capability = share(service, path).body["capability"];
  }
  TestService service(config);
  CHECK(status_of(service, path, capability) == 200);
}

TEST_CASE("rows of links that were tampered with open nothing and harm no others") {
  const TemporaryFolder folder;
  const Config config = lasting(folder);
  std::string path, whole;
  std::vector<std::string> hostile;
  {
    TestService service(config);
    path = service.open_session();
    whole = share(service, path).body["capability"];
    // Sealed as this program seals, but nothing that it would write.
    ShareArchive archive(service.service.database);
    const auto add = [&](Share row) {
      hostile.push_back(new_secret(kSharePrefix));
      if (row.sha256.empty()) row.sha256 = digest_of(hostile.back());
      if (row.document.id.empty()) row.document.id = random_id();
      if (row.document.created == protocol::TimePoint())
        row.document.created = std::chrono::system_clock::now();
      row.session = id_of(path);
      REQUIRE(archive.keep(row).ok());
    };
    add({.document = {.terms = {.scope = Scope::kAdmin}}});
    add({.document = {.id = "../../etc/passwd"}});
    add({.document = {.created = protocol::TimePoint() - 1s}});
    add({.owner = "no id"});
    add({.sha256 = std::string(64, 'Z')});
    add({.sha256 = "abc"});
    REQUIRE(share(service, path).status == 201);
    REQUIRE(share(service, path).status == 201);
    REQUIRE(share(service, path).status == 201);
  }
  // A flipped scope, times that no clock shows, and a session that is none.
  const std::string row = "(SELECT max(place) FROM shares)";
  run_sql(config.data + "/pointwright.db",
          "UPDATE shares SET scope = 'edit' WHERE place = " + row +
              ";"
              "UPDATE shares SET expires = 9223372036854775807 WHERE place = " +
              row +
              " - 1;"
              "UPDATE shares SET session = '" +
              random_id() + "' WHERE place = " + row +
              " - 2;"
              "INSERT INTO shares (id, session, owner, scope, created, expires, sha256, seal) VALUES "
              "(x'00ff', '" +
              id_of(path) + "', x'', 'view', 'soon', 'never', zeroblob(100000), '')");
  TestService service(config);
  REQUIRE(service.notes.size() == 1);
  CHECK(service.notes[0] == "10 share links are damaged and open nothing");
  CHECK(shares_of(service, path) == 1);
  CHECK(status_of(service, path, whole) == 200);
  for (const std::string& capability : hostile) CHECK(status_of(service, path, capability) == 401);
  // They go with the session.
  CHECK(service.ask(Method::kDelete, path).status == 204);
  CHECK(status_of(service, path, whole) == 401);
}

TEST_CASE("without a data folder links end with the service") {
  std::string path, capability;
  {
    TestService service;
    path = service.open_session();
    capability = share(service, path).body["capability"];
    CHECK(status_of(service, path, capability) == 200);
    const std::string other = service.open_session();
    const std::string of_other = share(service, other).body["capability"];
    CHECK(service.expire_idle(2) == 2);
    CHECK(status_of(service, other, of_other) == 401);
  }
  TestService service;
  CHECK(service.get(path, {{"authorization", "Bearer " + capability}}).status == 401);
}
