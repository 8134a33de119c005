#pragma once
// Requests and responses as the rest of the server sees them. Nothing here knows the HTTP library.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "server/base/budget.h"
#include "server/base/caller.h"
#include "server/base/outcome.h"

namespace pointwright::server {

enum class Method { kGet, kHead, kPost, kPut, kPatch, kDelete, kOptions };

std::string_view method_name(Method method);
/// Whether the method asks for a change of state (and therefore owes a matching Origin).
bool changes_state(Method method);

using NameValue = std::pair<std::string, std::string>;

/// The head of a request, strictly parsed: what is not plainly right never gets here.
struct RequestHead {
  Method method = Method::kGet;
  std::string path;                ///< percent-decoded, without NUL or control characters
  std::vector<NameValue> query;    ///< decoded, in order
  std::vector<NameValue> headers;  ///< names in lower case, values trimmed; hostile bytes: never echo them
  std::optional<std::uint64_t> content_length;
  std::string peer;  ///< the address that the connection came from, without a port

  /// The value of a header (name in lower case); the first one where it is repeated.
  [[nodiscard]] std::optional<std::string_view> header(std::string_view name) const;
  /// The media type of the body in lower case, without its parameters; empty where none is given.
  [[nodiscard]] std::string media_type() const;
};

/// Where a body goes piece by piece instead of into memory. Used by the connection's thread alone. Where the
/// body ends early it is destroyed without its handler having been called.
class BodyTarget {
 public:
  virtual ~BodyTarget() = default;
  /// False: the rest of the body cannot be taken; problem() says why.
  virtual bool write(std::span<const std::byte> bytes) = 0;
  [[nodiscard]] virtual protocol::Problem problem() const = 0;
};
struct KeyedRequest;

struct Request {
  RequestHead head;
  std::string id;                     ///< X-Request-Id: the client's where it is well-formed, else a new one
  std::vector<std::string> captures;  ///< what the placeholders of the route matched
  mutable std::string body;  ///< a handler that goes on after its answer takes it, and the memory with it
  mutable std::vector<std::shared_ptr<void>> body_memory = {};  ///< what the body is held from
  std::shared_ptr<BodyTarget> target = nullptr;                 ///< where it went, for routes that have one
  Caller caller = {};
  mutable std::shared_ptr<KeyedRequest> keyed = nullptr;  ///< where it has an Idempotency-Key

  [[nodiscard]] std::span<const std::byte> body_bytes() const {
    return std::as_bytes(std::span(body.data(), body.size()));
  }
};

/// Where a streamed body goes. write() blocks until the bytes are with the kernel, at most as long as the
/// deadline that the fence gives a record; false means that the peer is gone or too slow, and the body must
/// return.
class BodySink {
 public:
  virtual ~BodySink() = default;
  virtual bool write(std::span<const std::byte> bytes) = 0;
  [[nodiscard]] virtual bool is_peer_gone() = 0;
  /// Whether the server wants to stop: the body should write its closing record and return.
  [[nodiscard]] virtual bool is_stopping() const = 0;
};

/// Bytes that several answers may share; `owner` keeps them alive.
struct SharedBytes {
  std::shared_ptr<const void> owner;
  std::span<const std::byte> bytes;
};
/// Runs on the connection's thread until the body is complete.
using StreamBody = std::function<void(BodySink&)>;

struct Response {
  int status = 200;
  std::string content_type = {};
  std::vector<NameValue> headers = {};
  std::variant<std::monostate, std::string, SharedBytes, StreamBody> body = {};
  /// Server-Timing entries: name and milliseconds.
  std::vector<std::pair<std::string, double>> timings = {};

  Response& with_header(std::string name, std::string value);
};

/// A request that is answered once, however often it comes.
struct KeyedRequest {
  std::string caller;
  std::string key;
  std::string fingerprint;
  std::optional<Response> answer = std::nullopt;  ///< once it was kept with the change
  bool is_passing = false;                        ///< the effect ends with the process: so must the answer
};

/// What the body of a route may be.
struct BodyPolicy {
  enum class Kind { kNone, kJson, kLargeJson, kCloud, kImage, kUpload };
  Kind kind = Kind::kNone;
  std::uint64_t max_bytes = 0;
  std::uint64_t max_json_bytes = 0;  ///< kCloud: of a document that names an upload
};

/// The outcome of looking a request up: either its answer at once, or what handles it and which body it
/// takes.
struct Endpoint {
  BodyPolicy body;
  std::string route;  ///< the pattern, for logs
  std::vector<std::string> captures;
  std::function<Response(const Request&)> handle;
  /// What the bytes of the body are held from as they arrive, until the request is answered; null: nothing.
  Budget* body_memory = nullptr;
  /// Makes what takes the body, before it is read; null: it is held in memory.
  std::function<Outcome<std::shared_ptr<BodyTarget>>(const Request&)> open_target = {};
  /// What the body costs the caller, once nothing in the head speaks against reading it; null: nothing.
  std::function<Outcome<Done>()> charge = {};
  Caller caller = {};  ///< who asks
};
using Resolution = std::variant<Response, Endpoint>;

}  // namespace pointwright::server
