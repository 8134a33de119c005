// Routes and handlers without a socket: a request goes in, a response comes out.

#include <doctest/doctest.h>

#include <cctype>
#include <cstring>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <thread>

#include "engine/io/cloud_io.h"
#include "protocol/frames/frame.h"
#include "protocol/frames/stream_record.h"
#include "server/handlers/openapi.h"
#include "server/handlers/service.h"
#include "server/routes/routes.h"
#include "tests/server/test_service.h"
#include "tests/support/png_file.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;

/// The query parameters of each row, by "method pattern".
using RowQueries = std::map<std::string, std::set<std::string>>;

/// What the API's description has.
RowQueries described_rows() {
  const json openapi = json::parse(openapi_json());
  RowQueries rows;
  for (const auto& [path, operations] : openapi["paths"].items()) {
    if (path == "/assets/{file}") continue;  // answered from the table of files
    if (path == "/docs/{file}") {
      rows["get /docs/docs.css"] = {};
      rows["get /docs/docs.js"] = {};
      continue;
    }
    std::string pattern = path;
    for (const char* name :
         {"{cloud}", "{image}", "{import}", "{job}", "{session}", "{share}", "{token}", "{upload}"})
      if (const std::size_t at = pattern.find(name); at != std::string::npos)
        pattern.replace(at, std::strlen(name), "{id}");
    for (const auto& [method, operation] : operations.items()) {
      if (method == "parameters") continue;
      std::set<std::string>& names = rows[method + " " + pattern];
      for (const json* const owner : {&operations, &operation})
        for (const json& entry : owner->value("parameters", json::array())) {
          const json parameter =
              entry.contains("$ref")
                  ? openapi.at(json::json_pointer(entry["$ref"].get<std::string>().substr(1)))
                  : entry;
          if (parameter["in"] == "query") names.insert(parameter["name"].get<std::string>());
        }
    }
  }
  return rows;
}

TEST_CASE("every route is described with its query parameters, and everything described has a route") {
  CHECK(openapi_yaml().substr(0, 8) == "openapi:");
  RowQueries routed;
  for (const Route& route : all_routes()) {
    std::string row(method_name(route.method));
    for (char& c : row) c = static_cast<char>(std::tolower(c));
    std::istringstream names{std::string(route.query)};
    routed[row.append(" ").append(route.pattern)] =
        std::set<std::string>(std::istream_iterator<std::string>(names), {});
  }
  const RowQueries described = described_rows();
  CHECK(described.at("get /v1/jobs") == std::set<std::string>{"limit", "status"});
  CHECK(routed == described);
}

TEST_CASE("a query parameter that a row does not know is refused before anything is done") {
  TestService test;
  const std::string id = test.upload(5);
  const Answer refused = test.ask(Method::kDelete, "/v1/clouds/" + id + "?force=1");
  CHECK(refused.status == 422);
  CHECK(refused.body["errors"][0]["pointer"] == "?force");
  CHECK(test.get("/v1/clouds/" + id).status == 200);
  CHECK(test.get("/v1/clouds?limit=1").status == 422);
  CHECK(test.get("/v1/jobs?limit=1&limit=2").status == 422);
  CHECK(test.get("/v1/jobs?limit=1").status == 200);
  CHECK(test.get("/healthz?verbose").status == 200);
}

TEST_CASE("paths are matched segment by segment, with well-formed ids only") {
  std::vector<std::string> captures;
  const std::string id = "abcdefghijklmnopqrst-_";
  CHECK(matches("/v1/sessions/{id}/regions/{region}", "/v1/sessions/" + id + "/regions/one", captures));
  CHECK(captures == std::vector<std::string>{id, "one"});
  CHECK_FALSE(matches("/v1/sessions/{id}", "/v1/sessions/" + id + "/", captures));
  CHECK_FALSE(matches("/v1/sessions/{id}", "/v1/sessions/" + id + "x", captures));
  CHECK_FALSE(matches("/v1/sessions/{id}", "/v1/sessions/../../etc/passwd12345", captures));
  CHECK_FALSE(matches("/v1/sessions/{id}", "/v1/sessions", captures));
  CHECK(matches("/v1/sessions/{id}/regions/{region}", "/v1/sessions/" + id + "/regions/left wing", captures));
  for (const std::string name : {"t", ".", "..", "", "a+b"})
    CHECK_FALSE(
        matches("/v1/sessions/{id}/regions/{region}", "/v1/sessions/" + id + "/regions/" + name, captures));
}

