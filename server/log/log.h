#pragma once
// The log: one JSON object a line. Never point data, never anything unescaped.

#include <memory>
#include <optional>
#include <string>

#include "protocol/json/requests.h"
#include "server/http/http_server.h"

namespace pointwright::server {

enum class LogLevel { kDebug, kInfo, kWarn, kError };

/// Thread-safe. A full disk or a slow terminal loses lines; it never blocks a request.
class Log {
 public:
  /// `level`: as in Config; `file`: empty for standard error. Throws std::runtime_error where the file cannot
  /// be opened.
  Log(const std::string& level, const std::string& file);
  ~Log();
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  /// One event ("request", "started") with its members.
  void write(LogLevel level, const std::string& event,
             protocol::JsonDocument members = protocol::JsonDocument::object());
  void request(const RequestLog& request);
  /// Opens the file of that name again: what was there may have been moved away. A sentence where that fails.
  std::optional<std::string> reopen();
  /// Waits a moment for what was written to reach the file.
  void flush();

 private:
  struct Sink;
  std::unique_ptr<Sink> sink_;
};

}  // namespace pointwright::server
