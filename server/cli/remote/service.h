#pragma once
// The interface of a Pointwright service as the command line uses it: repetitions, refusals and exit codes.

#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <string>

#include "server/cli/remote/http_client.h"

namespace pointwright::server {

/// How commands to a service end.
enum class ExitCode {
  kDone = 0,
  kUsage = 1,
  kRefused = 2,      ///< by the server: any other 4xx, and what could not be built
  kUnreachable = 3,  ///< no answer, or a 5xx
  kConflict = 4,     ///< 409, 412, 428: not in this state, or not at this revision
  kTimeout = 5,      ///< what was waited for did not happen in time
};

/// Ends a command. What there is to say has been said where the text is empty.
struct CommandFailure {
  ExitCode code = ExitCode::kRefused;
  std::string text = {};
  std::string document = {};  ///< the server's problem, where it gave one
};

/// Pauses of a repetition; tests make them short.
struct Retries {
  int count = 5;
  double first_pause_seconds = 0.5;
};

class RemoteService {
 public:
  RemoteService(const std::string& url, std::string token, std::string ca, Retries retries);

  [[nodiscard]] const HttpClient& http() const { return http_; }
  [[nodiscard]] const Retries& retries() const { return retries_; }

  /// An answer of success. Throws CommandFailure. What is_overloaded() is asked again after the server's
  /// pause, broken connections after a growing one; a POST whose answer was lost only where the server knows
  /// idempotency keys.
  [[nodiscard]] HttpAnswer ask(HttpRequest request) const;
  /// The same, with a JSON body.
  [[nodiscard]] HttpAnswer ask(const std::string& method, const std::string& path, const nlohmann::json& body,
                               const std::optional<std::string>& if_match = std::nullopt) const;
  [[nodiscard]] nlohmann::json get(const std::string& path) const;
  /// Whether /v1/info names the feature.
  [[nodiscard]] bool has_feature(const std::string& name) const;
  /// Sleeps before the next repetition; `asked` is the Retry-After, empty where there is none.
  void pause(int attempt, const std::string& asked) const;

 private:
  [[nodiscard]] bool may_repeat(const HttpRequest& request, const HttpAnswer& answer) const;

  HttpClient http_;
  Retries retries_;
};

/// Whether the same request may succeed after a pause: 503, and 429 that time lifts.
bool is_overloaded(const HttpAnswer& answer);
/// What a refusal says, for a person, and how the command ends. Of an answer of 400 or more, or of none.
CommandFailure failure_of(const HttpAnswer& answer, const HttpClient& http);
/// The document of an answer; throws CommandFailure where it is none.
nlohmann::json document_of(const HttpAnswer& answer);

}  // namespace pointwright::server