TEST_CASE("unknown paths are 404, wrong methods 405 with what is allowed") {
  TestService test;
  CHECK(test.get("/nothing").status == 404);
  CHECK(test.get("/v1/clouds/AAAAAAAAAAAAAAAAAAAAAA").status == 404);
  CHECK(test.get("/v1/sessions/AAAAAAAAAAAAAAAAAAAAAA").status == 404);
  const Answer wrong = test.ask(Method::kPut, "/v1/clouds");
  CHECK(wrong.status == 405);
  CHECK(wrong.header("Allow") == "GET, HEAD, POST, OPTIONS");
  CHECK(wrong.body["type"] == "/problems/method-not-allowed");
  CHECK(test.ask(Method::kOptions, "/v1/info").status == 204);
  CHECK(test.ask(Method::kHead, "/v1/info").status == 200);
}

TEST_CASE("the service says what it is, what it can and where everything is") {
  TestService test;
  CHECK(test.get("/").body["service"] == "pointwright");
  CHECK(test.get("/healthz").body["status"] == "alive");
  CHECK(test.get("/readyz").status == 200);
  test.service.stopping = true;
  CHECK(test.get("/readyz").status == 503);
  const json info = test.get("/v1/info").body;
  CHECK(info["limits"].size() == limit_table().size());
  CHECK(info["limits"]["max_samples"] == Limits{}.max_samples);
  for (const protocol::ProblemInfo& problem : protocol::all_problems())
    CHECK(test.get("/problems/" + std::string(problem.slug)).status == 200);
  CHECK(test.get("/problems/no-such-thing").status == 404);
  CHECK(test.get("/openapi.json").body["openapi"] == "3.1.0");
  CHECK(test.get("/openapi.yaml").bytes == openapi_yaml());
}

TEST_CASE("an uploaded cloud is described, listed, given back and deleted") {
  TestService test;
  const std::string id = test.upload(20);
  const Answer cloud = test.get("/v1/clouds/" + id);
  CHECK(cloud.body["sample_count"] == 400);
  CHECK(cloud.body["name"] == "sheet");
  CHECK(cloud.body["sha256"].get<std::string>().size() == 64);
  CHECK(test.get("/v1/clouds/" + id, {{"if-none-match", cloud.header("ETag")}}).status == 304);
  CHECK(test.get("/v1/clouds").body["clouds"].size() == 1);

  const Answer data = test.get("/v1/clouds/" + id + "/data?format=ply");
  CHECK(data.status == 200);
  CHECK(data.content_type == "application/x-ply");
  const auto back =
      read_cloud(std::as_bytes(std::span(data.bytes.data(), data.bytes.size())), CloudFormat::kPly, {});
  REQUIRE(back.ok());
  CHECK(back.value().cloud.position == test::wavy_sheet(20).position);
  CHECK(test.get("/v1/clouds/" + id + "/data", {{"accept", "model/x-draco"}}).content_type ==
        "model/x-draco");
  CHECK(test.get("/v1/clouds/" + id + "/data", {{"accept", "image/png"}}).status == 406);
  CHECK(test.get("/v1/clouds/" + id + "/data?format=obj").status == 422);

  CHECK(test.ask(Method::kDelete, "/v1/clouds/" + id).status == 204);
  CHECK(test.get("/v1/clouds/" + id).status == 404);
}

