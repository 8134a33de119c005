#include "server/http/http_server.h"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <list>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <variant>

#include "server/base/request_scope.h"
#include "server/http/connection.h"
#include "server/http/exchange.h"
#include "server/http/http_library.h"
#include "server/http/problem_response.h"

namespace pointwright::server {
namespace {

/// Connections beyond the cap that are still told so politely; beyond these they are closed at once.
constexpr std::size_t kRefusalThreads = 32;
constexpr std::chrono::milliseconds kLingerPatience{1000};
constexpr int kBacklog = 1024;

/// The library's view of a connection: it reads a head that we made ourselves, never a byte of the client's,
/// and writes through our deadlines.
class FencedStream final : public httplib::Stream {
 public:
  FencedStream(Connection& connection, Exchange& exchange, std::string head)
      : connection_(connection), exchange_(exchange), head_(std::move(head)) {}
  [[nodiscard]] bool is_readable() const override { return consumed_ < head_.size(); }
  [[nodiscard]] bool is_writable() const override { return !connection_.is_broken(); }
  ssize_t read(char* data, size_t size) override {
    const std::size_t count = std::min(size, head_.size() - consumed_);
    head_.copy(data, count, consumed_);
    consumed_ += count;
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* data, size_t size) override {
    const bool done = connection_.write_all(std::string_view(data, size), exchange_.write_deadline());
    return done ? static_cast<ssize_t>(size) : -1;
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override { ip.clear(), port = 0; }
  void get_local_ip_and_port(std::string& ip, int& port) const override { ip.clear(), port = 0; }
  // The library only compares this with FD_SETSIZE, for a select() that our own poll() replaces.
  [[nodiscard]] socket_t socket() const override { return INVALID_SOCKET; }

 private:
  Connection& connection_;
  Exchange& exchange_;
  std::string head_;
  std::size_t consumed_ = 0;
};

/// The exchange that the library serves on this thread; its handler has no other way to find it.
thread_local Exchange* current_exchange = nullptr;
/// What this thread has for its connection: an answer, the word that there is no room, or the door.
enum class Treatment { kAnswer, kRefuse, kTurnAway };
thread_local Treatment treatment = Treatment::kAnswer;

/// Ends a connection without waiting for anything, on the accepting thread. A head that had come is read, so
/// that closing resets nothing and the refusal arrives; TLS has nothing to say before its handshake.
void turn_away(int socket, std::string_view refusal) {
  std::array<char, 4096> asked;
  if (!refusal.empty()) {
    (void)::recv(socket, asked.data(), asked.size(), MSG_DONTWAIT);
    (void)::send(socket, refusal.data(), refusal.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  ::close(socket);
}

/// The refusal of those for whom there is not even a thread that tells them: as an Exchange refuses, but the
/// same for all.
std::string canned_refusal(std::size_t cap) {
  const Response response = problem_response({.kind = ProblemKind::kOverloaded,
                                              .detail = "all connections are in use",
                                              .limit = static_cast<double>(cap)},
                                             "", "");
  const std::string& body = std::get<std::string>(response.body);
  std::string text = "HTTP/1.1 " + std::to_string(response.status) + " Service Unavailable\r\nContent-Type: ";
  text.append(response.content_type).append("\r\n");
  for (const auto& [name, value] : response.headers)
    text.append(name).append(": ").append(value).append("\r\n");
  text.append("Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n");
  return text.append("Content-Length: ").append(std::to_string(body.size())).append("\r\n\r\n").append(body);
}

/// Runs each connection on its own thread, under the cap.
class ConnectionThreads final : public httplib::TaskQueue {
 public:
  ConnectionThreads(std::size_t cap, std::atomic<std::size_t>& active) : cap_(cap), active_(active) {}
  ConnectionThreads(const ConnectionThreads&) = delete;
  ConnectionThreads& operator=(const ConnectionThreads&) = delete;
  ~ConnectionThreads() override { shutdown(); }

  void enqueue(std::function<void()> serve) override {
    const std::size_t running = active_.fetch_add(1);
    const Treatment mode = running >= cap_ ? Treatment::kRefuse : Treatment::kAnswer;
    if (running < cap_ + kRefusalThreads) {
      try {
        std::thread([this, serve, mode] {
          treatment = mode;
          serve();
          finish();
        }).detach();
        return;
      } catch (const std::system_error&) {
        // No thread to be had.
      }
    }
    // On the thread that accepts: nobody is waited for.
    treatment = Treatment::kTurnAway;
    serve();
    treatment = Treatment::kAnswer;
    finish();
  }

  void shutdown() override {
    std::unique_lock lock(mutex_);
    all_done_.wait(lock, [this] { return active_.load() == 0; });
  }

 private:
  void finish() {
    // Under the lock to the end: once it is free, shutdown() may return and this object may be gone.
    const std::lock_guard lock(mutex_);
    active_.fetch_sub(1);
    all_done_.notify_all();
  }

  std::size_t cap_;
  std::atomic<std::size_t>& active_;
  std::mutex mutex_;  // guards the end of active_
  std::condition_variable all_done_;
};

/// Writes the chunks of a streamed body past the library, which would copy them twice; it has written the
/// head before, keeps nothing back, and writes the closing chunk.
class ChunkSink final : public BodySink {
 public:
  explicit ChunkSink(Exchange& exchange) : exchange_(exchange) {}
  bool write(std::span<const std::byte> bytes) override {
    return bytes.empty() || exchange_.write_chunk(bytes);
  }
  [[nodiscard]] bool is_peer_gone() override { return exchange_.is_reader_gone(); }
  [[nodiscard]] bool is_stopping() const override { return exchange_.is_stopping(); }

 private:
  Exchange& exchange_;
};

/// Hands our response to the library. Bodies of known length go through a provider: the library compresses
/// plain content at its slowest level, and copies it.
void fill(httplib::Response& out, Response response, Exchange& exchange) {
  out.status = response.status;
  for (const NameValue& header : response.headers) out.set_header(header.first, header.second);
  const auto provide = [&](std::span<const std::byte> bytes, std::shared_ptr<const void> owner) {
    exchange.begin_answer(bytes.size());
    if (bytes.empty()) return;
    out.set_content_provider(
        bytes.size(), response.content_type,
        [bytes, owner = std::move(owner)](size_t offset, size_t length, httplib::DataSink& sink) {
          const std::size_t count = std::min<std::size_t>(length, 1U << 20U);
          return sink.write(reinterpret_cast<const char*>(bytes.data()) + offset, count);
        });
  };
  if (auto* text = std::get_if<std::string>(&response.body)) {
    const auto owner = std::make_shared<const std::string>(std::move(*text));
    provide(std::as_bytes(std::span(owner->data(), owner->size())), owner);
  } else if (auto* shared = std::get_if<SharedBytes>(&response.body)) {
    provide(shared->bytes, shared->owner);
  } else if (auto* stream = std::get_if<StreamBody>(&response.body)) {
    exchange.begin_stream_write();
    out.set_chunked_content_provider(response.content_type,
                                     [body = std::move(*stream), &exchange](size_t, httplib::DataSink& sink) {
                                       // An exception that left a provider would end the process. What
                                       // it cuts off must not look whole: the connection breaks.
                                       bool is_whole = false;
                                       try {
                                         const RequestScope scope(exchange.request_id());
                                         ChunkSink target(exchange);
                                         body(target);
                                         is_whole = true;
                                       } catch (const std::exception& error) {
                                         exchange.note_failure(error.what());
                                       } catch (...) {
                                         exchange.note_failure("an unknown exception");
                                       }
                                       exchange.begin_stream_write();
                                       is_whole = is_whole && !exchange.is_broken();
                                       if (is_whole) sink.done();
                                       return is_whole;
                                     });
  } else {
    exchange.begin_answer(0);
  }
}

}  // namespace

class HttpServer::Fence final : public httplib::Server {
 public:
  Fence(HttpOptions options, Resolver resolver, std::function<void(const RequestLog&)> log)
      : context_{.options = std::move(options), .resolver = std::move(resolver), .log = std::move(log)} {
    if (context_.options.tls == nullptr) refusal_ = canned_refusal(context_.options.max_connections);
    new_task_queue = [this] { return new ConnectionThreads(context_.options.max_connections, active_); };
    set_socket_options([](socket_t socket) {
      // Not SO_REUSEPORT, the library's default: a second daemon would silently share the port.
      const int on = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    });
    set_pre_routing_handler([](const httplib::Request&, httplib::Response& response) {
      fill(response, current_exchange->answer(), *current_exchange);
      return HandlerResponse::Handled;
    });
    // Never the library's own, which sends the exception's text as a header.
    set_exception_handler([](const httplib::Request&, httplib::Response& response,
                             const std::exception_ptr&) { response.status = 500; });
  }

  std::optional<std::string> start() {
    const HttpOptions& options = context_.options;
    if (options.port == 0) {
      const int port = bind_to_any_port(options.host);
      if (port <= 0) return "cannot bind to a free port of " + options.host;
      port_ = static_cast<std::uint16_t>(port);
    } else {
      if (!bind_to_port(options.host, options.port))
        return "cannot bind to " + options.host + ":" + std::to_string(options.port) +
               "; is the port in use?";
      port_ = options.port;
    }
    // The library listens with a backlog of 5, at which simultaneous connects wait for a second.
    if (::listen(svr_sock_, kBacklog) != 0) return "cannot listen on " + options.host;
    ::fcntl(svr_sock_, F_SETFD, FD_CLOEXEC);
    return std::nullopt;
  }

  bool drain_and_stop(std::chrono::milliseconds deadline) {
    // The library cuts running answers off once its socket is closed, so they end first.
    context_.stopping = true;
    const Clock::time_point until = Clock::now() + deadline;
    while (active_.load() > 0 && Clock::now() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    const bool drained = active_.load() == 0;
    if (run_called_) {
      while (!is_running() && !run_ended_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      stop();
    }
    return drained;
  }

  bool accept_until_stopped() {
    run_called_ = true;
    if (!context_.stopping) listen_after_bind();
    // In either case: who stops the server at this moment waits for it.
    run_ended_ = true;
    return context_.stopping;
  }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::size_t active() const { return active_.load(); }

 private:
  bool process_and_close_socket(socket_t socket) override {
    if (treatment == Treatment::kTurnAway) {
      turn_away(socket, refusal_);
      return true;
    }
    try {
      Connection connection(socket, context_.options.tls.get());
      serve(connection);
      connection.linger(treatment == Treatment::kRefuse ? std::chrono::milliseconds(100) : kLingerPatience);
    } catch (...) {
      // Out of memory while reading a head, say: this connection ends, the daemon does not.
    }
    return true;
  }

  void serve(Connection& connection) {
    Exchange exchange(context_, connection, treatment == Treatment::kRefuse);
    if (!exchange.read_head()) return;
    // Only the method matters to the library: whether it may send a body.
    FencedStream stream(connection, exchange,
                        std::string(exchange.is_head_request() ? "HEAD" : "GET") +
                            " / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    current_exchange = &exchange;
    bool closed = false;
    try {
      process_request(stream, true, closed, nullptr);
    } catch (const std::exception& error) {
      exchange.note_failure(error.what());
    }
    current_exchange = nullptr;
    exchange.finish();
  }

  ExchangeContext context_;
  std::string refusal_;  // empty under TLS
  std::atomic<std::size_t> active_{0};
  std::atomic<bool> run_called_{false};
  std::atomic<bool> run_ended_{false};
  std::uint16_t port_ = 0;
};

HttpServer::HttpServer(HttpOptions options, Resolver resolver, std::function<void(const RequestLog&)> log)
    : fence_(std::make_unique<Fence>(std::move(options), std::move(resolver), std::move(log))) {}
HttpServer::~HttpServer() = default;

std::optional<std::string> HttpServer::start() {
  return fence_->start();
}
std::uint16_t HttpServer::port() const {
  return fence_->port();
}
bool HttpServer::run() {
  return fence_->accept_until_stopped();
}
bool HttpServer::stop(std::chrono::milliseconds deadline) {
  return fence_->drain_and_stop(deadline);
}
std::size_t HttpServer::active_connections() const {
  return fence_->active();
}

}  // namespace pointwright::server
