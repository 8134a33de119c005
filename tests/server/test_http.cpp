// The fence on an ephemeral loopback port: what a hostile or a slow client gets.

#include <doctest/doctest.h>

#include <atomic>
#include <fstream>
#include <memory>
#include <thread>

#include "server/http/http_server.h"
#include "tests/server/raw_client.h"

using namespace pointwright::server;
using pointwright::test::body_of;
using pointwright::test::exchange;
using pointwright::test::RawClient;
using pointwright::test::status_of;

namespace {

/// A server with three routes: /echo answers with the body, /throw fails, /stream ticks until its client is
/// gone.
class TestServer {
 public:
  explicit TestServer(HttpOptions options = {}, std::uint64_t max_body = 1000)
      : server_(
            std::move(options),
            [this, max_body](const RequestHead& head, const std::string&) { return resolve(head, max_body); },
            [this](const RequestLog& log) {
              const std::lock_guard lock(mutex_);
              logs_.push_back(log);
            }) {
    REQUIRE_FALSE(server_.start().has_value());
    thread_ = std::thread([this] { server_.run(); });
  }
  ~TestServer() {
    server_.stop(std::chrono::milliseconds(3000));
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }
  HttpServer& server() { return server_; }
  [[nodiscard]] std::vector<RequestLog> logs() {
    const std::lock_guard lock(mutex_);
    return logs_;
  }
  std::atomic<int> calls{0};
  std::atomic<int> open_streams{0};

 private:
  Resolution resolve(const RequestHead& head, std::uint64_t max_body) {
    const auto kind = changes_state(head.method) && head.method != Method::kDelete ? BodyPolicy::Kind::kJson
                                                                                   : BodyPolicy::Kind::kNone;
    return Endpoint{.body = {.kind = kind, .max_bytes = max_body},
                    .route = head.path,
                    .captures = {},
                    .handle = [this](const Request& request) { return handle(request); }};
  }
  Response handle(const Request& request) {
    ++calls;
    if (request.head.path == "/throw") throw std::runtime_error("secret path /srv/token");
    if (request.head.path == "/large")
      return {.content_type = "application/json; charset=utf-8", .body = std::string(3'000'000, 'x')};
    if (request.head.path == "/throwing-stream")
      return {.content_type = "application/octet-stream", .body = StreamBody([](BodySink& sink) {
                                                            sink.write(std::as_bytes(std::span("begin", 5)));
                                                            throw std::runtime_error("broken stream");
                                                          })};
    if (request.head.path == "/stream")
      return {.content_type = "application/octet-stream",
              .body = StreamBody([this](BodySink& sink) {
                ++open_streams;
                while (!sink.is_peer_gone() && !sink.is_stopping()) {
                  if (!sink.write(std::as_bytes(std::span("tick", 4)))) break;
                  std::this_thread::sleep_for(std::chrono::milliseconds(5));
                }
                if (sink.is_stopping()) sink.write(std::as_bytes(std::span("end!", 4)));
                --open_streams;
              })};
    if (request.head.path == "/flood")
      return {.content_type = "application/octet-stream", .body = StreamBody([this](BodySink& sink) {
                                                            ++open_streams;
                                                            const std::vector<std::byte> piece(1 << 20);
                                                            while (sink.write(piece)) {
                                                            }
                                                            --open_streams;
                                                          })};
    return {.content_type = "application/json; charset=utf-8",
            .body = request.body.empty() ? "{\"path\":\"" + request.head.path + "\"}" : request.body};
  }

  HttpServer server_;
  std::thread thread_;
  std::mutex mutex_;
  std::vector<RequestLog> logs_;
};

std::string get(const std::string& path, const std::string& headers = "") {
  return "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}
std::string post(const std::string& path, const std::string& body, const std::string& headers = "") {
  return "POST " + path +
         " HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\n" + headers + "\r\n" + body;
}

std::size_t resident_kilobytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmRSS:", 0) == 0) return std::stoul(line.substr(6));
  return 0;
}

template <typename Condition>
bool comes_true(Condition condition, std::chrono::milliseconds patience = std::chrono::milliseconds(8000)) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

}  // namespace

