// Many streams at once beside other requests: readers that keep up stay, those that do not are dropped.

#include <doctest/doctest.h>

#include <atomic>
#include <csignal>
#include <list>
#include <string>
#include <thread>
#include <vector>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/raw_client.h"

using namespace pointwright;
using namespace pointwright::test;
using namespace std::chrono_literals;

namespace {

constexpr int kReaders = 136;
constexpr int kUnread = 64;

/// The value of a gauge without labels; -1 where it is not there.
double gauge(Daemon& daemon, const std::string& name) {
  const std::string text = daemon.get("/metrics").body;
  const std::size_t at = text.find("\n" + name + " ");
  return at == std::string::npos ? -1.0 : std::stod(text.substr(at + name.size() + 2));
}

template <typename Condition>
bool comes_true(Condition condition, std::chrono::seconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(50ms);
  }
  return true;
}

}  // namespace

TEST_CASE("200 streams stand beside other requests, and the 64 that nobody reads are dropped") {
  Daemon daemon({"--stream-write-deadline-ms", "1000", "--heartbeat-ms", "500"});
  const Reply cloud = daemon.upload(file_of(wavy_sheet(150)), "application/x-ply");
  REQUIRE(cloud.status == 201);
  const std::string session = daemon.open_session(cloud.json()["id"]);
  const std::string request = "GET " + session + "/stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
  const std::size_t before = daemon.resident_kilobytes();

  std::list<RawClient> unread;
  for (int i = 0; i < kUnread; ++i) unread.emplace_back(daemon.port()).send(request);
  std::list<RawClient> read;
  for (int i = 0; i < kReaders; ++i) read.emplace_back(daemon.port()).send(request);
  std::atomic<bool> enough{false};
  std::atomic<int> ended{0};
  std::atomic<int> marked{0};
  // One thread reads them all in turn: each has to be emptied well within its deadline.
  std::thread reader([&] {
    std::list<std::pair<RawClient*, std::string>> open;
    for (RawClient& client : read) open.emplace_back(&client, "");
    while (!open.empty() && !enough) {
      std::vector<pollfd> polls;
      for (auto& [client, tail] : open)
        polls.push_back({.fd = client->descriptor(), .events = POLLIN, .revents = 0});
      if (::poll(polls.data(), polls.size(), 100) <= 0) continue;
      std::size_t i = 0;
      for (auto it = open.begin(); it != open.end(); ++i) {
        if (polls[i].revents == 0 || it->first->receive_some(it->second, 0ms)) {
          if (it->second.size() > 4096) it->second.erase(0, it->second.size() - 4096);
          ++it;
          continue;
        }
        ++ended;
        if (it->second.find("the server is stopping") != std::string::npos) ++marked;
        it = open.erase(it);
      }
    }
  });
  REQUIRE(comes_true([&] { return gauge(daemon, "pointwright_streams") == kReaders + kUnread; }, 60s));
  MESSAGE("resident: ", before, " kB before, ", daemon.resident_kilobytes(), " kB with 200 streams");

  // Each preview moves half of the surface, in a new frame for everybody, until the unread ones fall behind.
  REQUIRE(daemon.ask("POST", session + "/regions/zero/operations", kLeft).status == 200);
  REQUIRE(daemon.ask("POST", session + "/regions/one/operations", kRight).status == 200);
  int previews = 0;
  const bool dropped = comes_true(
      [&] {
        ++previews;
        const std::string more = ",\"sequence\":" + std::to_string(previews);
        CHECK(daemon.ask("PUT", session + "/preview", translation(0.01 * previews, more)).status == 204);
        CHECK(daemon.get("/healthz").status == 200);
        return gauge(daemon, "pointwright_streams") == kReaders;
      },
      120s);
  CHECK(dropped);
  CHECK(ended == 0);
  // At the end each reader is told why.
  CHECK(daemon.stop(SIGTERM) == 0);
  CHECK(comes_true([&] { return ended == kReaders; }, 20s));
  enough = true;
  reader.join();
  CHECK(marked == kReaders);
}
