// Who looks on, what they are told, and a history whose past is changed, with the real daemon.

#include <doctest/doctest.h>

#include <string>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/acceptance/stream_reader.h"
#include "tests/server/raw_client.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

std::string painted_session(Daemon& daemon) {
  const Reply uploaded = daemon.upload(file_of(wavy_sheet(40)), "application/x-ply");
  REQUIRE(uploaded.status == 201);
  const std::string session = daemon.open_session(uploaded.json()["id"]);
  REQUIRE(daemon.ask("POST", session + "/regions/zero/operations", kLeft).status == 200);
  REQUIRE(daemon.ask("POST", session + "/regions/one/operations", kRight).status == 200);
  return session;
}

/// The next event of that name.
json next_event(StreamReader& stream, const std::string& name) {
  while (auto record = stream.next()) {
    if (record->type != static_cast<std::uint32_t>(protocol::StreamRecordType::kEvent)) continue;
    json event = StreamReader::event(*record);
    if (event["event"] == name) return event;
  }
  FAIL("the stream ended before the event ", name);
  return {};
}

/// A reader of server-sent events.
class EventReader {
 public:
  EventReader(const Daemon& daemon, const std::string& target, const std::string& headers = "")
      : client_(daemon.port()) {
    client_.send("GET " + target + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n");
  }
  /// Reads on until the text has been there; all that came so far.
  const std::string& until(const std::string& text) {
    while (raw_.find(text) == std::string::npos)
      if (!client_.receive_some(raw_, std::chrono::seconds(20))) FAIL("no ", text, " came, but: ", raw_);
    return raw_;
  }

 private:
  RawClient client_;
  std::string raw_;
};

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

}  // namespace

TEST_CASE("viewers of one session see each other come and go") {
  Daemon daemon;
  const std::string session = painted_session(daemon);
  StreamReader first(daemon, session + "/stream?viewer=Ada");
  json seen = next_event(first, "presence");
  REQUIRE(seen["viewers"].size() == 1);
  CHECK(seen["viewers"][0]["name"] == "Ada");
  {
    StreamReader second(daemon, session + "/stream?viewer=Gr%C3%A4fin");
    CHECK(next_event(second, "presence")["viewers"].size() == 2);
    seen = next_event(first, "presence");
    REQUIRE(seen["viewers"].size() == 2);
    CHECK(seen["viewers"][1]["name"] ==
          "Gr\xc3\xa4"
          "fin");
    const EventReader third(daemon, session + "/events");
    CHECK(next_event(first, "presence")["viewers"].size() == 3);
  }
  do seen = next_event(first, "presence");
  while (seen["viewers"].size() > 1);
  CHECK(daemon.get(session + "/stream?viewer=a%0ab").status == 400);
  CHECK(daemon.get(session + "/stream?viewer=" + std::string(121, 'a')).status == 422);
  CHECK(daemon.get(session + "/events?attributes=t").status == 422);
}

TEST_CASE("server-sent events tell of each change, and a receiver that comes again of what it missed") {
  Daemon daemon;
  const std::string session = painted_session(daemon);
  EventReader events(daemon, session + "/events");
  events.until("text/event-stream");
  events.until("id: r2\nevent: session\ndata: {");
  const Reply renamed = daemon.ask("PATCH", session, R"({"name":"arm"})", "If-Match: \"r2\"\r\n");
  REQUIRE(renamed.status == 200);
  CHECK(renamed.json()["name"] == "arm");
  CHECK(renamed.headers.at("etag") == "\"r3\"");
  const std::string text = events.until("id: r3\nevent: session\ndata: {");
  CHECK(text.find("\"name\":\"arm\"", text.find("id: r3")) != std::string::npos);
  CHECK(daemon.ask("PATCH", session, R"({"name":"leg"})", "If-Match: \"r2\"\r\n").status == 412);
  CHECK(daemon.ask("PATCH", session, R"({"name":""})").status == 422);
  CHECK(daemon.ask("PATCH", session, R"({"title":"leg"})").status == 422);

  // Nothing was missed: no session event but the next one.
  EventReader again(daemon, session + "/events", "Last-Event-ID: r3\r\n");
  again.until("event: presence");
  REQUIRE(daemon.ask("PATCH", session, R"({"name":"leg"})").status == 200);
  const std::string later = again.until("id: r4\nevent: session");
  CHECK(count_of(later, "event: session") == 1);
  // A revision was missed, or the id is none of ours: it is told at once.
  EventReader late(daemon, session + "/events", "Last-Event-ID: r3\r\n");
  late.until("id: r4\nevent: session");
  EventReader foreign(daemon, session + "/events", "Last-Event-ID: 77\r\n");
  foreign.until("id: r4\nevent: session");
  REQUIRE(daemon.ask("DELETE", session).status == 204);
  late.until("event: end\ndata: {\"event\":\"end\",\"reason\":\"the session was deleted\"}");
}

TEST_CASE("an old edit is read, amended and taken out; the samples are those of the new numbers") {
  Daemon daemon;
  const std::string session = painted_session(daemon);
  const std::string any = "If-Match: *\r\n";
  for (const double z : {0.1, 0.2, 0.3})
    REQUIRE(daemon.ask("POST", session + "/edits", translation(z), any).status == 201);
  CHECK(daemon.get(session + "/edits/2").json()["edit"]["deformation"]["vector"][2] == 0.2);
  CHECK(daemon.get(session + "/edits/4").status == 404);
  CHECK(daemon.get(session + "/edits/0").status == 404);
  CHECK(daemon.get(session + "/edits/two").status == 404);
  CHECK(daemon.ask("PUT", session + "/edits/2", translation(0.5)).status == 428);
  CHECK(daemon.ask("PUT", session + "/edits/2", translation(0.5), "If-Match: \"r1\"\r\n").status == 412);
  const Reply amended = daemon.ask("PUT", session + "/edits/2", translation(0.5), "If-Match: \"r5\"\r\n");
  REQUIRE(amended.status == 200);
  CHECK(amended.json()["revision"] == 6);
  CHECK(amended.json()["history"]["head"] == 3);
  const std::string samples = daemon.get(session + "/samples?format=ply").body;

  const std::string other = painted_session(daemon);
  for (const double z : {0.1, 0.5, 0.3})
    REQUIRE(daemon.ask("POST", other + "/edits", translation(z), any).status == 201);
  CHECK(daemon.get(other + "/samples?format=ply").body == samples);

  REQUIRE(daemon.ask("DELETE", session + "/edits/1", "", any).status == 200);
  REQUIRE(daemon.ask("DELETE", session + "/edits/1", "", any).status == 200);
  CHECK(daemon.get(session + "/edits").json()["edits"].size() == 1);
  const std::string third = painted_session(daemon);
  REQUIRE(daemon.ask("POST", third + "/edits", translation(0.3), any).status == 201);
  CHECK(daemon.get(third + "/samples?format=ply").body == daemon.get(session + "/samples?format=ply").body);
}
