// What was acknowledged is there after whatever ends the daemon: kill -9 under load, a full disk, damage.

#include <doctest/doctest.h>

#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <mutex>
#include <random>
#include <thread>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

constexpr const char* kAny = "If-Match: *\r\n";

std::string keyed(const std::string& key) {
  return std::string(kAny) + "Idempotency-Key: " + key + "\r\n";
}

std::string open_painted(Daemon& daemon, std::size_t side = 40) {
  const std::string session = daemon.open_session(daemon.upload(file_of(wavy_sheet(side))).json()["id"]);
  REQUIRE(daemon.ask("POST", session + "/regions/zero/operations", kLeft).status == 200);
  REQUIRE(daemon.ask("POST", session + "/regions/one/operations", kRight).status == 200);
  return session;
}

/// The session once it is ready.
json woken(Daemon& daemon, const std::string& session) {
  json document;
  for (int i = 0; i < 3000; ++i) {
    document = daemon.get(session).json();
    if (document.value("state", "") != "building") break;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(document.value("state", "") == "ready");
  document.erase("timings_ms");
  return document;
}

/// The answer of a daemon that may be killed; of one that is gone already, none.
Reply ask_mortal(Daemon& daemon, const std::string& method, const std::string& target,
                 const std::string& body = "", const std::string& headers = "") {
  try {
    return daemon.ask(method, target, body, headers);
  } catch (const std::runtime_error&) {
    return {};
  }
}

/// One client that edits its own session, each request with a key, and remembers what was acknowledged.
struct Writer {
  std::string session;
  std::size_t sent = 0;
  std::vector<std::string> hashes;  ///< of the edits that were acknowledged, in their order
  std::size_t painted = 0;          ///< operations that were acknowledged
  std::string open_key;             ///< of a request that got no answer
  std::string open_body;

  std::string next_body() { return translation(0.01 + 0.001 * static_cast<double>(sent % 7)); }

  /// Returns whether the daemon answered.
  bool edit(Daemon& daemon) {
    if (open_key.empty()) {
      ++sent;
      open_key = session.substr(session.rfind('/') + 1) + "-" + std::to_string(sent);
      open_body = next_body();
    }
    const Reply reply = ask_mortal(daemon, "POST", session + "/edits", open_body, keyed(open_key));
    if (reply.status == 0) return false;
    if (reply.status == 201) {
      hashes.push_back(reply.json()["surface_hash"]);
      CHECK(reply.json()["index"] == hashes.size());
      open_key.clear();
    }
    return true;
  }
  bool paint(Daemon& daemon) {
    const std::string stroke = R"({"mode":"add","shape":{"type":"sphere","center":[0,)" +
                               std::to_string(0.1 * static_cast<double>(painted % 10)) +
                               R"(,0],"radius":0.05}})";
    const Reply reply = ask_mortal(daemon, "POST", session + "/regions/zero/operations", stroke);
    if (reply.status == 0) return false;
    if (reply.status == 200) ++painted;
    return true;
  }
};

/// All that the writer knows of is there, in its order, and nothing twice.
void check_kept(Daemon& daemon, Writer& writer) {
  const json document = woken(daemon, writer.session);
  while (!writer.open_key.empty()) REQUIRE(writer.edit(daemon));  // the last request, once more
  const json edits = daemon.get(writer.session + "/edits").json()["edits"];
  REQUIRE(edits.size() == writer.hashes.size());
  for (std::size_t i = 0; i < edits.size(); ++i) CHECK(edits[i]["surface_hash"] == writer.hashes[i]);
  const std::size_t operations = daemon.get(writer.session + "/regions/zero").json()["operations"].size();
  // One operation of which no answer came may be there as well.
  CHECK(operations >= writer.painted + 1);
  CHECK(operations <= writer.painted + 2);
  writer.painted = operations - 1;
}

class Limit {
 public:
  explicit Limit(pid_t pid) : pid_(pid) { REQUIRE(::prlimit(pid_, RLIMIT_FSIZE, nullptr, &before_) == 0); }
  void set(rlim_t bytes) const {
    const rlimit limit{.rlim_cur = bytes, .rlim_max = before_.rlim_max};
    REQUIRE(::prlimit(pid_, RLIMIT_FSIZE, &limit, nullptr) == 0);
  }
  void lift() const { REQUIRE(::prlimit(pid_, RLIMIT_FSIZE, &before_, nullptr) == 0); }

 private:
  pid_t pid_;
  rlimit before_{};
};

}  // namespace

TEST_CASE("a session is after kill -9 as it was, with its history and every bit of its surface") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  std::string session;
  json document, edits;
  std::string samples;
  {
    Daemon daemon(arguments);
    session = open_painted(daemon, 60);
    for (const std::string& body :
         {translation(0.3), translation(0.4, R"(,"resampling":{"bound":1.2})"), translation(-0.2)})
      REQUIRE(daemon.ask("POST", session + "/edits", body, kAny).status == 201);
    REQUIRE(daemon.ask("PUT", session + "/head", R"({"edit":2})").status == 200);
    document = woken(daemon, session);
    edits = daemon.get(session + "/edits").json();
    samples = daemon.get(session + "/samples?format=ply").body;
    CHECK(edits["edits"][1]["inserted"] > 0);
    daemon.stop(SIGKILL);
  }
  for (int round = 0; round < 2; ++round) {
    Daemon daemon(arguments);
    CHECK(daemon.get("/v1/sessions").json()["sessions"][0]["state"] == "asleep");
    CHECK(woken(daemon, session) == document);
    CHECK(daemon.get(session + "/edits").json() == edits);
    CHECK(daemon.get(session + "/samples?format=ply").body == samples);
    CHECK(daemon.stop(round == 0 ? SIGKILL : SIGTERM) == (round == 0 ? 128 + SIGKILL : 0));
  }
}