TEST_CASE("bad uploads are told why") {
  TestService test;
  const auto status = [&](const std::string& target, const std::string& body,
                          const char* type = "application/octet-stream") {
    return test.ask(Method::kPost, target, body, {{"content-type", type}}).status;
  };
  CHECK(status("/v1/clouds", "") == 400);
  CHECK(status("/v1/clouds", "\x7f\x45LF what is this") == 415);
  CHECK(status("/v1/clouds", "not a ply", "application/x-ply") == 422);
  CHECK(status("/v1/clouds", "0 0 0\n0 1 nan\n", "text/plain") == 422);
  CHECK(status("/v1/clouds?nonfinite=drop", "0 0 0\n0 1 nan\n1 1 1\n", "text/plain") == 201);
  CHECK(status("/v1/clouds?nonfinite=maybe", "0 0 0\n") == 422);
  CHECK(status("/v1/clouds?colour=red", "0 0 0\n") == 422);
  CHECK(status("/v1/clouds?name=a&name=b", "0 0 0\n") == 422);
  CHECK(status("/v1/clouds?name=", "0 0 0\n") == 422);
  CHECK(test.get("/v1/clouds").body["clouds"].size() == 1);
}

TEST_CASE("quotas refuse with the limit and take again what was freed") {
  Config config;
  config.limits.max_clouds = 2;
  config.limits.max_sessions = 1;
  config.limits.max_samples = 1000;
  TestService test(config);
  const std::string first = test.upload(20);
  const Answer session = test.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + first + R"("})");
  CHECK(session.status == 202);
  CHECK(test.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + first + R"("})").status == 429);
  CHECK(test.ask(Method::kDelete, "/v1/clouds/" + first).status == 409);

  const auto large = write_cloud(test::wavy_sheet(40), CloudFormat::kPly, {});
  const std::string bytes(reinterpret_cast<const char*>(large.value().data()), large.value().size());
  const Answer refused =
      test.ask(Method::kPost, "/v1/clouds", bytes, {{"content-type", "application/x-ply"}});
  CHECK(refused.status == 413);
  CHECK(refused.body["limit"] == 1000);
  CHECK(refused.body["actual"] == 1600);

  test.upload(10);
  const Answer full = test.ask(Method::kPost, "/v1/clouds", "0 0 0\n", {{"content-type", "text/plain"}});
  CHECK(full.status == 429);
  CHECK(full.header("Retry-After").empty());  // time does not make room
  CHECK(test.ask(Method::kDelete, session.header("Location")).status == 204);
  CHECK(test.ask(Method::kDelete, "/v1/clouds/" + first).status == 204);
  CHECK(test.ask(Method::kPost, "/v1/clouds", "0 0 0\n", {{"content-type", "text/plain"}}).status == 201);
}

TEST_CASE("memory that is used up is 507") {
  Config config;
  config.limits.max_cloud_bytes = 20'000;
  config.limits.max_session_bytes = 100'000;
  TestService test(config);
  const std::string small = test.upload(20);
  const auto file = write_cloud(test::wavy_sheet(30), CloudFormat::kPly, {});
  CHECK(test.ask(Method::kPost, "/v1/clouds",
                 std::string(reinterpret_cast<const char*>(file.value().data()), file.value().size()),
                 {{"content-type", "application/x-ply"}})
            .status == 507);
  CHECK(test.ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + small + R"("})").status == 507);
}

