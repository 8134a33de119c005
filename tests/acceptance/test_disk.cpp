// What was acknowledged is there after a loss of power at any fsync, after a disk that takes no fsync any
// more, and after a disk that fills: with the real daemon on a disk that fails on demand.
//
// A story is told once on a healthy disk, then again for one fsync or write after the other: for every one
// where POINTWRIGHT_EVERY_SYNC is set, for a sample of some otherwise.

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <optional>
#include <thread>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/faulty_disk.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kAny = "If-Match: *\r\n";
const std::string kTus = "Tus-Resumable: 1.0.0\r\n";
const std::string kBall = R"({"mode":"add","shape":{"type":"sphere","center":[0.6,0.5,0],"radius":0.15}})";

std::string list_of(const std::string& operations) {
  return R"({"operations":[)" + operations + "]}";
}
std::string at_offset(std::size_t offset) {
  return kTus + "Content-Type: application/offset+octet-stream\r\nUpload-Offset: " + std::to_string(offset) +
         "\r\n";
}

/// Status 0 where the daemon is gone.
Reply ask(Daemon& daemon, const std::string& method, const std::string& target, const std::string& body = "",
          const std::string& headers = "") {
  try {
    return daemon.ask(method, target, body, headers);
  } catch (const std::runtime_error&) {
    return {};
  }
}

bool is_done(const Reply& reply) {
  return reply.status >= 200 && reply.status < 300;
}

/// A session once it is neither being made nor brought back; null where the daemon is gone.
json settled(Daemon& daemon, const std::string& session) {
  for (int i = 0; i < 6000; ++i) {
    const Reply reply = ask(daemon, "GET", session);
    if (reply.status == 0) return nullptr;
    json document = reply.json();
    if (document.value("state", "") != "building" && document.value("state", "") != "asleep") return document;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  FAIL("the session does not become ready");
  return nullptr;
}

/// One telling of the story: what its later requests have to know of the earlier ones.
struct Telling {
  explicit Telling(Daemon& all) : daemon(all) {}
  Daemon& daemon;
  std::string cloud, session, upload, other_upload;
};

std::string place_in(const Reply& reply) {
  return reply.headers.count("location") > 0 ? reply.headers.at("location") : "";
}

const std::string& sheet() {
  static const std::string file = file_of(wavy_sheet(30));
  return file;
}
const std::string& other_sheet() {
  static const std::string file = file_of(wavy_sheet(25));
  return file;
}

using Step = std::function<Reply(Telling&)>;

Step on_session(const std::string& method, const std::string& below, const std::string& body) {
  return [=](Telling& telling) { return ask(telling.daemon, method, telling.session + below, body, kAny); };
}
Step continue_upload(std::size_t begin, std::size_t end) {
  return [=](Telling& telling) {
    return ask(telling.daemon, "PATCH", telling.upload, other_sheet().substr(begin, end - begin),
               at_offset(begin));
  };
}

/// The story: each step is one change that the daemon acknowledges.
const std::vector<Step>& story() {
  static const std::size_t half = other_sheet().size() / 2;
  static const std::vector<Step> steps{
      [](Telling& telling) {
        Reply reply = ask(telling.daemon, "POST", "/v1/clouds?name=test", sheet(),
                          "Content-Type: application/octet-stream\r\n");
        if (reply.status == 201) telling.cloud = reply.json()["id"];
        return reply;
      },
      [](Telling& telling) {
        Reply reply = ask(telling.daemon, "POST", "/v1/sessions",
                          R"({"cloud":")" + telling.cloud + R"(","scales":[0.05]})");
        telling.session = place_in(reply);
        if (reply.status == 202) settled(telling.daemon, telling.session);
        return reply;
      },
      on_session("POST", "/regions/zero/operations", kLeft),
      on_session("POST", "/regions/one/operations", kRight),
      on_session("POST", "/edits", translation(0.3)),
      on_session("POST", "/edits", translation(-0.1)),
      on_session("PUT", "/head", R"({"edit":1})"),
      on_session("PUT", "/regions/arm", list_of(kBall)),
      on_session("PATCH", "", R"({"name":"renamed"})"),
      [](Telling& telling) {
        Reply reply = ask(telling.daemon, "POST", "/v1/uploads", "",
                          kTus + "Upload-Length: " + std::to_string(other_sheet().size()) + "\r\n");
        telling.upload = place_in(reply);
        return reply;
      },
      continue_upload(0, half),
      continue_upload(half, other_sheet().size()),
      [](Telling& telling) {
        const std::string id = telling.upload.substr(telling.upload.rfind('/') + 1);
        return ask(telling.daemon, "POST", "/v1/clouds", R"({"upload":")" + id + "\"}");
      },
      [](Telling& telling) {
        Reply reply = ask(telling.daemon, "POST", "/v1/uploads", "", kTus + "Upload-Length: 30\r\n");
        telling.other_upload = place_in(reply);
        return reply;
      },
      [](Telling& telling) {
        return ask(telling.daemon, "PATCH", telling.other_upload, "1 2 3\n4 5 6\n7 8 10\n",
                   at_offset(0) + "Upload-Checksum: sha256 hYqXxlky10COT3iac4go5zLfqlku87Ta0ObxTl0hoOQ=\r\n");
      },
      [](Telling& telling) { return ask(telling.daemon, "DELETE", telling.other_upload, "", kTus); },
      on_session("DELETE", "", ""),
      [](Telling& telling) { return ask(telling.daemon, "DELETE", "/v1/clouds/" + telling.cloud); },
  };
  return steps;
}