TEST_CASE("kill -9 at any moment under load loses nothing that was acknowledged and doubles nothing") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  std::mt19937 random(20260101);
  std::vector<Writer> writers(3);
  {
    Daemon daemon(arguments);
    for (Writer& writer : writers) writer.session = open_painted(daemon);
    daemon.stop(SIGKILL);
  }
  std::size_t acknowledged = 0;
  for (int round = 0; round < 4; ++round) {
    Daemon daemon(arguments);
    std::vector<std::thread> threads;
    for (Writer& writer : writers)
      threads.emplace_back([&] {
        while (writer.edit(daemon) && writer.paint(daemon)) {
        }
      });
    std::this_thread::sleep_for(std::chrono::milliseconds(300 + random() % 700));
    ::kill(daemon.pid(), SIGKILL);
    for (std::thread& thread : threads) thread.join();
    // Killed while it finds and brings back what is there: the next one starts from the same.
    for (int again = 0; again < 2; ++again) {
      Daemon interrupted(arguments);
      std::thread reader([&] { (void)ask_mortal(interrupted, "GET", writers[0].session); });
      std::this_thread::sleep_for(std::chrono::milliseconds(random() % 60));
      ::kill(interrupted.pid(), SIGKILL);
      reader.join();
    }
    Daemon after(arguments);
    for (Writer& writer : writers) {
      check_kept(after, writer);
      acknowledged += writer.hashes.size();
    }
  }
  MESSAGE(acknowledged, " edits checked");
  CHECK(acknowledged > 0);
}

TEST_CASE("a second daemon on the folder is refused at once, and the first one is unharmed") {
  const TemporaryFolder folder;
  Daemon first({"--data", folder / "data"});
  const Ended second = run({POINTWRIGHTD_PATH, "--port", "0", "--data", folder / "data"});
  CHECK(second.status == 1);
  CHECK(second.err.find("is in use by another pointwrightd") != std::string::npos);
  CHECK(first.get("/readyz").status == 200);
  CHECK(first.upload(file_of(wavy_sheet(20))).status == 201);
}

TEST_CASE("a full disk is told, loses nothing, leaves reading possible, and ends without a restart") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  Writer writer;
  {
    Daemon daemon(arguments);
    writer.session = open_painted(daemon);
    for (int i = 0; i < 3; ++i) REQUIRE(writer.edit(daemon));
    const json before = woken(daemon, writer.session);
    const Limit limit(daemon.pid());
    for (const rlim_t bytes : {rlim_t{0}, rlim_t{4096}}) {
      limit.set(bytes);
      for (const Reply& refused : {daemon.ask("POST", writer.session + "/edits", translation(0.5), kAny),
                                   daemon.ask("POST", writer.session + "/regions/one/operations", kRight),
                                   daemon.ask("PUT", writer.session + "/head", R"({"edit":1})"),
                                   daemon.ask("DELETE", writer.session)}) {
        CHECK(refused.status == 507);
        CHECK(refused.json()["type"] == "/problems/out-of-disk");
        CHECK(refused.headers.count("retry-after") == 1);
      }
      CHECK(daemon.get(writer.session + "/samples?format=ply").status == 200);
      CHECK(woken(daemon, writer.session) == before);
      CHECK(daemon.get("/readyz").status == 200);
      limit.lift();
    }
    REQUIRE(writer.edit(daemon));
    daemon.stop(SIGKILL);
  }
  Daemon daemon(arguments);
  check_kept(daemon, writer);
  CHECK(writer.hashes.size() == 4);
}

TEST_CASE("a blob with one bit flipped takes its own session alone with it") {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"--data", folder / "data"};
  std::string harmed, unharmed;
  {
    Daemon daemon(arguments);
    harmed = open_painted(daemon);
    const std::string blob = std::filesystem::directory_iterator(folder / "data/blobs")->path().string();
    unharmed = open_painted(daemon, 30);
    daemon.stop(SIGKILL);
    std::FILE* const file = std::fopen(blob.c_str(), "r+b");
    REQUIRE(file != nullptr);
    REQUIRE(std::fseek(file, 3000, SEEK_SET) == 0);
    const int byte = std::fgetc(file);
    REQUIRE(std::fseek(file, 3000, SEEK_SET) == 0);
    std::fputc(byte ^ 4, file);
    std::fclose(file);
  }
  Daemon daemon(arguments);
  const Reply refused = daemon.get(harmed);
  CHECK(refused.status == 409);
  CHECK(refused.json()["type"] == "/problems/damaged");
  CHECK(woken(daemon, unharmed)["history"]["head"] == 0);
  CHECK(daemon.ask("DELETE", harmed).status == 204);
}