TEST_CASE("a request is answered with its body and the headers that every answer carries") {
  TestServer server;
  const std::string answer = exchange(server.port(), post("/echo", "{\"a\":1}"));
  CHECK(status_of(answer) == 200);
  CHECK(body_of(answer) == "{\"a\":1}");
  for (const char* header : {"Content-Security-Policy: default-src 'none'", "X-Content-Type-Options: nosniff",
                             "Referrer-Policy: no-referrer", "Cross-Origin-Resource-Policy: same-origin",
                             "Cross-Origin-Opener-Policy: same-origin", "Cache-Control: no-store",
                             "Connection: close", "X-Request-Id: ", "Server-Timing: handle;dur="})
    CHECK_MESSAGE(answer.find(header) != std::string::npos, header);
  CHECK(answer.find("Content-Encoding") == std::string::npos);
  CHECK(answer.find("Access-Control") == std::string::npos);
}

TEST_CASE("a well-formed request id comes back, a hostile one is replaced") {
  TestServer server;
  CHECK(exchange(server.port(), get("/", "X-Request-Id: my-id.42\r\n")).find("X-Request-Id: my-id.42\r\n") !=
        std::string::npos);
  const std::string answer = exchange(server.port(), get("/", "X-Request-Id: a%0d%0aInjected: yes\r\n"));
  CHECK(answer.find("Injected") == std::string::npos);
  CHECK(answer.find("X-Request-Id: ") != std::string::npos);
}

TEST_CASE("large answers arrive whole and uncompressed") {
  TestServer server;
  const std::string answer = exchange(server.port(), get("/large", "Accept-Encoding: gzip, br\r\n"));
  CHECK(status_of(answer) == 200);
  CHECK(body_of(answer).size() == 3'000'000);
}

TEST_CASE("a HEAD request gets the headers alone") {
  TestServer server;
  const std::string answer = exchange(server.port(), "HEAD /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  CHECK(status_of(answer) == 200);
  CHECK(answer.find("Content-Length: 3000000\r\n") != std::string::npos);
  CHECK(body_of(answer).empty());
}

TEST_CASE("a request hidden in an unread body is never served") {
  TestServer server;
  const std::string hidden =
      "POST /hidden HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
      "Content-Length: 2\r\n\r\n{}";
  for (const std::string& first :
       {get("/a") + hidden, get("/a", "Content-Length: " + std::to_string(hidden.size()) + "\r\n") + hidden,
        "OPTIONS / HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + std::to_string(hidden.size()) +
            "\r\n\r\n" + hidden,
        get("/a", "Host: evil\r\n") + std::string(4096, '\n') + hidden,
        post("/a", "{}", "Origin: null\r\n") + std::string(4096, 'x') + hidden, post("/a", "{}") + hidden}) {
    const std::string answer = exchange(server.port(), first);
    CHECK(status_of(answer) != 0);
    CHECK(answer.find("HTTP/1.1", 8) == std::string::npos);  // one answer, then the end
  }
  for (const RequestLog& log : server.logs()) CHECK(log.path != "/hidden");
}

TEST_CASE("bodies without a plain length are refused before they are read") {
  TestServer server;
  const auto status = [&](const std::string& headers, const std::string& body) {
    return status_of(exchange(server.port(),
                              "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n" +
                                  headers + "\r\n" + body));
  };
  CHECK(status("", "") == 411);
  CHECK(status("Transfer-Encoding: chunked\r\n", "5\r\nhello\r\n0\r\n\r\n") == 411);
  CHECK(status("Transfer-Encoding: chunked\r\nContent-Length: 5\r\n", "hello") == 400);
  CHECK(status("Content-Length: 2\r\nContent-Length: 2\r\n", "{}") == 400);
  CHECK(status("Content-Length: +2\r\n", "{}") == 400);
  CHECK(status("Content-Length: abc\r\n", "{}") == 400);
  CHECK(status("Content-Length: 2, 2\r\n", "{}") == 400);
  CHECK(status("Content-Length: 2\r\nContent-Encoding: gzip\r\n", "{}") == 415);
  CHECK(server.calls == 0);
}

TEST_CASE("the media type is checked before the body is read") {
  TestServer server;
  const auto status = [&](const std::string& type) {
    return status_of(exchange(
        server.port(), "POST /echo HTTP/1.1\r\nHost: localhost\r\n" + type + "Content-Length: 2\r\n\r\n{}"));
  };
  CHECK(status("Content-Type: application/json\r\n") == 200);
  CHECK(status("") == 415);
  CHECK(status("Content-Type: multipart/form-data; boundary=x\r\n") == 415);
  CHECK(status("Content-Type: application/x-www-form-urlencoded\r\n") == 415);
}

TEST_CASE("a body over the limit is refused from its head, without being read") {
  TestServer server;
  const auto begin = std::chrono::steady_clock::now();
  RawClient client(server.port());
  client.send(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: "
      "5000000000\r\n\r\n");
  const std::string answer = client.receive_all();
  CHECK(status_of(answer) == 413);
  CHECK(body_of(answer).find("\"limit\":1000") != std::string::npos);
  CHECK(body_of(answer).find("\"actual\":5000000000") != std::string::npos);
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(3));
}