/// A member of an answer; null where the daemon is gone.
json read_of(Daemon& daemon, const std::string& path, const char* member) {
  const json document = ask(daemon, "GET", path).json();
  return document.is_object() ? document.value(member, json()) : json();
}

/// All that clients see, without what differs from telling to telling: ids and times.
json state_of(Daemon& daemon) {
  json state = {{"clouds", json::array()}, {"sessions", json::array()}, {"uploads", json::array()}};
  for (const json& cloud : read_of(daemon, "/v1/clouds", "clouds"))
    state["clouds"].push_back({cloud["name"], cloud["sha256"], cloud["sample_count"]});
  for (const json& upload : read_of(daemon, "/v1/uploads", "uploads"))
    state["uploads"].push_back({upload["length"], upload["offset"]});
  for (const json& listed : read_of(daemon, "/v1/sessions", "sessions")) {
    const std::string path = "/v1/sessions/" + listed["id"].get<std::string>();
    json session = settled(daemon, path);
    for (const char* const member : {"id", "cloud", "created", "timings_ms"}) session.erase(member);
    for (const json& edit : read_of(daemon, path + "/edits", "edits"))
      session["hashes"].push_back(edit["surface_hash"]);
    for (const char* const region : {"/regions/zero", "/regions/one", "/regions/arm"})
      session["operations"].push_back(read_of(daemon, path + region, "operations"));
    const std::string samples = ask(daemon, "GET", path + "/samples?format=ply").body;
    session["samples"] = std::hash<std::string>()(samples);
    state["sessions"].push_back(std::move(session));
  }
  return state;
}

/// What is to be seen after so many steps, and how many fsyncs and writes the story has.
struct Course {
  std::vector<json> states;
  std::int64_t sync_count = 0;
  std::int64_t write_count = 0;
};

const Course& course() {
  static const Course taken = [] {
    Course course;
    FaultyDisk disk;
    Daemon daemon(disk.arguments(), disk.environment());
    Telling telling(daemon);
    course.states.push_back(state_of(daemon));
    for (const Step& step : story()) {
      const Reply reply = step(telling);
      REQUIRE_MESSAGE(is_done(reply), course.states.size(), ": ", reply.status, " ", reply.body);
      course.states.push_back(state_of(daemon));
      CHECK(course.states.back() != course.states[course.states.size() - 2]);
    }
    course.sync_count = disk.page().sync_count;
    course.write_count = disk.page().write_count;
    return course;
  }();
  return taken;
}

/// How a telling ended: how many steps were acknowledged, and the first answer that was not.
struct Told {
  std::size_t step_count = 0;
  std::optional<Reply> refused;
};

Told tell(Telling& telling) {
  Told told;
  for (const Step& step : story()) {
    const Reply reply = step(telling);
    if (!is_done(reply)) {
      told.refused = reply;
      break;
    }
    ++told.step_count;
  }
  return told;
}

/// Whether an upload got some of the bytes of a step, and nothing else is otherwise: whatever came of a body
/// counts, and the client asks how far it is.
bool is_part_way(json found, const json& before, const json& after) {
  if (before["uploads"].size() != found["uploads"].size() ||
      after["uploads"].size() != found["uploads"].size())
    return false;
  for (std::size_t i = 0; i < found["uploads"].size(); ++i) {
    const std::size_t offset = found["uploads"][i][1];
    if (before["uploads"][i][1] <= offset && offset <= after["uploads"][i][1])
      found["uploads"][i][1] = before["uploads"][i][1];
  }
  return found == before;
}

