#include "server/cli/remote/service.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <sstream>
#include <thread>

#include "server/base/random_id.h"

namespace pointwright::server {
namespace {

using nlohmann::json;

constexpr double kLongestPauseSeconds = 60.0;

/// Whether the request, made a second time, may have a second effect.
bool changes_once_more(const HttpRequest& request) {
  return request.method == "POST" ||
         (request.method == "DELETE" && request.path.find("/edits/") != std::string::npos);
}

std::string text_of(const json& document, const char* member) {
  const auto found = document.find(member);
  return found != document.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// All that a problem says, one fact a line.
std::string described(const json& problem) {
  std::ostringstream text;
  const std::string detail = text_of(problem, "detail");
  text << (detail.empty() ? text_of(problem, "title") : detail);
  if (const auto errors = problem.find("errors"); errors != problem.end() && errors->is_array()) {
    for (const json& error : *errors) {
      const std::string pointer = text_of(error, "pointer");
      text << "\n  " << (pointer.empty() ? "" : pointer + ": ") << text_of(error, "detail");
    }
  }
  const auto limit = problem.find("limit");
  const auto actual = problem.find("actual");
  if (limit != problem.end()) text << "\n  limit " << limit->dump();
  if (actual != problem.end()) text << "\n  this is " << actual->dump();
  const auto revision = problem.find("revision");
  if (revision != problem.end()) text << "\n  the session is at revision " << revision->dump();
  return text.str();
}

ExitCode exit_code_of(int status) {
  if (status == 409 || status == 412 || status == 428) return ExitCode::kConflict;
  return status >= 500 ? ExitCode::kUnreachable : ExitCode::kRefused;
}

}  // namespace

bool is_overloaded(const HttpAnswer& answer) {
  if (answer.status != 429) return answer.status == 503;
  if (!answer.header("retry-after").empty()) return true;
  // Where time lifts it, the server says when to come again; proxies need not.
  const json problem = json::parse(answer.body, nullptr, false);
  return !problem.is_object() || !text_of(problem, "type").ends_with("/too-many");
}

CommandFailure failure_of(const HttpAnswer& answer, const HttpClient& http) {
  if (answer.status == 0)
    return {.code = ExitCode::kUnreachable,
            .text = std::string(http.url()).append(": ").append(answer.trouble)};
  const json problem = json::parse(answer.body, nullptr, false);
  if (problem.is_object() && problem.contains("title"))
    return {.code = exit_code_of(answer.status), .text = described(problem), .document = answer.body};
  std::ostringstream text;
  text << "the server answered " << answer.status;
  return {.code = exit_code_of(answer.status), .text = text.str()};
}

json document_of(const HttpAnswer& answer) {
  json document = json::parse(answer.body, nullptr, false);
  if (document.is_discarded())
    throw CommandFailure{.code = ExitCode::kUnreachable, .text = "the answer is not a JSON document"};
  return document;
}

RemoteService::RemoteService(const std::string& url, std::string token, std::string ca, Retries retries)
    : http_(url, std::move(token), std::move(ca)), retries_(retries) {
  if (!http_.is_valid())
    throw CommandFailure{.code = ExitCode::kUsage, .text = "--server: not http://host:port or https://…"};
}

HttpAnswer RemoteService::ask(HttpRequest request) const {
  if (changes_once_more(request)) request.headers.emplace_back("Idempotency-Key", random_id());
  for (int attempt = 0;; ++attempt) {
    HttpAnswer answer = http_.send(request);
    if (answer.status >= 200 && answer.status < 400) return answer;
    // A repetition that came while the first one was still at work is told to wait.
    const bool waits = answer.status == 409 && attempt > 0 && !answer.header("retry-after").empty();
    const bool again = answer.status == 0 ? may_repeat(request, answer) : is_overloaded(answer) || waits;
    if (!again || attempt >= retries_.count) throw failure_of(answer, http_);
    pause(attempt, answer.header("retry-after"));
  }
}

HttpAnswer RemoteService::ask(const std::string& method, const std::string& path, const json& body,
                              const std::optional<std::string>& if_match) const {
  HttpRequest request{.method = method, .path = path};
  if (!body.is_null()) {
    request.type = "application/json";
    request.body = body.dump();
  }
  if (if_match) request.headers.emplace_back("If-Match", *if_match);
  return ask(std::move(request));
}

json RemoteService::get(const std::string& path) const {
  return document_of(ask(HttpRequest{.path = path}));
}

bool RemoteService::has_feature(const std::string& name) const {
  const HttpAnswer answer = http_.send({.path = "/v1/info"});
  const json info = json::parse(answer.body, nullptr, false);
  if (answer.status != 200 || !info.is_object() || !info.contains("features")) return false;
  const json& features = info["features"];
  return std::find(features.begin(), features.end(), name) != features.end();
}

bool RemoteService::may_repeat(const HttpRequest& request, const HttpAnswer& answer) const {
  if (request.write_body || answer.is_untrusted || answer.trouble == "cancelled") return false;
  if (!answer.was_sent) return true;
  return !changes_once_more(request) || has_feature("idempotency-keys");
}

void RemoteService::pause(int attempt, const std::string& asked) const {
  double seconds = retries_.first_pause_seconds * static_cast<double>(1U << static_cast<unsigned>(attempt));
  unsigned told = 0;
  const char* end = asked.data() + asked.size();
  if (!asked.empty() && std::from_chars(asked.data(), end, told).ptr == end)
    seconds = static_cast<double>(told);
  std::this_thread::sleep_for(std::chrono::duration<double>(std::min(seconds, kLongestPauseSeconds)));
}

}  // namespace pointwright::server