TEST_CASE("bodies are documents of exactly the described kind") {
  TestService test;
  const std::string path = test.open_session();
  const auto status = [&](const std::string& body) {
    return test.ask(Method::kPost, path + "/regions/zero/operations", body).status;
  };
  CHECK(status("") == 400);
  CHECK(status("{") == 400);
  CHECK(status("[]") == 422);
  CHECK(status(R"({"mode":"add","shape":{"type":"sphere","center":[0,0,0],"radius":1},"colour":1})") == 422);
  CHECK(status(R"({"mode":"add","mode":"set","shape":{"type":"all"}})") == 422);
  CHECK(status(R"({"mode":"add","shape":{"type":"sphere","center":[0,0,0],"radius":-1}})") == 422);
  CHECK(status(R"({"mode":"add","shape":{"type":"sphere","center":[0,0,1e999],"radius":1}})") == 422);
  CHECK(status(std::string(100, '[') + std::string(100, ']')) == 422);
  const Answer wrong = test.ask(Method::kPost, path + "/regions/zero/operations",
                                R"({"mode":"add","shape":{"type":"sphere","center":[0,0,0],"radius":true}})");
  CHECK(wrong.status == 422);
  CHECK(wrong.body["errors"][0]["pointer"] == "/shape/radius");
  CHECK(wrong.body["request_id"] == "test-request");
  CHECK(test.get(path).body["revision"] == 0);
}

TEST_CASE("regions are painted, read, replaced and cleared") {
  TestService test;
  const std::string path = test.open_session();
  const Answer painted = test.ask(Method::kPost, path + "/regions/zero/operations", kSphere);
  CHECK(painted.status == 200);
  CHECK(painted.body["changed"] == painted.body["regions"]["zero"]["samples"]);
  CHECK(painted.header("ETag") == "\"r1\"");
  const Answer region = test.get(path + "/regions/zero");
  CHECK(region.body["operations"].size() == 1);
  CHECK(region.body["operations"][0]["shape"]["type"] == "sphere");
  CHECK(test.ask(Method::kPut, path + "/regions/zero", R"({"operations":[)" + kBox + "]}")
            .body["regions"]["zero"]["operations"] == 1);
  CHECK(test.ask(Method::kDelete, path + "/regions/zero").body["regions"]["zero"]["samples"] == 0);
  CHECK(test.get(path + "/regions/middle").status == 404);
}

TEST_CASE("a flood is read back as the balls that it filled, and they paint the same") {
  TestService test;
  const std::string zero = test.open_session() + "/regions/zero";
  const Answer flooded = test.ask(Method::kPost, zero + "/operations",
                                  R"({"mode":"flood","seed":[0.5,0.5,0],"radius":0.3,"steal":true})");
  REQUIRE(flooded.status == 200);
  CHECK(flooded.body["changed"] > 100);
  const Answer region = test.get(zero);
  REQUIRE(region.body["operations"].size() == 1);
  const json& recorded = region.body["operations"][0];
  CHECK(recorded["mode"] == "add");
  CHECK_FALSE(recorded.contains("steal"));
  CHECK(recorded["shape"]["type"] == "points");
  CHECK(recorded["shape"]["radii"].size() < flooded.body["changed"]);
  const Answer put = test.ask(Method::kPut, zero, json{{"operations", region.body["operations"]}}.dump());
  CHECK(put.status == 200);
  CHECK(put.body["regions"]["zero"]["samples"] == flooded.body["regions"]["zero"]["samples"]);
}

TEST_CASE("an edit owes the current revision") {
  TestService test;
  const std::string path = test.open_painted();
  const auto edit = [&](std::vector<NameValue> headers) {
    return test.ask(Method::kPost, path + "/edits", kLift, std::move(headers));
  };
  CHECK(edit({}).status == 428);
  CHECK(edit(if_match("r2")).status == 400);
  CHECK(edit(if_match("\"rx\"")).status == 400);
  const Answer stale = edit(if_match("\"r1\""));
  CHECK(stale.status == 412);
  CHECK(stale.body["revision"] == 2);
  const Answer made = edit(if_match("\"r2\""));
  CHECK(made.status == 201);
  CHECK(made.header("ETag") == "\"r3\"");
  CHECK(made.body["index"] == 1);
  CHECK(made.body["moved_samples"] > 0);
  const json history = test.get(path + "/edits").body;
  CHECK(history["head"] == 1);
  CHECK(history["edits"][0]["edit"]["deformation"]["type"] == "translation");
  CHECK(test.ask(Method::kPut, path + "/head", R"({"edit":0})").body["history"]["head"] == 0);
  CHECK(test.ask(Method::kPut, path + "/head", R"({"edit":9})").status == 422);
}