/// A daemon on a healthy disk finds what was acknowledged, and of the step after that all or nothing.
void check_found(const std::string& folder, std::size_t step_count) {
  Daemon daemon({"--data", folder});
  const json found = state_of(daemon);
  const std::vector<json>& states = course().states;
  const json& before = states[step_count];
  const json& after = states[std::min(step_count + 1, states.size() - 1)];
  const bool is_whole = found == before || found == after || is_part_way(found, before, after);
  CHECK_MESSAGE(is_whole, "found ", found.dump(), "\nafter acknowledging ", before.dump());
  CHECK(daemon.get("/readyz").status == 200);
}

/// Every sync or write where POINTWRIGHT_EVERY_SYNC is set, otherwise every so many.
std::int64_t stride(std::int64_t otherwise) {
  return std::getenv("POINTWRIGHT_EVERY_SYNC") != nullptr ? 1 : otherwise;
}

/// Tells the story on a disk that fails at some moment, and looks at what is left.
void check_failing(FaultyDisk& disk) {
  std::size_t step_count = 0;
  try {
    Daemon daemon(disk.arguments(), disk.environment());
    Telling telling(daemon);
    const Told told = tell(telling);
    step_count = told.step_count;
    CAPTURE(step_count);
    if (told.refused) {
      CHECK_MESSAGE(told.refused->status == 503, told.refused->body);
      CHECK(told.refused->json()["type"] == "/problems/storage-failed");
      // What is read is what was acknowledged. Only a file's name that was taken away stays away.
      const json seen = state_of(daemon);
      const json& acknowledged = course().states[step_count];
      CHECK(seen["clouds"] == acknowledged["clouds"]);
      CHECK(seen["sessions"] == acknowledged["sessions"]);
      CHECK((seen == acknowledged || seen == course().states[step_count + 1]));
      CHECK(ask(daemon, "GET", "/readyz").status == 503);
      // Trying again does not help.
      CHECK_FALSE(is_done(story()[step_count](telling)));
    } else {
      CHECK(step_count == story().size());
    }
    daemon.stop(SIGKILL);
  } catch (const std::runtime_error& error) {
    // It does not start on such a disk, and says why.
    CHECK(std::string(error.what()).find("does not start: ") != std::string::npos);
    CHECK(std::string(error.what()).size() > 40);
  }
  CAPTURE(step_count);
  check_found(disk.after_power_loss(FaultyDisk::Names::kSynced), step_count);
  check_found(disk.data(), step_count);
}

std::size_t offset_of(Daemon& daemon, const std::string& upload) {
  const Reply head = daemon.ask("HEAD", upload, "", kTus);
  REQUIRE(head.status == 200);
  return std::stoul(head.headers.at("upload-offset"));
}

/// Whether the rest of the file is taken, and the cloud made of the upload is the file.
bool finish(Daemon& daemon, const std::string& upload, const std::string& file, std::size_t offset) {
  const Reply rest = daemon.ask("PATCH", upload, file.substr(offset), at_offset(offset));
  const std::string id = upload.substr(upload.rfind('/') + 1);
  const Reply cloud = daemon.ask("POST", "/v1/clouds", R"({"upload":")" + id + "\"}");
  if (rest.status != 204 || cloud.status != 201) return false;
  return daemon.get(place_in(cloud) + "/data").body == file;
}

}  // namespace

TEST_CASE("a loss of power at any fsync loses nothing that was acknowledged and leaves nothing half done" *
          doctest::skip(!FaultyDisk::works())) {
  for (std::int64_t k = 1; k <= course().sync_count + 1; ++k) {
    CAPTURE(k);
    FaultyDisk disk;
    disk.page().cut_at = k;
    std::size_t step_count = 0;
    try {
      Daemon daemon(disk.arguments(), disk.environment());
      Telling telling(daemon);
      const Told told = tell(telling);
      step_count = told.step_count;
      if (told.refused) CHECK_MESSAGE(told.refused->status == 0, told.refused->body);
      CHECK(daemon.stop(SIGKILL) == 128 + SIGKILL);
    } catch (const std::runtime_error&) {
      CHECK(disk.page().sync_count == k);  // it went while the daemon started
    }
    CAPTURE(step_count);
    CHECK((step_count == story().size() || disk.page().sync_count == k));
    for (const auto names : {FaultyDisk::Names::kSynced, FaultyDisk::Names::kAll}) {
      CAPTURE(static_cast<int>(names));
      check_found(disk.after_power_loss(names), step_count);
    }
  }
}

TEST_CASE("a disk that takes no fsync any more is told, and nothing that it did not take is acknowledged" *
          doctest::skip(!FaultyDisk::works())) {
  for (std::int64_t k = 1; k <= course().sync_count + 1; k += stride(3)) {
    CAPTURE(k);
    FaultyDisk disk;
    disk.page().fail_syncs_from = k;
    check_failing(disk);
    CHECK((disk.page().sync_count >= k || k > course().sync_count));
  }
}

