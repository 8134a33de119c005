#pragma once
// The HTTP listener: the fence around the library. One request per connection, one thread per connection
// under a hard cap, budgets and deadlines for every byte, and every answer with the same security headers.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/head.h"
#include "server/http/message.h"

namespace pointwright::server {

class TlsIdentity;

struct HttpOptions {
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;  ///< 0: any free one
  std::vector<std::string> allowed_hosts;
  std::vector<std::string> cors_origins;  ///< whose pages may ask and read the answers
  HeadLimits head;
  std::chrono::milliseconds head_deadline{5000};
  std::chrono::milliseconds body_grace{10'000};  ///< a body may pause this long, and then owes the least rate
  std::uint64_t least_body_rate = 64 * 1024;     ///< bytes a second
  /// An answer may take this long, plus its length at the least rate.
  std::chrono::milliseconds write_grace{20'000};
  std::uint64_t least_write_rate = 64 * 1024;
  std::chrono::milliseconds stream_write_deadline{20'000};  ///< for each write of a streamed body
  std::size_t max_connections = 1024;
  std::shared_ptr<const TlsIdentity> tls;  ///< null: without TLS
};

/// One finished request, for the log.
struct RequestLog {
  std::string request_id, method, path, route;
  int status = 0;
  double duration_ms = 0.0;
  std::uint64_t request_bytes = 0;
  std::uint64_t response_bytes = 0;                     ///< of the body
  bool is_stream = false;                               ///< it ended when its reader left, or the server did
  std::vector<std::pair<std::string, double>> timings;  ///< as Server-Timing tells them, in milliseconds
  std::string token;                                    ///< the id of the caller's
  std::string failure;  ///< the text of an exception that escaped a handler; never sent to the client
};

/// Looks a request up; called on the connection's thread, before the body is read.
using Resolver = std::function<Resolution(const RequestHead&, const std::string& request_id)>;

/// Thread-safe: stop(), port(), active_connections(). start() once, then run() on one thread.
class HttpServer {
 public:
  HttpServer(HttpOptions options, Resolver resolver, std::function<void(const RequestLog&)> log);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Binds and listens. Returns a sentence where that fails ("the port is in use").
  std::optional<std::string> start();
  [[nodiscard]] std::uint16_t port() const;

  /// Accepts connections until stop(). False: accepting ended by itself.
  bool run();

  /// New requests are answered 503, streams are told to end, running requests get until the deadline; then
  /// the listener closes and run() returns. Blocks until then; true if every request ended in time.
  bool stop(std::chrono::milliseconds deadline);

  [[nodiscard]] std::size_t active_connections() const;

 private:
  class Fence;
  std::unique_ptr<Fence> fence_;
};

}  // namespace pointwright::server