TEST_CASE("an edit with resampling says what became of the samples, and every answer is of them") {
  TestService test;
  const std::string path = test.open_painted();
  const std::string stretch = kLift.substr(0, kLift.size() - 1) + R"(,"resampling":{"bound":2}})";
  const Answer made = test.ask(Method::kPost, path + "/edits", stretch, if_match("*"));
  REQUIRE(made.status == 201);
  const auto inserted = made.body["inserted"].get<std::size_t>();
  CHECK(inserted > 10);
  CHECK(made.body["removed"] == 0);
  CHECK(made.body["sample_count"] == 900 + inserted);
  CHECK(made.body["edit"]["resampling"]["bound"] == 2.0);
  CHECK(made.body["edit"]["resampling"]["sweeps"] == 8);
  CHECK(test.get(path + "/edits").body["edits"][0] == made.body);
  CHECK(test.get(path).body["sample_count"] == 900 + inserted);
  CHECK(test.get("/v1/sessions").body["sessions"][0]["sample_count"] == 900 + inserted);
  const std::string bytes = test.get(path + "/samples?format=frame&attributes=ids,detail").bytes;
  const auto frame = protocol::decode_frame(std::as_bytes(std::span(bytes)));
  REQUIRE(frame.ok());
  CHECK(frame.value().header.sample_count == 900 + inserted);
  CHECK(frame.value().header.stretch_range == 2.0F);
  const std::string file = test.get(path + "/samples?format=ply").bytes;
  const auto read = read_cloud(std::as_bytes(std::span(file)), CloudFormat::kPly, {});
  REQUIRE(read.ok());
  CHECK(read.value().cloud.size() == 900 + inserted);
  std::string preview = stretch;
  preview.insert(1, R"("sequence":1,)");
  CHECK(test.ask(Method::kPost, path + "/preview", preview).status == 200);
  CHECK(test.ask(Method::kPut, path + "/preview", preview).status == 204);
  CHECK(test.ask(Method::kPut, path + "/head", R"({"edit":0})").body["sample_count"] == 900);
}

TEST_CASE("samples that there is no room for are refused with how many there are") {
  const std::string stretch = kLift.substr(0, kLift.size() - 1) + R"(,"resampling":{}})";
  for (const bool by_memory : {false, true}) {
    CAPTURE(by_memory);
    Config config;
    config.limits.history_bytes = 100'000;
    (by_memory ? config.limits.max_session_bytes : config.limits.max_session_samples) =
        by_memory ? 704'400 : 905;
    TestService test(config);
    const std::string path = test.open_painted();
    const Answer refused = test.ask(Method::kPost, path + "/edits", stretch, if_match("*"));
    CHECK(refused.status == 413);
    CHECK(refused.body["type"] == "/problems/limit-exceeded");
    REQUIRE(refused.body["errors"].size() == 1);
    CHECK(refused.body["errors"][0]["pointer"] == "/resampling/max_samples");
    CHECK(refused.body["limit"].get<double>() >= 900.0);
    CHECK(refused.body["limit"].get<double>() < refused.body["actual"].get<double>());
    CHECK(test.ask(Method::kPost, path + "/edits", kLift, if_match("*")).status == 201);
  }
}