TEST_CASE("a disk that takes no write any more is told, and nothing that it did not take is acknowledged" *
          doctest::skip(!FaultyDisk::works())) {
  for (std::int64_t k = 1; k <= course().write_count + 1; k += stride(11)) {
    CAPTURE(k);
    FaultyDisk disk;
    disk.page().fail_writes_from = k;
    check_failing(disk);
    CHECK((disk.page().write_count >= k || k > course().write_count));
  }
}

TEST_CASE(
    "a disk that fills in the middle of a resumable upload is told, and the upload goes on where it stood" *
    doctest::skip(!FaultyDisk::works())) {
  const std::string file = file_of(wavy_sheet(200));
  const std::size_t third = file.size() / 3;
  const std::string digest = "Upload-Checksum: sha256 0cHbl+LpUrXxOIfCNh0Kf6sayPIJX7hvM02S+yZGVOE=\r\n";
  FaultyDisk disk;
  Daemon daemon(disk.arguments(), disk.environment());
  Telling telling(daemon);
  for (std::size_t step = 0; step < 6; ++step) REQUIRE(is_done(story()[step](telling)));
  const json before = state_of(daemon);
  const std::string upload = place_in(
      daemon.ask("POST", "/v1/uploads", "", kTus + "Upload-Length: " + std::to_string(file.size()) + "\r\n"));
  REQUIRE(daemon.ask("PATCH", upload, file.substr(0, third), at_offset(0)).status == 204);

  std::size_t offset = third;
  for (const std::int64_t room : {0, 1, 10'000, 100'000}) {
    CAPTURE(room);
    for (const std::string& checksum : {std::string(), digest}) {
      CAPTURE(checksum);
      disk.page().room = room;
      const Reply refused = daemon.ask("PATCH", upload, file.substr(offset), at_offset(offset) + checksum);
      CHECK_MESSAGE(refused.status == 507, refused.body);
      CHECK(refused.json()["type"] == "/problems/out-of-space");
      CHECK(refused.headers.count("retry-after") == 1);
      const std::size_t kept = offset_of(daemon, upload);
      CHECK(kept >= offset);
      CHECK(kept <= offset + static_cast<std::size_t>(room));
      if (!checksum.empty()) CHECK(kept == offset);  // bytes that cannot be checked do not count
      offset = kept;
      CHECK(ask(daemon, "GET", "/readyz").status == 200);
      const json now = state_of(daemon);
      CHECK(now["sessions"] == before["sessions"]);
      CHECK(now["clouds"] == before["clouds"]);
      // What was told stands on the disk.
      Daemon after({"--data", disk.after_power_loss(FaultyDisk::Names::kSynced)});
      CHECK(offset_of(after, upload) == offset);
      CHECK(state_of(after) == now);
      if (room == 10'000) CHECK(finish(after, upload, file, offset));
    }
  }
  disk.page().room = -1;
  CHECK(offset > third);
  CHECK(finish(daemon, upload, file, offset));
  CHECK(is_done(story()[6](telling)));
}

TEST_CASE("a disk that fills in the middle of an edit is told, and the session stays as it was" *
          doctest::skip(!FaultyDisk::works())) {
  FaultyDisk disk;
  json acknowledged;
  std::size_t refused_count = 0;
  {
    Daemon daemon(disk.arguments(), disk.environment());
    Telling telling(daemon);
    for (std::size_t step = 0; step < 4; ++step) REQUIRE(is_done(story()[step](telling)));
    std::size_t edit_count = 0;
    // The log grows by a page and its head at a time; where the room ends in a page, a part of it is
    // written.
    for (std::int64_t room = 0; edit_count < 3 && room < 200'000; room += 1373) {
      CAPTURE(room);
      acknowledged = state_of(daemon);
      disk.page().room = room;
      const Reply reply = ask(daemon, "POST", telling.session + "/edits", translation(0.1), kAny);
      disk.page().room = -1;
      if (is_done(reply)) {
        ++edit_count;
        continue;
      }
      ++refused_count;
      CHECK_MESSAGE(reply.status == 507, reply.body);
      CHECK(reply.json()["type"] == "/problems/out-of-disk");
      CHECK(state_of(daemon) == acknowledged);
      if (refused_count % 5 == 1) {
        Daemon after({"--data", disk.after_power_loss(FaultyDisk::Names::kSynced)});
        CHECK(state_of(after) == acknowledged);
      }
    }
    CHECK(edit_count == 3);
    CHECK(refused_count > 3);
    acknowledged = state_of(daemon);
    CHECK(acknowledged["sessions"][0]["history"]["edits"] == 3);
    daemon.stop(SIGKILL);
  }
  Daemon after(disk.arguments());
  CHECK(state_of(after) == acknowledged);
}
