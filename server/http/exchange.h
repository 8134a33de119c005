#pragma once
// One request and its answer on one connection: the order of checks, from the first byte to the log line.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "server/http/connection.h"
#include "server/http/http_server.h"
#include "server/http/message.h"

namespace pointwright::server {

/// What all exchanges of a server share.
struct ExchangeContext {
  HttpOptions options;
  Resolver resolver;
  std::function<void(const RequestLog&)> log;
  std::atomic<bool> stopping{false};
};

/// Used by the connection's thread alone.
class Exchange {
 public:
  /// `refuse`: there is no room; whatever is asked is answered 503.
  Exchange(const ExchangeContext& context, Connection& connection, bool refuse);

  /// Reads and parses the head. False: nobody asked anything (closed before a request); nothing is to be
  /// answered.
  bool read_head();
  [[nodiscard]] bool is_head_request() const;

  /// The answer to the request, with the headers that every answer carries: refusals of the head, then the
  /// route, the body, and the handler. Never throws.
  Response answer();

  /// Deadlines of what is written next.
  void begin_answer(std::uint64_t bytes);
  void begin_stream_write();
  /// One chunk of a streamed body, uncopied. False: the peer is gone or too slow. Pre: not empty.
  bool write_chunk(std::span<const std::byte> bytes);
  [[nodiscard]] Clock::time_point write_deadline() const { return write_deadline_; }

  [[nodiscard]] bool is_broken() const { return connection_.is_broken(); }
  /// Whether the reader of a streamed answer is gone.
  [[nodiscard]] bool is_reader_gone() { return connection_.is_reader_gone(); }
  [[nodiscard]] bool is_stopping() const { return context_.stopping; }

  [[nodiscard]] const std::string& request_id() const { return request_id_; }
  void note_failure(std::string text) { log_.failure = std::move(text); }
  /// Writes the log line.
  void finish();

 private:
  Response dispatch();
  Response refuse(const Problem& problem);
  std::optional<Problem> check_body(const BodyPolicy& policy) const;
  std::optional<Problem> read_body(const Endpoint& endpoint, Request& request);

  const ExchangeContext& context_;
  Connection& connection_;
  bool refuse_;
  Clock::time_point begin_;
  Clock::time_point write_deadline_;
  std::variant<RequestHead, Problem> head_;
  std::string request_id_;
  RequestLog log_;
};

}  // namespace pointwright::server
