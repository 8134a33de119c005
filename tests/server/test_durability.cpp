// What outlives a service: clouds, sessions, their paintings and edits, and answers to keys.

#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>

#include "tests/server/temporary_folder.h"
#include "tests/server/test_service.h"

using namespace pointwright;
using namespace pointwright::test;

namespace {

std::string edit(double z, const std::string& more = "") {
  return R"({"level":0,"deformation":{"type":"translation","vector":[0,0,)" + std::to_string(z) + "]}" +
         more + "}";
}

const std::string kResampled = R"(,"resampling":{"bound":1.5,"collect":0.5})";

Answer commit(TestService& service, const std::string& path, const std::string& body) {
  const Answer answer = service.ask(Method::kPost, path + "/edits", body, if_match("*"));
  REQUIRE(answer.status == 201);
  return answer;
}

std::string samples(TestService& service, const std::string& path) {
  const Answer answer = service.get(path + "/samples?format=ply");
  REQUIRE(answer.status == 200);
  REQUIRE(answer.bytes.size() > 1000);
  return answer.bytes;
}

/// A session whose history has all that there is to bring back: edits with and without resampling, a painting
/// between them, one that was replaced and one that is undone.
std::string open_eventful(TestService& service) {
  const std::string path = service.open_painted();
  commit(service, path, edit(0.3));
  commit(service, path, edit(0.2, kResampled));
  commit(service, path, edit(-0.1));
  REQUIRE(service.ask(Method::kPut, path + "/head", R"({"edit":2})").status == 200);
  REQUIRE(service
              .ask(Method::kPost, path + "/regions/zero/operations",
                   R"({"mode":"add","steal":true,"shape":{"type":"sphere","center":[0,0,0],"radius":0.2}})")
              .status == 200);
  commit(service, path, edit(0.05, kResampled));
  commit(service, path, edit(0.07));
  REQUIRE(service.ask(Method::kPut, path + "/head", R"({"edit":3})").status == 200);
  return path;
}

json sessions_of(TestService& service) {
  json sessions = service.get("/v1/sessions").body["sessions"];
  REQUIRE_FALSE(sessions.empty());
  return sessions;
}

json without_timings(json document) {
  document.erase("timings_ms");
  return document;
}

std::string only_file_in(const std::string& folder) {
  REQUIRE(std::distance(std::filesystem::directory_iterator(folder), {}) == 1);
  return std::filesystem::directory_iterator(folder)->path().string();
}

}  // namespace

TEST_CASE("a session comes back to the bit: revision, paintings, edits, the undone ones, samples and ids") {
  const TemporaryFolder folder;
  std::string path;
  json document, edits, zero, one, redone_edits;
  std::string committed, redone;
  {
    TestService service(lasting(folder));
    path = open_eventful(service);
    document = without_timings(service.get(path).body);
    edits = service.get(path + "/edits").body;
    zero = service.get(path + "/regions/zero").body;
    one = service.get(path + "/regions/one").body;
    committed = samples(service, path);
    REQUIRE(edits["edits"].size() == 4);
    REQUIRE(edits["edits"][1]["inserted"] > 0);
    REQUIRE(edits["edits"][1]["removed"] > 0);
  }
  for (int round = 0; round < 2; ++round) {
    TestService service(lasting(folder));
    CHECK(service.notes.empty());
    const json listed = service.get("/v1/sessions").body["sessions"];
    REQUIRE(listed.size() == 1);
    CHECK(listed[0]["state"] == "asleep");
    CHECK(listed[0]["revision"] == document["revision"]);
    CHECK(listed[0]["sample_count"] == document["sample_count"]);
    CHECK(listed[0]["created"] == document["created"]);
    CHECK(without_timings(service.get(path).body) == document);
    CHECK(service.get("/v1/sessions").body["sessions"][0]["state"] == "ready");
    CHECK(service.get(path + "/edits").body == edits);
    CHECK(service.get(path + "/regions/zero").body == zero);
    CHECK(service.get(path + "/regions/one").body == one);
    CHECK(samples(service, path) == committed);
    if (round == 1) continue;
    // What was undone can be redone, and going on leads where it always would.
    const Answer redo = service.ask(Method::kPut, path + "/head", R"({"edit":4})");
    CHECK(redo.status == 200);
    CHECK(service.get(path + "/edits").body["edits"] == edits["edits"]);
    REQUIRE(service.ask(Method::kPut, path + "/head", R"({"edit":3})").status == 200);
    CHECK(samples(service, path) == committed);
    document["revision"] = document["revision"].get<int>() + 2;
  }
}