TEST_CASE("a client that goes on sending a refused body still gets the answer") {
  TestServer server;
  RawClient client(server.port());
  client.send(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: "
      "100000000\r\n\r\n");
  client.send(std::string(100'000, 'x'));
  CHECK(status_of(client.receive_all()) == 413);
}

TEST_CASE("a client that waits for 100-continue gets it, unless its body is refused") {
  TestServer server;
  RawClient client(server.port());
  client.send(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 2\r\n"
      "Expect: 100-continue\r\n\r\n");
  std::string answer;
  REQUIRE(client.receive_some(answer, std::chrono::seconds(5)));
  CHECK(answer == "HTTP/1.1 100 Continue\r\n\r\n");
  client.send("{}");
  CHECK(status_of(client.receive_all()) == 200);
}

TEST_CASE("foreign hosts and origins change nothing") {
  TestServer server;
  for (const char* host : {"evil.example", "localhost.evil.example", "10.0.0.1:7878", "[::2]"})
    CHECK(status_of(exchange(server.port(), "GET / HTTP/1.1\r\nHost: " + std::string(host) + "\r\n\r\n")) ==
          403);
  for (const char* origin : {"http://evil.example", "null", "https://localhost:1"})
    CHECK(status_of(exchange(server.port(),
                             post("/echo", "{}", "Origin: " + std::string(origin) + "\r\n"))) == 403);
  CHECK(server.calls == 0);
}

TEST_CASE("heads that are too long, too many or never end are cut off") {
  TestServer server;
  CHECK(status_of(exchange(server.port(), get("/", "X: " + std::string(40'000, 'a') + "\r\n"))) == 431);
  std::string many;
  for (int i = 0; i < 80; ++i) many += "X-" + std::to_string(i) + ": 1\r\n";
  CHECK(status_of(exchange(server.port(), get("/", many))) == 431);
  CHECK(status_of(exchange(server.port(), get("/", "Range: bytes=0-1,2-3\r\n"))) == 416);

  const std::size_t before = resident_kilobytes();
  RawClient endless(server.port());
  endless.send("GET / HTTP/1.1\r\nX: ");
  for (int i = 0; i < 300 && endless.send(std::string(100'000, 'a')); ++i) {
  }
  CHECK(resident_kilobytes() < before + 16'000);
}

TEST_CASE("clients that drip their head are ended at the deadline and disturb nobody") {
  HttpOptions options;
  options.head_deadline = std::chrono::milliseconds(400);
  TestServer server(options);
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 100; ++i) {
    slow.push_back(std::make_unique<RawClient>(server.port()));
    slow.back()->send("GET / HTTP/1.1\r\nHost: lo");
  }
  const auto begin = std::chrono::steady_clock::now();
  CHECK(status_of(exchange(server.port(), get("/"))) == 200);
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(2));
  // A byte now and then does not extend the deadline.
  for (int i = 0; i < 8; ++i) {
    slow.front()->send("c");
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  CHECK(status_of(slow.front()->receive_all()) == 408);
  slow.clear();
  CHECK(comes_true([&] { return server.server().active_connections() == 0; }));
}

TEST_CASE("a body that comes too slowly is ended") {
  HttpOptions options;
  options.body_grace = std::chrono::milliseconds(300);
  TestServer server(options);
  RawClient client(server.port());
  client.send(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: "
      "10\r\n\r\n{");
  CHECK(status_of(client.receive_all()) == 408);
  CHECK(server.calls == 0);
}

TEST_CASE("a body that ends early is refused") {
  TestServer server;
  RawClient client(server.port());
  client.send(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: "
      "10\r\n\r\n{");
  client.close();
  CHECK(comes_true([&] { return !server.logs().empty(); }));
  CHECK(server.logs().front().status == 400);
  CHECK(server.calls == 0);
}

TEST_CASE("connections beyond the cap are told to come back later") {
  HttpOptions options;
  options.max_connections = 4;
  options.head_deadline = std::chrono::milliseconds(1500);
  TestServer server(options);
  std::vector<std::unique_ptr<RawClient>> idle;
  for (int i = 0; i < 4; ++i) idle.push_back(std::make_unique<RawClient>(server.port()));
  REQUIRE(comes_true([&] { return server.server().active_connections() == 4; }));
  const std::string answer = exchange(server.port(), get("/"));
  CHECK(status_of(answer) == 503);
  CHECK(answer.find("Retry-After: ") != std::string::npos);
  CHECK(server.calls == 0);
  idle.clear();
  CHECK(comes_true([&] { return status_of(exchange(server.port(), get("/"))) == 200; }));
}

TEST_CASE("silent connections far beyond the cap do not hold the thread that accepts") {
  HttpOptions options;
  options.max_connections = 4;
  options.head_deadline = std::chrono::seconds(60);
  TestServer server(options);
  std::vector<std::unique_ptr<RawClient>> first;
  for (int i = 0; i < 4; ++i) first.push_back(std::make_unique<RawClient>(server.port()));
  REQUIRE(comes_true([&] { return server.server().active_connections() == 4; }));
  // A third of a second for each, one after the other, would take minutes.
  std::vector<std::unique_ptr<RawClient>> silent;
  for (int i = 0; i < 400; ++i) silent.push_back(std::make_unique<RawClient>(server.port()));
  int refused = 0;
  for (const auto& client : silent) {
    const std::string told = client->receive_all(std::chrono::seconds(20));
    if (told.empty()) continue;  // one of those for whom a thread waited
    ++refused;
    CHECK(status_of(told) == 503);
    CHECK(told.find("Retry-After: ") != std::string::npos);
    CHECK(told.find("\r\nConnection: close\r\n") != std::string::npos);
    CHECK(told.find("Content-Length: " + std::to_string(body_of(told).size()) + "\r\n") != std::string::npos);
    CHECK(body_of(told).find("all connections are in use") != std::string::npos);
  }
  CHECK(refused > 100);
  CHECK(server.calls == 0);
  for (int i = 0; i < 400; ++i) silent.push_back(std::make_unique<RawClient>(server.port()));
  first.clear();
  CHECK(comes_true([&] { return status_of(exchange(server.port(), get("/"))) == 200; }));
}

TEST_CASE("an exception in a handler is a 500 that says nothing of the inside") {
  TestServer server;
  const std::string answer = exchange(server.port(), get("/throw"));
  CHECK(status_of(answer) == 500);
  CHECK(answer.find("secret") == std::string::npos);
  CHECK(answer.find("EXCEPTION_WHAT") == std::string::npos);
  CHECK(answer.find("application/problem+json") != std::string::npos);
  REQUIRE(comes_true([&] { return !server.logs().empty(); }));
  CHECK(server.logs().front().failure == "secret path /srv/token");
}

TEST_CASE("an exception in a stream ends that stream alone") {
  TestServer server;
  const std::string answer = exchange(server.port(), get("/throwing-stream"));
  CHECK(status_of(answer) == 200);
  CHECK(body_of(answer).find("begin") != std::string::npos);
  CHECK_FALSE(answer.ends_with("0\r\n\r\n"));  // what is cut off does not look whole
  CHECK(status_of(exchange(server.port(), get("/"))) == 200);
}

TEST_CASE("a stream ends soon after its client is gone") {
  TestServer server;
  RawClient client(server.port());
  client.send(get("/stream"));
  std::string text;
  REQUIRE(client.receive_some(text, std::chrono::seconds(5)));
  REQUIRE(comes_true([&] { return server.open_streams == 1; }));
  client.close();
  CHECK(comes_true([&] { return server.open_streams == 0; }, std::chrono::milliseconds(2000)));
}

TEST_CASE("a stream whose client goes on sending ends") {
  TestServer server;
  RawClient client(server.port());
  client.send(get("/stream"));
  REQUIRE(comes_true([&] { return server.open_streams == 1; }));
  client.send("a little is dropped");
  std::string text;
  for (int i = 0; i < 20; ++i) REQUIRE(client.receive_some(text, std::chrono::seconds(10)));
  CHECK(server.open_streams == 1);
  client.send(std::string(64 * 1024, 'x'));
  CHECK(comes_true([&] { return server.open_streams == 0; }));
}

TEST_CASE("a stream whose client does not read is dropped at its deadline") {
  HttpOptions options;
  options.stream_write_deadline = std::chrono::milliseconds(300);
  TestServer server(options);
  RawClient client(server.port());
  client.send(get("/flood"));
  REQUIRE(comes_true([&] { return server.open_streams == 1; }));
  CHECK(comes_true([&] { return server.open_streams == 0; }, std::chrono::milliseconds(5000)));
}

TEST_CASE("stopping ends streams with their last words and refuses new requests") {
  auto server = std::make_unique<TestServer>();
  const std::uint16_t port = server->port();
  RawClient client(port);
  client.send(get("/stream"));
  REQUIRE(comes_true([&] { return server->open_streams == 1; }));
  CHECK(server->server().stop(std::chrono::milliseconds(5000)));
  const std::string answer = client.receive_all();
  CHECK(answer.find("end!\r\n0\r\n\r\n") != std::string::npos);
  CHECK_THROWS(RawClient(port).send(get("/")));
}

TEST_CASE("a server that is stopped at the moment at which it begins to serve ends") {
  // The threads meet anywhere in each other's course; a stop that misses the other's end would wait for ever.
  for (int i = 0; i < 500; ++i) {
    HttpServer server({}, {}, {});
    REQUIRE_FALSE(server.start().has_value());
    std::atomic<int> begun{0};
    std::atomic<bool> ended_as_asked{false};
    const auto meet = [&begun] {
      ++begun;
      while (begun < 2) std::this_thread::yield();
    };
    std::thread listener([&] {
      meet();
      ended_as_asked = server.run();
    });
    meet();
    CHECK(server.stop(std::chrono::milliseconds(3000)));
    listener.join();
    CHECK(ended_as_asked);
  }
}

TEST_CASE("a second server on the same port fails to start") {
  TestServer server;
  HttpOptions options;
  options.port = server.port();
  HttpServer second(options, {}, {});
  CHECK(second.start().has_value());
  CHECK(status_of(exchange(server.port(), get("/"))) == 200);
}

TEST_CASE("hundreds of simultaneous clients are served") {
  TestServer server;
  std::atomic<int> good{0};
  std::vector<std::thread> clients;
  for (int i = 0; i < 30; ++i)
    clients.emplace_back([&] {
      for (int j = 0; j < 10; ++j)
        if (status_of(exchange(server.port(), post("/echo", "{\"i\":1}"))) == 200) ++good;
    });
  for (std::thread& client : clients) client.join();
  CHECK(good == 300);
  CHECK(comes_true([&] { return server.server().active_connections() == 0; }));
}
