// What was acknowledged is there after a loss of power at any fsync, after a disk that takes no fsync any more,
// and after a disk that fills: with the real daemon on a disk that fails on demand.
//
// A story is told once on a healthy disk, then again for every fsync of it.

#include <doctest/doctest.h>

#include <chrono>
#include <csignal>
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
  static const std::string kFile = file_of(wavy_sheet(30));
  return kFile;
}
const std::string& other_sheet() {
  static const std::string kFile = file_of(wavy_sheet(25));
  return kFile;
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
  static const std::size_t kHalf = other_sheet().size() / 2;
  static const std::vector<Step> kSteps{
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
      continue_upload(0, kHalf),
      continue_upload(kHalf, other_sheet().size()),
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
  return kSteps;
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

/// What is to be seen after so many steps, and how many fsyncs the story has.
struct Course {
  std::vector<json> states;
  std::int64_t sync_count = 0;
};

const Course& course() {
  static const Course kCourse = [] {
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
    return course;
  }();
  return kCourse;
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

/// A daemon on a healthy disk finds what was acknowledged, and of the step after that all or nothing.
void check_found(const std::string& folder, std::size_t step_count) {
  Daemon daemon({"--data", folder});
  const json found = state_of(daemon);
  const std::vector<json>& states = course().states;
  const bool is_whole =
      found == states[step_count] || (step_count + 1 < states.size() && found == states[step_count + 1]);
  CHECK_MESSAGE(is_whole, "found ", found.dump(), "\nafter acknowledging ", states[step_count].dump());
  CHECK(daemon.get("/readyz").status == 200);
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
  for (std::int64_t k = 1; k <= course().sync_count + 1; ++k) {
    CAPTURE(k);
    FaultyDisk disk;
    disk.page().fail_from = k;
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
      CHECK(disk.page().sync_count >= k);
    }
    CAPTURE(step_count);
    check_found(disk.after_power_loss(FaultyDisk::Names::kSynced), step_count);
    check_found(disk.data(), step_count);
  }
}