TEST_CASE("clouds and images last with their files; what was deleted, and what nobody refers to, is gone") {
  const TemporaryFolder folder;
  const Config config = lasting(folder);
  std::string cloud, other;
  json document;
  std::string file;
  {
    TestService service(config);
    cloud = service.upload();
    other = service.upload(20);
    document = service.get("/v1/clouds/" + cloud).body;
    file = service.get("/v1/clouds/" + cloud + "/data?format=ply").bytes;
    REQUIRE(service.ask(Method::kDelete, "/v1/clouds/" + other).status == 204);
    only_file_in(config.data + "/blobs");
    std::ofstream(config.data + "/blobs/" + std::string(64, 'a')) << "an orphan";
    std::ofstream(config.data + "/blobs/" + std::string(64, 'b') + ".new-1-0") << "half a file";
  }
  TestService service(config);
  only_file_in(config.data + "/blobs");
  CHECK(service.get("/v1/clouds/" + cloud).body == document);
  CHECK(service.get("/v1/clouds/" + cloud + "/data?format=ply").bytes == file);
  CHECK(service.get("/v1/clouds/" + other).status == 404);
  CHECK(service.get("/v1/clouds").body["clouds"].size() == 1);
}

TEST_CASE("a cloud that a sleeping session uses stays; a session that is deleted asleep is gone for good") {
  const TemporaryFolder folder;
  std::string path, cloud;
  {
    TestService service(lasting(folder));
    path = service.open_painted();
    cloud = service.get(path).body["cloud"];
  }
  {
    TestService service(lasting(folder));
    CHECK(service.ask(Method::kDelete, "/v1/clouds/" + cloud).status == 409);
    CHECK(service.ask(Method::kDelete, path, "", if_match("\"r7\"")).status == 412);
    CHECK(service.ask(Method::kDelete, path, "", if_match("\"r2\"")).status == 204);
    CHECK(service.ask(Method::kDelete, "/v1/clouds/" + cloud).status == 204);
  }
  TestService service(lasting(folder));
  CHECK(service.get(path).status == 404);
  CHECK(service.get("/v1/sessions").body["sessions"].empty());
}

TEST_CASE(
    "a session on a part of its cloud lets the rest of it go, and takes it again where it is asked for") {
  const TemporaryFolder folder;
  std::string path;
  std::string bytes;
  const auto ready = [&](TestService& service) {
    for (int i = 0; i < 5000 && service.get(path).body["state"] != "ready"; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    REQUIRE(service.get(path).body["state"] == "ready");
  };
  {
    TestService service(lasting(folder));
    const std::string cloud = service.upload(60);
    CHECK(service.service.clouds.memory().held() > 0);
    const Answer made =
        service.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + cloud + R"(","preview":{"count":500}})");
    REQUIRE(made.status == 202);
    path = made.header("Location");
    ready(service);
    CHECK(service.service.clouds.memory().held() == 0);
    const std::uint64_t part = service.service.sessions.memory().held();
    // What is asked for of the whole cloud is read again.
    CHECK(service.get("/v1/clouds/" + cloud + "/data?format=ply").status == 200);
    CHECK(service.service.clouds.memory().held() > 0);
    REQUIRE(service.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + cloud + R"("})").status == 202);
    CHECK(service.service.sessions.memory().held() > 5 * part);
    bytes = samples(service, path);
  }
  TestService service(lasting(folder));
  CHECK(service.get(path).status == 200);
  ready(service);
  CHECK(samples(service, path) == bytes);
}

