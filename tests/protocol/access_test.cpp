// Tokens and share links as documents.

#include <doctest/doctest.h>

#include <string>

#include "protocol/json/access.h"

using namespace pointwright::protocol;

namespace {

Json parsed(const std::string& text) {
  return parse_json(text).value();
}

const std::string kEntry =
    R"({"id":"Y2FsbGVyLXRva2VuLWlkMA","name":"Ann","scope":"edit","created":"2026-01-31T12:34:56.789Z",)"
    R"("quotas":{"sessions":4},"sha256":")" +
    std::string(64, 'a') + R"("})";

}  // namespace

TEST_CASE("times are read as they are printed, and nothing else is") {
  for (const char* text :
       {"2026-01-31T12:34:56.789Z", "1970-01-01T00:00:00.000Z", "2028-02-29T23:59:59.001Z"}) {
    const auto time = parse_rfc3339(text);
    REQUIRE(time.has_value());
    CHECK(to_rfc3339(*time) == text);
  }
  CHECK(to_rfc3339(*parse_rfc3339("2026-01-31T12:34:56Z")) == "2026-01-31T12:34:56.000Z");
  CHECK(to_rfc3339(*parse_rfc3339("2026-01-31T12:34:56.5Z")) == "2026-01-31T12:34:56.500Z");
  CHECK(to_rfc3339(*parse_rfc3339("2026-01-31T12:34:56.123456789Z")) == "2026-01-31T12:34:56.123Z");
  for (const char* text :
       {"", "Z", "2026-01-31", "2026-01-31T12:34:56", "2026-01-31T12:34:56+00:00", "2026-02-29T00:00:00Z",
        "2026-13-01T00:00:00Z", "2026-01-01T24:00:00Z", "2026-01-01T00:60:00Z", "2026-01-01T00:00:60Z",
        "2026-01-01T00:00:00.Z", "2026-01-01T00:00:00.1234567890Z", "2026-01-01t00:00:00Z",
        "+026-01-01T00:00:00Z", "2026-01-01T00:00:00.1xZ", "1969-01-01T00:00:00Z"})
    CHECK_MESSAGE(!parse_rfc3339(text).has_value(), text);
}

TEST_CASE("a request for a token is read whole or refused with a pointer") {
  const auto full = parse_token_request(parsed(
      R"({"name":"Ann","scope":"admin","expires":"2030-01-01T00:00:00Z","quotas":{"sessions":2,"streams":0}})"));
  REQUIRE(full.ok());
  CHECK(full.value().name == "Ann");
  CHECK(full.value().scope == Scope::kAdmin);
  CHECK(full.value().expires == parse_rfc3339("2030-01-01T00:00:00Z"));
  CHECK(full.value().quotas == Quotas{.sessions = 2, .streams = 0});
  const auto pointer_of = [](const std::string& text) {
    const auto refused = parse_token_request(parsed(text));
    REQUIRE_FALSE(refused.ok());
    return refused.errors().faults.front().pointer;
  };
  CHECK(pointer_of(R"({"scope":"view"})") == "/name");
  CHECK(pointer_of(R"({"name":"","scope":"view"})") == "/name");
  CHECK(pointer_of(R"({"name":"a"})") == "/scope");
  CHECK(pointer_of(R"({"name":"a","scope":"root"})") == "/scope");
  CHECK(pointer_of(R"({"name":"a","scope":"view","expires":"soon"})") == "/expires");
  CHECK(pointer_of(R"({"name":"a","scope":"view","quotas":{"sessions":-1}})") == "/quotas/sessions");
  CHECK(pointer_of(R"({"name":"a","scope":"view","quotas":{"cpus":1}})") == "/quotas/cpus");
  CHECK(pointer_of(R"({"name":"a","scope":"view","more":1})") == "/more");
}

TEST_CASE("a share link never makes an admin") {
  CHECK(parse_share_request(parsed(R"({"scope":"edit"})")).value().scope == Scope::kEdit);
  CHECK_FALSE(parse_share_request(parsed(R"({"scope":"admin"})")).ok());
  CHECK_FALSE(parse_share_request(parsed("{}")).ok());
  CHECK_FALSE(parse_share_request(parsed(R"({"scope":"view","session":"x"})")).ok());
}

TEST_CASE("a file of tokens comes back as it was written") {
  const auto tokens = parse_token_file(parsed(R"({"version":1,"tokens":[)" + kEntry + "]}"));
  REQUIRE(tokens.ok());
  REQUIRE(tokens.value().size() == 1);
  CHECK(tokens.value()[0].document.terms.quotas.sessions == 4);
  CHECK(parsed(to_text(token_file(tokens.value()))) == parsed(R"({"version":1,"tokens":[)" + kEntry + "]}"));
  CHECK(parse_token_file(parsed(R"({"version":1,"tokens":[]})")).value().empty());
  for (const char* text : {R"({"version":2,"tokens":[]})", R"({"tokens":[]})", R"({"version":1})",
                           R"({"version":1,"tokens":[{}]})", R"([])"})
    CHECK_MESSAGE(!parse_token_file(parsed(text)).ok(), text);
}
