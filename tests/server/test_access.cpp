// Buckets, accounts, links, counters, and what the description of the API says of each row.

#include <doctest/doctest.h>
#include <sys/stat.h>

#include <cctype>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/access/access.h"
#include "server/access/secret.h"
#include "server/access/token_store.h"
#include "server/base/random_id.h"
#include "server/handlers/openapi.h"
#include "server/metrics/metrics.h"
#include "server/routes/routes.h"
#include "tests/server/temporary_folder.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace std::chrono_literals;

TEST_CASE("a pipe that takes the place of the tokens is refused at once, and the tokens stay") {
  const pointwright::test::TemporaryFolder folder;
  const std::string path = folder / "tokens.json";
  REQUIRE(edit_token_file(path, true, [](std::vector<TokenEntry>&) { return Outcome<Done>(Done{}); }).ok());
  TokenStore tokens(path);
  REQUIRE(tokens.add({.name = "one"}, 10).ok());
  std::filesystem::remove(path);
  REQUIRE(::mkfifo(path.c_str(), 0600) == 0);
  CHECK(tokens.reload().has_value());
  CHECK(tokens.list().size() == 1);
}

TEST_CASE("a bucket gives its capacity at once and then what flows in") {
  Buckets buckets(8);
  const Buckets::Flow flow{.capacity = 2.0, .per_second = 0.5};
  const auto start = Buckets::Clock::time_point() + 1h;
  CHECK(buckets.take("a", flow, 1.0, start) == 0.0);
  CHECK(buckets.take("a", flow, 1.0, start) == 0.0);
  CHECK(buckets.take("a", flow, 1.0, start) == 2.0);
  CHECK(buckets.take("b", flow, 1.0, start) == 0.0);
  CHECK(buckets.taken("a", flow, start + 1s) == 1.5);
  CHECK(buckets.take("a", flow, 1.0, start + 1s) == 1.0);
  CHECK(buckets.take("a", flow, 1.0, start + 2s) == 0.0);
  CHECK(std::isinf(buckets.take("c", flow, 3.0, start)));
  CHECK(buckets.taken("nobody", flow, start) == 0.0);
}

TEST_CASE("buckets hold so many keys, and forget full ones first") {
  Buckets buckets(2);
  const Buckets::Flow flow{.capacity = 1.0, .per_second = 1.0};
  const auto start = Buckets::Clock::time_point() + 1h;
  CHECK(buckets.take("old", flow, 1.0, start) == 0.0);
  CHECK(buckets.take("busy", flow, 1.0, start + 3s) == 0.0);
  CHECK(buckets.take("new", flow, 1.0, start + 3s) == 0.0);
  CHECK(buckets.take("busy", flow, 1.0, start + 3s) > 0.0);
}

TEST_CASE("accounts hold up to the limit and get back what is let go") {
  Accounts accounts;
  auto first = accounts.hold("a", Quota::kSessions, 2, 3);
  REQUIRE(first != nullptr);
  CHECK(accounts.hold("a", Quota::kSessions, 2, 3) == nullptr);
  CHECK(accounts.hold("b", Quota::kSessions, 3, 3) != nullptr);
  CHECK(accounts.hold("a", Quota::kStreams, 3, 3) != nullptr);
  CHECK(accounts.held("a", Quota::kSessions) == 2);
  auto copy = first;
  first.reset();
  CHECK(accounts.held("a", Quota::kSessions) == 2);
  copy.reset();
  CHECK(accounts.held("a", Quota::kSessions) == 0);
  CHECK(accounts.hold("a", Quota::kSamples, 1, 0) == nullptr);
  CHECK(accounts.hold("a", Quota::kSamples, 0, 0) != nullptr);
}