TEST_CASE("a file that is damaged takes its session alone with it, until it is uploaded again") {
  const TemporaryFolder folder;
  const Config config = lasting(folder);
  std::string harmed, unharmed;
  {
    TestService service(config);
    harmed = service.open_painted();
    const std::string blob = only_file_in(config.data + "/blobs");
    const std::string cloud = service.upload(20);
    const Answer made =
        service.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + cloud + R"(","scales":[0.05]})");
    unharmed = made.header("Location");
    std::fstream file(blob, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(2000);
    const int byte = file.peek();
    file.seekp(2000);
    file.put(static_cast<char>(byte ^ 1));
  }
  for (int round = 0; round < 2; ++round) {
    TestService service(config);
    const Answer refused = service.get(harmed);
    CHECK(refused.status == 409);
    CHECK(refused.body["type"] == "/problems/damaged");
    CHECK(service.ask(Method::kPost, harmed + "/edits", edit(0.1), if_match("*")).status == 409);
    CHECK(service.get(unharmed).body["state"] == "ready");
    CHECK(service.notes.empty());
  }
  TestService service(config);
  (void)service.upload();  // the very same file
  CHECK(service.get(harmed).body["state"] == "ready");
  CHECK(service.get(harmed).body["revision"] == 2);
}

TEST_CASE("a session whose edits lead elsewhere than they did is not served") {
  const TemporaryFolder folder;
  std::string path;
  {
    TestService service(lasting(folder));
    path = service.open_painted();
    commit(service, path, edit(0.3, kResampled));
  }
  {
    // The same rows, another engine.
    TestService service(
        lasting(folder), [](const auto& surface, const auto& sampling, const auto& params, const auto& field,
                            const auto& regions, auto effort, const auto* context) {
          EditParams other = params;
          other.resampling->collect = 0.0;
          return double_every_tenth(surface, sampling, other, field, regions, effort, context);
        });
    const Answer shown = service.get(path);
    CHECK(shown.body["state"] == "failed");
    CHECK(shown.body["error"]["type"] == "/problems/damaged");
    CHECK(service.get(path + "/samples?format=ply").status == 409);
  }
  TestService service(lasting(folder));
  CHECK(service.get(path).status == 409);
  CHECK(service.ask(Method::kDelete, path).status == 204);
}

TEST_CASE(
    "where the memory is used up the session that was idle for longest sleeps, and comes back by itself") {
  const TemporaryFolder folder;
  Config config = lasting(folder);
  std::uint64_t bytes = 0;
  {
    TestService probe;
    probe.open_session();
    config.limits.max_session_bytes = 1;
    config.limits.history_bytes = 1 << 20;
    // What one needs is what one too large is told.
    TestService small(config);
    const Answer refused =
        small.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + small.upload() + R"(","scales":[0.05]})");
    CHECK(refused.status == 507);
    bytes = refused.body["actual"];
  }
  config.limits.max_session_bytes = 2 * bytes + bytes / 2;
  TestService service(config);
  const std::string first = service.open_painted();
  commit(service, first, edit(0.3));
  const json document = without_timings(service.get(first).body);
  const std::string committed = samples(service, first);
  const std::string second = service.open_session();
  const std::string third = service.open_session();
  const auto state_of = [&](const std::string& path) {
    for (const json& session : sessions_of(service))
      if ("/v1/sessions/" + session["id"].get<std::string>() == path)
        return session["state"].get<std::string>();
    return std::string("gone");
  };
  CHECK(state_of(first) == "asleep");
  CHECK(state_of(third) == "ready");
  CHECK(without_timings(service.get(first).body) == document);
  CHECK(samples(service, first) == committed);
  CHECK(state_of(second) == "asleep");
  // Those that somebody holds stay awake: a viewer with a stream does.
  const auto held = service.service.sessions.get(first.substr(first.rfind('/') + 1));
  const auto held_too = service.service.sessions.get(third.substr(third.rfind('/') + 1));
  REQUIRE(held.ok());
  REQUIRE(held_too.ok());
  const Answer refused = service.get(second);
  CHECK(refused.status == 503);
  CHECK(refused.header("Retry-After") == "2");
  CHECK(refused.body["limit"] == config.limits.max_session_bytes);
  CHECK(state_of(first) == "ready");
}

