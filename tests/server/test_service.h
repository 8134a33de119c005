#pragma once
// A service without sockets: a request goes in, a response comes out.

#include <doctest/doctest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "engine/io/cloud_io.h"
#include "engine/io/decoded_cloud.h"
#include "server/handlers/service.h"
#include "server/ingest/png_reader.h"
#include "server/routes/routes.h"
#include "tests/server/stand_in_resampler.h"
#include "tests/server/synthetic.h"
#include "tests/server/temporary_folder.h"

namespace pointwright::test {

using namespace server;
using nlohmann::json;

inline const std::string kSphere =
    R"({"mode":"add","shape":{"type":"sphere","center":[0,0.5,0],"radius":0.3}})";
inline const std::string kBox = R"({"mode":"add","shape":{"type":"box","min":[0.8,-1,-1],"max":[2,2,1]}})";
inline const std::string kLift = R"({"level":0,"deformation":{"type":"translation","vector":[0,0,0.5]}})";

struct Answer {
  int status = 0;
  json body;
  std::string bytes;
  std::vector<NameValue> headers;
  std::string content_type;
  [[nodiscard]] std::string header(const std::string& name) const {
    for (const NameValue& entry : headers)
      if (entry.first == name) return entry.second;
    return {};
  }
};

/// With a folder that outlives the service.
inline Config lasting(const TemporaryFolder& folder) {
  Config config;
  config.data = folder / "data";
  return config;
}

/// A service whose decoder runs in this process.
struct TestService {
  explicit TestService(Config config = {}, Resampler resample = double_every_tenth,
                       HierarchyBuilder build = build_hierarchy)
      : service(
            std::move(config),
            {.decode = [](std::span<const std::byte> bytes, CloudFormat format, const ImportParams& params,
                          const ExecutionContext*) { return decode_cloud(bytes, format, params); },
             .decode_image = [](std::span<const std::byte> bytes) { return read_png(bytes, {}); },
             .build = std::move(build),
             .resample = std::move(resample),
             .assets = {}}) {
    notes = service.recover();
  }

  Answer ask(Method method, const std::string& target, const std::string& body = "",
             std::vector<NameValue> headers = {}) {
    return read(respond(method, target, body, std::move(headers)));
  }
  Response respond(Method method, const std::string& target, const std::string& body = "",
                   std::vector<NameValue> headers = {}) {
    RequestHead head{.method = method};
    const std::size_t mark = target.find('?');
    head.path = target.substr(0, mark);
    if (mark != std::string::npos) {
      std::string query = target.substr(mark + 1);
      while (!query.empty()) {
        const std::size_t end = std::min(query.find('&'), query.size());
        const std::string pair = query.substr(0, end);
        query.erase(0, end + 1);
        const std::size_t equals = std::min(pair.find('='), pair.size());
        head.query.emplace_back(pair.substr(0, equals), equals < pair.size() ? pair.substr(equals + 1) : "");
      }
    }
    head.headers = std::move(headers);
    head.headers.emplace_back("content-length", std::to_string(body.size()));
    head.content_length = body.size();
    Resolution resolution = resolve(service, head, "test-request");
    if (auto* endpoint = std::get_if<Endpoint>(&resolution)) {
      Request request{.head = head,
                      .id = "test-request",
                      .captures = endpoint->captures,
                      .body = body,
                      .caller = endpoint->caller};
      if (endpoint->open_target) {
        auto opened = endpoint->open_target(request);
        if (!opened.ok()) return problem_response(opened.problem(), request);
        request.target = opened.value();
        request.body.clear();
        if (!request.target->write(std::as_bytes(std::span(body.data(), body.size()))))
          return problem_response(request.target->problem(), request);
      }
      return endpoint->handle(request);
    }
    return std::move(std::get<Response>(resolution));
  }
  Answer get(const std::string& target, std::vector<NameValue> headers = {}) {
    return ask(Method::kGet, target, "", std::move(headers));
  }

  std::string upload(std::size_t side = 30) {
    const auto file = write_cloud(wavy_sheet(side), CloudFormat::kPly, {});
    REQUIRE(file.ok());
    const Answer answer =
        ask(Method::kPost, "/v1/clouds?name=sheet",
            std::string(reinterpret_cast<const char*>(file.value().data()), file.value().size()),
            {{"content-type", "application/octet-stream"}});
    REQUIRE(answer.status == 201);
    return answer.body["id"];
  }
  /// The path of a session that is ready, on a cloud of its own.
  std::string open_session() {
    const std::string cloud = upload();
    const Answer made = ask(Method::kPost, "/v1/sessions", R"({"cloud":")" + cloud + R"(","scales":[0.05]})");
    REQUIRE(made.status == 202);
    const std::string path = made.header("Location");
    for (int i = 0; i < 5000 && get(path).body["state"] == "building"; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    REQUIRE(get(path).body["state"] == "ready");
    return path;
  }
  /// As if idle sessions were long forgotten, until so many are gone. Who has just built or used one lets go
  /// of it in a moment.
  std::size_t expire_idle(std::size_t count) {
    std::size_t gone = 0;
    for (int i = 0; i < 2500 && gone < count; ++i) {
      if (i > 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
      gone += service.sessions.expire(std::chrono::system_clock::now() + std::chrono::hours(1));
    }
    return gone;
  }
  std::string open_painted() {
    const std::string path = open_session();
    REQUIRE(ask(Method::kPost, path + "/regions/zero/operations", kSphere).status == 200);
    REQUIRE(ask(Method::kPost, path + "/regions/one/operations", kBox).status == 200);
    return path;
  }

  Service service;
  std::vector<std::string> notes;  ///< what it found

 private:
  static Answer read(Response response) {
    Answer answer{
        .status = response.status, .headers = response.headers, .content_type = response.content_type};
    if (auto* text = std::get_if<std::string>(&response.body)) answer.bytes = std::move(*text);
    if (auto* shared = std::get_if<SharedBytes>(&response.body))
      answer.bytes.assign(reinterpret_cast<const char*>(shared->bytes.data()), shared->bytes.size());
    if (answer.content_type.find("json") != std::string::npos) answer.body = json::parse(answer.bytes);
    return answer;
  }
};

inline std::vector<NameValue> if_match(const std::string& tag) {
  return {{"if-match", tag}};
}

}  // namespace pointwright::test