TEST_CASE("secrets are long, new each time, and found by their digest alone") {
  const std::string secret = new_secret(kTokenPrefix);
  CHECK(secret.size() == kTokenPrefix.size() + 43);
  CHECK(secret != new_secret(kTokenPrefix));
  CHECK(digest_of("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(same_digest("ab", "ab"));
  CHECK_FALSE(same_digest("ab", "ac"));
  CHECK_FALSE(same_digest("ab", "abc"));
}

TEST_CASE("without tokens everybody is a local admin, but for who comes by a link") {
  Access access(Limits{}, "");
  const auto with = [](const std::string& value) {
    RequestHead head;
    head.headers.emplace_back("authorization", value);
    return head;
  };
  CHECK(access.identify(RequestHead{}).value().scope == Scope::kAdmin);
  CHECK(access.identify(with("Bearer whatever")).value().scope == Scope::kAdmin);
  const auto made = access.shares.add("AAAAAAAAAAAAAAAAAAAAAA", "", {.scope = Scope::kView});
  REQUIRE(made.ok());
  const auto guest = access.identify(with("bearer " + made.value().capability));
  REQUIRE(guest.ok());
  CHECK(guest.value().scope == Scope::kView);
  CHECK_FALSE(guest.value().may_see(""));
  CHECK(guest.value().may_see_session("", "AAAAAAAAAAAAAAAAAAAAAA"));
  CHECK_FALSE(guest.value().may_see_session("", "BBBBBBBBBBBBBBBBBBBBBB"));
  CHECK(access.shares.revoke("BBBBBBBBBBBBBBBBBBBBBB", made.value().share.document.id).ok() == false);
  access.shares.forget("AAAAAAAAAAAAAAAAAAAAAA");
  CHECK(access.identify(with("Bearer " + made.value().capability)).problem().status() == 401);
}

TEST_CASE("counters and histograms are printed as Prometheus reads them") {
  Metrics metrics({"GET /v1/info"});
  RequestLog request;
  request.method = "HEAD";
  request.route = "/v1/info";
  request.status = 200;
  request.duration_ms = 3.0;
  request.timings = {{"decode", 2000.0}, {"total", 3.0}};
  metrics.count_request(request);
  request.route = "/nothing";
  request.status = 404;
  metrics.count_request(request);
  metrics.count_frame(100, 2);
  const std::string text = metrics.text({{.name = "g", .help = "h", .labels = "a=\"b\"", .value = 1.5}});
  for (const char* line :
       {"pointwright_requests_total{method=\"GET\",route=\"/v1/info\",status=\"200\"} 1\n",
        "pointwright_requests_total{method=\"\",route=\"none\",status=\"404\"} 1\n",
        "pointwright_request_seconds_bucket{le=\"0.0025\"} 0\n",
        "pointwright_request_seconds_bucket{le=\"0.005\"} 2\n",
        "pointwright_request_seconds_bucket{le=\"+Inf\"} 2\n", "pointwright_request_seconds_sum 0.006\n",
        "pointwright_request_seconds_count 2\n", "pointwright_step_seconds_sum{step=\"decode\"} 4\n",
        "pointwright_frames_total 1\n", "pointwright_frames_dropped_total 2\n",
        "# TYPE g gauge\ng{a=\"b\"} 1.5\n"})
    CHECK_MESSAGE(text.find(line) != std::string::npos, line);
}

TEST_CASE("every row of the table is in the description, with the scope it needs") {
  const auto api = nlohmann::json::parse(openapi_json());
  const auto shape = [](std::string path) {
    for (std::size_t open = path.find('{'); open != std::string::npos; open = path.find('{', open + 1))
      path.erase(open + 1, path.find('}', open) - open - 1);
    return path;
  };
  for (const Route& route : all_routes()) {
    std::string wanted = shape(std::string(route.pattern));
    if (wanted.rfind("/docs/", 0) == 0) wanted = "/docs/{}";
    std::string method(method_name(route.method));
    for (char& c : method) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    CAPTURE(wanted);
    CAPTURE(method);
    const nlohmann::json* operation = nullptr;
    for (const auto& [path, item] : api["paths"].items())
      if (shape(path) == wanted && item.contains(method)) operation = &item[method];
    REQUIRE(operation != nullptr);
    const nlohmann::json& security =
        operation->contains("security") ? (*operation)["security"] : api["security"];
    std::string scope =
        changes_state(route.method) || route.permission == Permission::kOwner ? "edit" : "view";
    if (route.permission == Permission::kAdmin) scope = "admin";
    if (route.permission == Permission::kOpen) {
      CHECK(security.empty());
    } else {
      CHECK(security == nlohmann::json::parse(R"([{"token":[")" + scope + R"("]}])"));
    }
  }
}

TEST_CASE("ids fit into paths and command lines") {
  for (int i = 0; i < 2000; ++i) {
    const std::string id = random_id();
    CHECK(protocol::is_valid_id(id));
    CHECK(id.front() != '-');
  }
}