TEST_CASE("sessions that nobody asked for expire, those in use do not") {
  const TemporaryFolder folder;
  TestService service(lasting(folder));
  const std::string left = service.open_session();
  const std::string used = service.open_session();
  const auto held = service.service.sessions.get(used.substr(used.rfind('/') + 1));
  const auto now = std::chrono::system_clock::now();
  CHECK(service.service.sessions.expire(now - std::chrono::hours(1)) == 0);
  CHECK(service.expire_idle(1) == 1);
  CHECK(service.get(left).status == 404);
  CHECK(service.get(used).status == 200);
}

TEST_CASE("clouds and images that nobody holds make room, and come back once somebody needs them") {
  const TemporaryFolder folder;
  std::vector<std::string> clouds;
  std::uint64_t each = 0;
  {
    TestService service(lasting(folder));
    clouds.push_back(service.upload());
    each = service.service.clouds.memory().held();
  }
  Config config = lasting(folder);
  config.limits.max_cloud_bytes = 2 * each + each / 2;
  TestService service(config);
  const auto data = [&](const std::string& cloud) {
    return service.get("/v1/clouds/" + cloud + "/data?format=ply");
  };
  for (int i = 0; i < 3; ++i) {
    clouds.push_back(service.upload());
    CHECK(service.service.clouds.memory().held() <= config.limits.max_cloud_bytes);
  }
  for (const std::string& cloud : clouds) {
    const Answer answer = data(cloud);
    CHECK(answer.status == 200);
    CHECK(answer.bytes == data(clouds.front()).bytes);
    CHECK(service.service.clouds.memory().held() <= config.limits.max_cloud_bytes);
  }
  // Sessions hold theirs: what is left is not enough for a third one.
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string body = R"({"cloud":")" + clouds[i] + R"(","scales":[0.05]})";
    REQUIRE(service.ask(Method::kPost, "/v1/sessions", body).status == 202);
  }
  const Answer refused = data(clouds[2]);
  CHECK(refused.status == 503);
  CHECK_FALSE(refused.header("Retry-After").empty());
  CHECK(refused.body["limit"] == config.limits.max_cloud_bytes);
  CHECK(data(clouds[0]).status == 200);
  for (const json& session : sessions_of(service))
    CHECK(service.ask(Method::kDelete, "/v1/sessions/" + session["id"].get<std::string>()).status == 204);
  // Its strand may hold a session for a moment longer.
  int status = 0;
  for (int i = 0; i < 2000 && status != 200; ++i) {
    status = data(clouds[2]).status;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  CHECK(status == 200);
}

