#include <doctest/doctest.h>

#include "server/http/head.h"

using namespace pointwright::server;

namespace {

int status_of(const std::string& head, const HeadLimits& limits = {}) {
  const auto parsed = parse_head(head, limits);
  if (const auto* problem = std::get_if<Problem>(&parsed)) return problem->status();
  return 200;
}

RequestHead parsed(const std::string& head) {
  return std::get<RequestHead>(parse_head(head, {}));
}

std::string get_with(const std::string& headers) {
  return "GET / HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}
std::string post_with(const std::string& headers) {
  return "POST / HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}

}  // namespace

TEST_CASE("a plain request is parsed into method, path, query and headers") {
  const RequestHead head = parsed(
      "PUT /v1/a%20b?x=1&y=%2B+z HTTP/1.1\r\nHost: localhost\r\nX-Thing:  value \r\n"
      "Content-Length: 12\r\n\r\n");
  CHECK(head.method == Method::kPut);
  CHECK(head.path == "/v1/a b");
  REQUIRE(head.query.size() == 2);
  CHECK(head.query[1] == NameValue{"y", "+ z"});
  CHECK(head.header("x-thing").value() == "value");
  CHECK(head.content_length.value() == 12);
}

TEST_CASE("a content type is compared without parameters and case") {
  CHECK(parsed(post_with("Content-Length: 0\r\nContent-Type: Application/JSON ; charset=utf-8\r\n"))
            .media_type() == "application/json");
}

TEST_CASE("request lines that are not exactly METHOD TARGET VERSION are refused") {
  CHECK(status_of("GET /\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("GET  / HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("GET http://a/ HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("G@T / HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("BREW / HTTP/1.1\r\nHost: a\r\n\r\n") == 501);
  CHECK(status_of("GET / HTTP/2.0\r\nHost: a\r\n\r\n") == 505);
  CHECK(status_of("GET / HTTP/1.1\nHost: a\n\n") == 400);
}

TEST_CASE("paths with NUL, control characters, broken escapes or too many bytes are refused") {
  CHECK(status_of("GET /a%00b HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("GET /a%0d%0a HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("GET /a%4 HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("GET /a%zz HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
  CHECK(status_of("GET /" + std::string(511, 'a') + " HTTP/1.1\r\nHost: a\r\n\r\n") == 200);
  CHECK(status_of("GET /" + std::string(512, 'a') + " HTTP/1.1\r\nHost: a\r\n\r\n") == 414);
  CHECK(status_of(std::string("GET /\0 HTTP/1.1\r\nHost: a\r\n\r\n", 29)) == 400);
}

TEST_CASE("header lines with folds, spaces before the colon or control characters are refused") {
  CHECK(status_of(get_with("X: a\r\n b\r\n")) == 400);
  CHECK(status_of(get_with("X : a\r\n")) == 400);
  CHECK(status_of(get_with(": a\r\n")) == 400);
  CHECK(status_of(get_with("no colon\r\n")) == 400);
  CHECK(status_of(get_with("X: a\x01\r\n")) == 400);
  CHECK(status_of(get_with("X: a\rY: b\r\n")) == 400);
  CHECK(status_of(get_with("X: tab\tis fine\r\n")) == 200);
}

TEST_CASE("a length is one plain number or nothing at all") {
  CHECK(status_of(post_with("Content-Length: 5\r\n")) == 200);
  for (const char* value : {"+5", "-1", "abc", "5, 5", "0x10", "5 5", "", "1e3", "9999999999999999999999"})
    CHECK_MESSAGE(status_of(post_with(std::string("Content-Length: ") + value + "\r\n")) == 400, value);
  CHECK(status_of(post_with("Content-Length: 5\r\nContent-Length: 5\r\n")) == 400);
  CHECK(status_of(post_with("")) == 411);
  CHECK(status_of(post_with("Transfer-Encoding: chunked\r\n")) == 411);
  CHECK(status_of(post_with("Transfer-Encoding: chunked\r\nContent-Length: 5\r\n")) == 400);
  CHECK(status_of(post_with("Transfer-Encoding: gzip\r\n")) == 501);
  CHECK(status_of(get_with("Transfer-Encoding: chunked\r\n")) == 411);
}

TEST_CASE("compressed bodies, several ranges and unknown expectations are refused") {
  CHECK(status_of(post_with("Content-Length: 5\r\nContent-Encoding: gzip\r\n")) == 415);
  CHECK(status_of(post_with("Content-Length: 5\r\nContent-Encoding: identity\r\n")) == 200);
  CHECK(status_of(get_with("Range: bytes=0-1\r\n")) == 200);
  CHECK(status_of(get_with("Range: bytes=0-1,0-1\r\n")) == 416);
  CHECK(status_of(get_with("Range: bytes=0-1\r\nRange: bytes=0-1\r\n")) == 416);
  CHECK(status_of(get_with("Expect: 100-continue\r\n")) == 200);
  CHECK(status_of(get_with("Expect: miracles\r\n")) == 417);
}

TEST_CASE("a request has one host and at most the configured number of headers") {
  CHECK(status_of("GET / HTTP/1.1\r\n\r\n") == 400);
  CHECK(status_of(get_with("Host: b\r\n")) == 400);
  std::string many;
  for (int i = 0; i < 63; ++i) many += "X-" + std::to_string(i) + ": 1\r\n";
  CHECK(status_of(get_with(many)) == 200);
  CHECK(status_of(get_with(many + "X-last: 1\r\n")) == 431);
}

TEST_CASE("only loopback names and listed ones are hosts") {
  const std::vector<std::string> listed = {"scan.example.org"};
  for (const char* host : {"localhost", "LOCALHOST:9000", "127.0.0.1:80", "[::1]:7878", "[::1]",
                           "scan.example.org", "Scan.Example.org:443"})
    CHECK_MESSAGE(is_allowed_host(host, listed), host);
  for (const char* host : {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil", "localhost:80:90",
                           "localhost:x", "[::1", "[::1]x", "0.0.0.0", "scan.example.org.evil"})
    CHECK_MESSAGE(!is_allowed_host(host, listed), host);
}

TEST_CASE("changes are taken from no origin or the request's own") {
  const auto kind = [](const std::string& method, const std::string& origin) {
    const std::string text = method + " / HTTP/1.1\r\nHost: localhost:7878\r\nContent-Length: 0\r\n" +
                             (origin.empty() ? "" : "Origin: " + origin + "\r\n") + "\r\n";
    const auto problem = check_origin(parsed(text), {});
    return problem ? problem->status() : 200;
  };
  CHECK(kind("POST", "") == 200);
  CHECK(kind("POST", "http://localhost:7878") == 200);
  CHECK(kind("DELETE", "https://localhost:7878") == 200);
  for (const char* origin : {"null", "http://evil.example", "http://localhost", "http://localhost:78780"})
    for (const char* method : {"POST", "PUT", "DELETE"}) CHECK_MESSAGE(kind(method, origin) == 403, origin);
  CHECK(kind("GET", "http://evil.example") == 200);
  // Where the server itself does TLS, a page without it is somebody else's.
  const auto over_tls = [](const std::string& origin) {
    const std::string text = "DELETE / HTTP/1.1\r\nHost: scan.example\r\nOrigin: " + origin + "\r\n\r\n";
    return check_origin(parsed(text), {"scan.example"}, {}, true).has_value();
  };
  CHECK_FALSE(over_tls("https://scan.example"));
  CHECK(over_tls("http://scan.example"));
}