TEST_CASE("samples come in every format, with tags that change with the revision") {
  TestService test;
  const std::string path = test.open_painted();
  const Answer before = test.get(path + "/samples?format=ply");
  CHECK(before.status == 200);
  CHECK(before.header("Content-Disposition") == "attachment; filename=\"sheet.ply\"");
  CHECK(test.get(path + "/samples?format=ply", {{"if-none-match", before.header("ETag")}}).status == 304);
  REQUIRE(test.ask(Method::kPost, path + "/edits", kLift, if_match("\"r2\"")).status == 201);
  const Answer after = test.get(path + "/samples?format=ply", {{"if-none-match", before.header("ETag")}});
  CHECK(after.status == 200);
  CHECK(after.bytes != before.bytes);
  for (const char* format : {"draco", "frame"})
    CHECK(test.get(path + "/samples?format=" + format).status == 200);
  const Answer frame =
      test.get(path + "/samples?format=frame&attributes=normal,t,ids,marks,color,detail,radius&level=0");
  const auto decoded =
      protocol::decode_frame(std::as_bytes(std::span(frame.bytes.data(), frame.bytes.size())));
  REQUIRE(decoded.ok());
  CHECK(decoded.value().header.level == 0);
  CHECK(decoded.value().header.revision == 3);
  CHECK(decoded.value().header.attributes == protocol::kAllFrameAttributes);
  for (const auto& block : decoded.value().blocks)
    for (const std::uint16_t radius : block.radius) CHECK(protocol::from_bfloat16(radius) > 0.0F);
  CHECK(test.get(path + "/samples?level=2").status == 422);
  CHECK(test.get(path + "/samples?level=x").status == 422);
  CHECK(test.get(path + "/samples?format=frame&attributes=smell").status == 422);
  CHECK(test.get(path + "/samples?attributes=smell").status == 422);
  CHECK(test.get(path + "/samples?attributes=normal").status == 200);
}

TEST_CASE("a budget grants what is left, and to who asks alone even more") {
  Budget budget(10);
  auto first = budget.hold(6);
  REQUIRE(first != nullptr);
  CHECK(budget.hold(5) == nullptr);
  CHECK(budget.hold_or_alone(5) == nullptr);
  first->shrink_to(7);
  CHECK(budget.held() == 6);
  first->shrink_to(4);
  CHECK(budget.held() == 4);
  const auto copy = first;
  first = nullptr;
  CHECK(budget.held() == 4);
  CHECK(budget.hold(11) == nullptr);
  {
    CHECK(Budget(10).hold(11) == nullptr);
    const auto beyond = Budget(10).hold_or_alone(11);  // outlives its budget
    CHECK(beyond != nullptr);
  }
  Budget small(10);
  const auto beyond = small.hold_or_alone(25);
  REQUIRE(beyond != nullptr);
  CHECK(small.held() == 25);
  CHECK(small.hold(0) == nullptr);
  CHECK(small.hold_or_alone(1) == nullptr);
}

TEST_CASE("downloads hold memory until they are sent, and wait their turn where it is taken") {
  Config config;
  config.limits.max_answer_memory = 1;  // one at a time, of any size
  TestService test(config);
  const std::string path = test.open_painted();
  const std::string cloud = "/v1/clouds/" + test.get("/v1/clouds").body["clouds"][0]["id"].get<std::string>();
  const std::string preview = R"({"sequence":1,)" + kLift.substr(1);
  const auto ask_all = [&](int status) {
    for (const std::string& target :
         {path + "/samples?format=ply", path + "/samples?format=frame", cloud + "/data?format=xyz"}) {
      const Answer answer = test.get(target);
      CHECK(answer.status == status);
      if (status == 503) CHECK_FALSE(answer.header("Retry-After").empty());
    }
    CHECK(test.ask(Method::kPost, path + "/preview", preview).status == status);
  };
  ask_all(200);
  CHECK(test.service.answer_memory.held() == 0);
  for (const char* format : {"ply", "xyz", "draco", "frame"}) {
    CAPTURE(format);
    const Response open = test.respond(Method::kGet, path + "/samples?format=" + format);
    REQUIRE(open.status == 200);
    // What is held while a slow reader takes it is what there is to take.
    CHECK(test.service.answer_memory.held() == std::get<SharedBytes>(open.body).bytes.size());
    ask_all(503);
    const auto etag = std::find_if(open.headers.begin(), open.headers.end(),
                                   [](const NameValue& header) { return header.first == "ETag"; });
    REQUIRE(etag != open.headers.end());
    CHECK(test.get(path + "/samples?format=" + format, {{"if-none-match", etag->second}}).status == 304);
  }
  CHECK(test.service.answer_memory.held() == 0);
  ask_all(200);
}