TEST_CASE("a session that was not brought back for a passing reason is brought back when asked for later") {
  const TemporaryFolder folder;
  std::string path;
  json document;
  std::string committed;
  {
    TestService service(lasting(folder));
    path = service.open_painted();
    commit(service, path, edit(0.3));
    document = without_timings(service.get(path).body);
    committed = samples(service, path);
  }
  std::atomic<int> tries{0};
  std::atomic<bool> is_short{true};
  TestService service(lasting(folder), double_every_tenth, [&](auto&&... arguments) {
    ++tries;
    if (is_short) throw std::bad_alloc();
    return build_hierarchy(std::forward<decltype(arguments)>(arguments)...);
  });
  const Answer failed = service.get(path);
  CHECK(failed.body["state"] == "failed");
  CHECK(service.ask(Method::kPost, path + "/edits", edit(0.1), if_match("*")).status == 409);
  CHECK(tries >= 1);
  is_short = false;
  for (int i = 0; i < 100 && service.get(path).body["state"] != "ready"; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  CHECK(without_timings(service.get(path).body) == document);
  CHECK(samples(service, path) == committed);
  commit(service, path, edit(0.1));
}

TEST_CASE("an edit that is taken out with a key is taken out once") {
  const TemporaryFolder folder;
  const std::vector<NameValue> key = {{"idempotency-key", "out"}, {"if-match", "*"}};
  std::string path;
  Answer first;
  {
    TestService service(lasting(folder));
    path = service.open_painted();
    for (const double z : {0.3, 0.2, 0.1}) commit(service, path, edit(z));
    first = service.ask(Method::kDelete, path + "/edits/1", "", key);
    REQUIRE(first.status == 200);
    const Answer again = service.ask(Method::kDelete, path + "/edits/1", "", key);
    CHECK(again.status == 200);
    CHECK(again.bytes == first.bytes);
    CHECK(again.header("Idempotency-Replayed") == "true");
    CHECK(service.get(path + "/edits").body["edits"].size() == 2);
    CHECK(service.ask(Method::kDelete, path + "/edits/2", "", key).status == 422);
  }
  TestService service(lasting(folder));
  CHECK(service.ask(Method::kDelete, path + "/edits/1", "", key).bytes == first.bytes);
  CHECK(service.get(path + "/edits").body["edits"].size() == 2);
}

TEST_CASE("a request with a key has one effect and one answer, here and after a restart") {
  const TemporaryFolder folder;
  const std::vector<NameValue> key = {{"idempotency-key", "one"}, {"if-match", "*"}};
  for (const bool lasts : {true, false}) {
    CAPTURE(lasts);
    const Config config = lasts ? lasting(folder) : Config{};
    std::string path;
    Answer first;
    {
      TestService service(config);
      path = service.open_painted();
      first = service.ask(Method::kPost, path + "/edits", edit(0.3), key);
      REQUIRE(first.status == 201);
      const Answer second = service.ask(Method::kPost, path + "/edits", edit(0.3), key);
      CHECK(second.status == 201);
      CHECK(second.bytes == first.bytes);
      CHECK(second.header("ETag") == first.header("ETag"));
      CHECK(second.header("Idempotency-Replayed") == "true");
      CHECK(service.get(path + "/edits").body["edits"].size() == 1);
      const Answer other = service.ask(Method::kPost, path + "/edits", edit(0.4), key);
      CHECK(other.status == 422);
      CHECK(other.body["type"] == "/problems/key-reused");
      // What was refused had no effect: the key is free.
      const std::vector<NameValue> two = {{"idempotency-key", "two"}};
      CHECK(service.ask(Method::kPost, path + "/edits", edit(0.4), two).status == 428);
      const Answer painted =
          service.ask(Method::kPost, path + "/regions/zero/operations", kSphere, {{"idempotency-key", "p"}});
      CHECK(painted.status == 200);
      CHECK(service.ask(Method::kPost, path + "/regions/zero/operations", kSphere, {{"idempotency-key", "p"}})
                .bytes == painted.bytes);
      CHECK(service.get(path + "/regions/zero").body["operations"].size() == 2);
      CHECK(service.ask(Method::kPost, path + "/edits", edit(0.4), {{"idempotency-key", ""}}).status == 400);
      const std::string body = R"({"cloud":")" + service.upload() + R"(","scales":[0.05]})";
      const Answer made = service.ask(Method::kPost, "/v1/sessions", body, {{"idempotency-key", "s"}});
      const Answer same = service.ask(Method::kPost, "/v1/sessions", body, {{"idempotency-key", "s"}});
      CHECK(made.status == 202);
      CHECK(same.header("Location") == made.header("Location"));
      CHECK(service.get("/v1/sessions").body["sessions"].size() == 2);
    }
    if (!lasts) continue;
    TestService service(config);
    const Answer again = service.ask(Method::kPost, path + "/edits", edit(0.3), key);
    CHECK(again.status == 201);
    CHECK(again.bytes == first.bytes);
    CHECK(service.get(path + "/edits").body["edits"].size() == 1);
  }
}