TEST_CASE("streams begin with the session and a key frame, and end with a word") {
  TestService test;
  const std::string path = test.open_painted();
  RequestHead head{.method = Method::kGet};
  head.path = path + "/stream";
  head.query = {{"attributes", "normal,t,marks"}};
  Resolution resolution = resolve(test.service, head, "id");
  auto& endpoint = std::get<Endpoint>(resolution);
  Response response =
      endpoint.handle(Request{.head = head, .id = "id", .captures = endpoint.captures, .body = {}});
  REQUIRE(response.status == 200);

  struct Collector final : BodySink {
    std::vector<std::byte> bytes;
    std::atomic<bool> stop{false};
    bool write(std::span<const std::byte> piece) override {
      bytes.insert(bytes.end(), piece.begin(), piece.end());
      return true;
    }
    bool is_peer_gone() override { return false; }
    [[nodiscard]] bool is_stopping() const override { return stop; }
  } sink;
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    sink.stop = true;
  });
  std::get<StreamBody>(response.body)(sink);
  stopper.join();
  protocol::StreamRecordParser parser;
  parser.push(sink.bytes);
  std::vector<protocol::StreamRecord> records;
  while (true) {
    auto next = parser.next();
    REQUIRE(next.ok());
    if (!next.value()) break;
    records.push_back(*next.value());
  }
  CHECK(parser.at_record_end());
  REQUIRE(records.size() >= 4);
  const auto event = [](const protocol::StreamRecord& record) {
    return json::parse(reinterpret_cast<const char*>(record.payload.data()),
                       reinterpret_cast<const char*>(record.payload.data()) + record.payload.size());
  };
  CHECK(event(records.front())["event"] == "session");
  CHECK(event(records[1])["event"] == "presence");
  CHECK(records[2].type == 1);
  const auto frame = protocol::decode_frame(records[2].payload);
  REQUIRE(frame.ok());
  CHECK(frame.value().header.kind == protocol::FrameKind::kKey);
  CHECK(event(records.back())["event"] == "end");
}

TEST_CASE("what is not known yet does not read as missing while the server starts") {
  TestService test;
  const std::string path = test.open_session();
  test.service.is_ready = false;
  for (const char* asked :
       {"/v1/sessions/AAAAAAAAAAAAAAAAAAAAAA", "/v1/clouds/AAAAAAAAAAAAAAAAAAAAAA", "/v1/info"})
    CHECK(test.get(asked).status == 503);
  CHECK(test.get(path).status == 503);
  CHECK(test.get("/healthz").status == 200);
  CHECK(test.get("/readyz").status == 503);
  test.service.is_ready = true;
  CHECK(test.get(path).status == 200);
  CHECK(test.get("/v1/sessions/AAAAAAAAAAAAAAAAAAAAAA").status == 404);
}

TEST_CASE("no more streams than the limit says") {
  Config config;
  config.limits.max_streams = 1;
  TestService test(config);
  const std::string path = test.open_session();
  RequestHead head{.method = Method::kGet};
  head.path = path + "/stream";
  {
    Resolution resolution = resolve(test.service, head, "id");
    auto& endpoint = std::get<Endpoint>(resolution);
    const Response open =
        endpoint.handle(Request{.head = head, .id = "id", .captures = endpoint.captures, .body = {}});
    CHECK(open.status == 200);
    const Answer refused = test.get(path + "/stream");
    CHECK(refused.status == 503);
    CHECK_FALSE(refused.header("Retry-After").empty());
  }
  CHECK(test.get(path + "/stream?attributes=ids").status == 422);
  CHECK(test.get(path + "/stream").status == 200);
}
