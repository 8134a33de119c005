// The daemon with a certificate of its own: what it serves, whom it refuses, and how its clients verify it.

#include <doctest/doctest.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <thread>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/acceptance/tls_support.h"

using namespace pointwright;
using namespace pointwright::test;

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

bool is_within(std::chrono::seconds patience, const std::function<bool()>& is_so) {
  const auto until = Clock::now() + patience;
  while (Clock::now() < until) {
    if (is_so()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

/// A folder with a certificate, and a daemon that has it.
struct Certified {
  TemporaryFolder folder;
  std::string certificate = folder / "cert.pem";
  std::string key = folder / "key.pem";
  std::unique_ptr<Daemon> daemon;

  explicit Certified(std::vector<std::string> more = {}) {
    write_certificate(certificate, key);
    more.insert(more.end(), {"--tls-cert", certificate, "--tls-key", key});
    daemon = std::make_unique<Daemon>(std::move(more));
  }

  [[nodiscard]] std::string url() const { return "https://localhost:" + std::to_string(daemon->port()); }

  Reply ask(const std::string& method, const std::string& target, const std::string& body = "",
            const std::string& headers = "", const std::string& host = "localhost") {
    TlsClient client(daemon->port(), certificate);
    std::string request = method + " " + target + " HTTP/1.1\r\nHost: " + host + "\r\n" + headers;
    if (!body.empty() || method == "POST") {
      if (headers.find("Content-Type") == std::string::npos) request += "Content-Type: application/json\r\n";
      request += "Content-Length: " + std::to_string(body.size()) + "\r\n";
    }
    client.send(request + "\r\n" + body);
    const std::string answer = client.receive_all();
    CHECK(client.ended_well());
    return parse_reply(answer);
  }

  std::string open_session() {
    Reply cloud =
        ask("POST", "/v1/clouds?name=sheet", file_of(wavy_sheet(40)), "Content-Type: application/x-ply\r\n");
    REQUIRE_MESSAGE(cloud.status == 201, cloud.body);
    const std::string id = cloud.json()["id"];
    Reply made = ask("POST", "/v1/sessions", R"({"cloud":")" + id + R"(","scales":[0.05]})");
    REQUIRE_MESSAGE(made.status == 202, made.body);
    const std::string session = made.headers.at("location");
    REQUIRE(
        is_within(std::chrono::seconds(60), [&] { return ask("GET", session).json()["state"] == "ready"; }));
    return session;
  }
};

}  // namespace

TEST_CASE(
    "over TLS a cloud is uploaded, painted, edited, streamed and downloaded, the same bytes as without") {
  Certified tls;
  const std::string session = tls.open_session();
  TlsClient stream(tls.daemon->port(), tls.certificate);
  stream.send("GET " + session + "/stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
  std::string streamed;
  while (streamed.find("PWFR") == std::string::npos) REQUIRE(stream.receive_some(streamed));
  CHECK(tls.ask("POST", session + "/regions/zero/operations", kLeft).status == 200);
  CHECK(tls.ask("POST", session + "/regions/one/operations", kRight).status == 200);
  const std::size_t before = streamed.size();
  CHECK(tls.ask("POST", session + "/edits", translation(0.2), "If-Match: *\r\n").status == 201);
  while (streamed.find("PWFR", before) == std::string::npos) REQUIRE(stream.receive_some(streamed));
  const Reply file = tls.ask("GET", session + "/samples?format=ply");
  CHECK(cloud_of(file.body).size() == 1600);

  // A body of many records, both ways.
  Cloud large = wavy_sheet(500);
  const std::string bytes = file_of(large);
  REQUIRE(bytes.size() > 3'000'000);
  const Reply uploaded =
      tls.ask("POST", "/v1/clouds?name=large", bytes, "Content-Type: application/x-ply\r\n");
  REQUIRE_MESSAGE(uploaded.status == 201, uploaded.body);
  const std::string id = uploaded.json()["id"];
  const Reply back = tls.ask("GET", "/v1/clouds/" + id + "/data?format=ply");
  CHECK(back.body == bytes);

  // Ending well: streams get their closing record, then the end of TLS.
  std::thread stopper([&] { CHECK(tls.daemon->stop(SIGTERM) == 0); });
  while (stream.receive_some(streamed)) {
  }
  stopper.join();
  CHECK(stream.ended_well());
}

TEST_CASE("a stream whose reader ends TLS or its connection is noticed") {
  Certified tls;
  const std::string session = tls.open_session();
  const auto streams = [&] {
    const Reply metrics = tls.ask("GET", "/metrics");
    const std::size_t at = metrics.body.find("\npointwright_streams ");
    return at == std::string::npos ? -1 : std::stoi(metrics.body.substr(at + 21));
  };
  enum class Leave { kEndsTls, kSpeaksAndEndsTls, kCloses, kGoesOnSending };
  for (const Leave leave :
       {Leave::kEndsTls, Leave::kSpeaksAndEndsTls, Leave::kCloses, Leave::kGoesOnSending}) {
    CAPTURE(static_cast<int>(leave));
    auto stream = std::make_unique<TlsClient>(tls.daemon->port(), tls.certificate);
    stream->send("GET " + session + "/stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
    std::string streamed;
    while (streamed.find("PWFR") == std::string::npos) REQUIRE(stream->receive_some(streamed));
    CHECK(is_within(std::chrono::seconds(5), [&] { return streams() == 1; }));
    if (leave == Leave::kSpeaksAndEndsTls) stream->send(std::string(5000, 'x'));
    // The end of TLS alone leaves the connection as it is.
    if (leave == Leave::kEndsTls || leave == Leave::kSpeaksAndEndsTls) SSL_shutdown(stream->ssl());
    if (leave == Leave::kCloses) stream.reset();
    if (leave == Leave::kGoesOnSending) stream->send(std::string(100'000, 'x'));
    CHECK(is_within(std::chrono::seconds(10), [&] { return streams() == 0; }));
  }
}

TEST_CASE("wrong authorities, wrong names, old versions and plain HTTP get nothing") {
  Certified tls;
  write_certificate(tls.folder / "other.pem", tls.folder / "other.key");
  CHECK_THROWS(TlsClient(tls.daemon->port(), tls.folder / "other.pem"));
  CHECK_THROWS(TlsClient(tls.daemon->port(), tls.certificate, TLS1_VERSION, TLS1_1_VERSION));
  for (const int version : {TLS1_2_VERSION, TLS1_3_VERSION}) {
    TlsClient client(tls.daemon->port(), tls.certificate, version, version);
    client.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
    CHECK(status_of(client.receive_all()) == 200);
    // No session is kept: nothing to resume.
    CHECK(SSL_SESSION_has_ticket(SSL_get_session(client.ssl())) == 0);
  }
  for (const char* method : {"GET", "POST", "DELETE", "CONNECT"}) {
    const auto begin = Clock::now();
    const std::string answer =
        exchange(tls.daemon->port(), std::string(method) + " / HTTP/1.1\r\nHost: localhost\r\n" +
                                         "Content-Length: 200000\r\n\r\n" + std::string(200'000, 'x'));
    CHECK(status_of(answer) == 400);
    CHECK(body_of(answer) == "This port speaks TLS: ask by https://.\n");
    CHECK(seconds_since(begin) < 3);
  }
  // Neither one nor the other.
  CHECK(exchange(tls.daemon->port(), std::string("\x16\x03\x01 nothing of TLS", 18)).find("HTTP") ==
        std::string::npos);
  CHECK(exchange(tls.daemon->port(), std::string(1000, '\0')).find("HTTP") == std::string::npos);
  CHECK(tls.ask("GET", "/healthz").status == 200);
}

TEST_CASE("a handshake that does not end, and records that hold nothing, are cut at the head's deadline") {
  Certified tls({"--head-deadline-ms", "500"});
  RawClient silent(tls.daemon->port());
  RawClient slow(tls.daemon->port());
  const auto begin = Clock::now();
  // The beginning of a handshake, a byte at a time.
  const std::string hello("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11);
  std::thread dripping([&] {
    for (int i = 0; i < 400 && slow.send(std::string(1, i < 11 ? hello[static_cast<std::size_t>(i)] : 'x'));
         ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
  });
  CHECK(silent.receive_all(std::chrono::seconds(5)).empty());
  CHECK(slow.receive_all(std::chrono::seconds(5)).find("HTTP") == std::string::npos);
  CHECK(seconds_since(begin) < 3);
  ::shutdown(slow.descriptor(), SHUT_RDWR);
  dripping.join();
  // A finished handshake buys no time either.
  TlsClient idle(tls.daemon->port(), tls.certificate);
  const auto shaken = Clock::now();
  CHECK(idle.receive_all().empty());
  CHECK(seconds_since(shaken) < 3);
  CHECK(tls.ask("GET", "/healthz").status == 200);
}

TEST_CASE("pages with TLS are the server's own, those without are not; browsers are told to stay with TLS") {
  Certified tls({"--allowed-hosts", "pointwright.test"});
  const auto with_origin = [&](const std::string& origin) {
    return tls.ask("POST", "/v1/sessions", "{}", "Origin: " + origin + "\r\n", "pointwright.test").status;
  };
  CHECK(with_origin("https://pointwright.test") == 422);
  CHECK(with_origin("http://pointwright.test") == 403);
  CHECK(with_origin("https://evil.example") == 403);
  Reply known = tls.ask("GET", "/healthz", "", "", "pointwright.test");
  CHECK(known.headers["strict-transport-security"] == "max-age=31536000");
  Reply local = tls.ask("GET", "/healthz");
  CHECK(local.headers.count("strict-transport-security") == 0);
  Daemon plain({"--allowed-hosts", "pointwright.test"});
  const Reply without =
      parse_reply(exchange(plain.port(), "GET /healthz HTTP/1.1\r\nHost: pointwright.test\r\n\r\n"));
  CHECK(without.status == 200);
  CHECK(without.headers.count("strict-transport-security") == 0);
}

TEST_CASE("SIGHUP takes a new certificate; a bad one leaves the old in force") {
  Certified tls;
  const auto logged = [&](const std::string& text) {
    return is_within(std::chrono::seconds(10),
                     [&] { return tls.daemon->log().find(text) != std::string::npos; });
  };
  std::filesystem::copy_file(tls.certificate, tls.folder / "old.pem");
  std::filesystem::copy_file(tls.key, tls.folder / "old.key");
  write_certificate(tls.certificate, tls.key);
  CHECK_THROWS(TlsClient(tls.daemon->port(), tls.certificate));  // not before it is asked for
  ::kill(tls.daemon->pid(), SIGHUP);
  REQUIRE(logged("\"reloaded\",\"file\":"));
  CHECK(tls.ask("GET", "/healthz").status == 200);
  CHECK_THROWS(TlsClient(tls.daemon->port(), tls.folder / "old.pem"));

  std::filesystem::copy_file(tls.folder / "old.key", tls.key,
                             std::filesystem::copy_options::overwrite_existing);
  ::kill(tls.daemon->pid(), SIGHUP);
  REQUIRE(logged("not the key of the certificate"));
  CHECK(tls.ask("GET", "/healthz").status == 200);
  std::filesystem::copy_file(tls.certificate, tls.folder / "new.pem");
  std::ofstream(tls.certificate) << "-----BEGIN CERTIFICATE-----\nsecret\n";
  ::kill(tls.daemon->pid(), SIGHUP);
  REQUIRE(logged("tls_cert: " + tls.certificate));
  tls.certificate = tls.folder / "new.pem";
  CHECK(tls.ask("GET", "/healthz").status == 200);
  CHECK(tls.daemon->log().find("secret") == std::string::npos);
}

TEST_CASE("a pipe in the certificate's place holds up neither the tokens nor the end of the daemon") {
  const TemporaryFolder tokens;
  const std::string file = tokens / "tokens.json";
  REQUIRE(run({POINTWRIGHTD_PATH, "token", "add", "ann", "--tokens", file}).status == 0);
  Certified tls({"--tokens", file});
  for (const bool is_key : {false, true}) {
    const std::string path = is_key ? tls.key : tls.certificate;
    std::filesystem::rename(path, path + ".kept");
    REQUIRE(::mkfifo(path.c_str(), 0600) == 0);
    ::kill(tls.daemon->pid(), SIGHUP);
    CHECK(is_within(std::chrono::seconds(20), [&] {
      return tls.daemon->log().find(path + ": is not a regular file; the old certificate stays") !=
             std::string::npos;
    }));
    CHECK(tls.daemon->log().find("\"tokens\":1") != std::string::npos);
    std::filesystem::remove(path);
    std::filesystem::rename(path + ".kept", path);
  }
  CHECK(tls.ask("GET", "/healthz").status == 200);
  CHECK(tls.daemon->stop(SIGTERM) == 0);
}

TEST_CASE("a certificate that has expired does not replace one that has not") {
  Certified tls;
  const auto logged = [&](const std::string& text) {
    return is_within(std::chrono::seconds(10),
                     [&] { return tls.daemon->log().find(text) != std::string::npos; });
  };
  CHECK(tls.daemon->log().find("certificate-expired") == std::string::npos);
  std::filesystem::copy_file(tls.certificate, tls.folder / "valid.pem");
  write_certificate(tls.certificate, tls.key, "DNS:localhost", -10);
  ::kill(tls.daemon->pid(), SIGHUP);
  REQUIRE(logged(tls.certificate + ": has expired: "));
  tls.certificate = tls.folder / "valid.pem";
  CHECK(tls.ask("GET", "/healthz").status == 200);

  // A daemon that begins with one serves it, and says so; the next one that has expired is as good.
  write_certificate(tls.folder / "past.pem", tls.folder / "past.key", "DNS:localhost", -10);
  tls.daemon = std::make_unique<Daemon>(
      std::vector<std::string>{"--tls-cert", tls.folder / "past.pem", "--tls-key", tls.folder / "past.key"});
  REQUIRE(logged("\"certificate-expired\""));
  CHECK_THROWS(TlsClient(tls.daemon->port(), tls.folder / "past.pem"));
  ::kill(tls.daemon->pid(), SIGHUP);
  REQUIRE(logged("\"reloaded\",\"file\":\"" + (tls.folder / "past.pem")));
}

TEST_CASE("files that do not serve are named with the reason at the start, and nothing of them is printed") {
  const TemporaryFolder folder;
  write_certificate(folder / "cert.pem", folder / "key.pem");
  write_certificate(folder / "cert2.pem", folder / "key2.pem");
  std::ofstream(folder / "broken.pem") << "top-secret-text";
  using std::filesystem::perms;
  const perms own = perms::owner_read | perms::owner_write;
  std::filesystem::permissions(folder / "broken.pem", own);
  const auto start = [&](const std::string& certificate, const std::string& key) {
    return run({POINTWRIGHTD_PATH, "--port", "0", "--tls-cert", certificate, "--tls-key", key});
  };
  const Ended missing = start(folder / "none.pem", folder / "key.pem");
  CHECK(missing.status == 1);
  CHECK(missing.err.find(folder / "none.pem") != std::string::npos);
  CHECK(missing.err.find("No such file") != std::string::npos);
  const Ended no_key = start(folder / "cert.pem", folder / "none.pem");
  CHECK(no_key.status == 1);
  CHECK(no_key.err.find(folder / "none.pem") != std::string::npos);
  const Ended mismatch = start(folder / "cert.pem", folder / "key2.pem");
  CHECK(mismatch.status == 1);
  CHECK(mismatch.err.find("not the key of the certificate") != std::string::npos);
  for (const bool is_key : {false, true}) {
    const Ended broken = is_key ? start(folder / "cert.pem", folder / "broken.pem")
                                : start(folder / "broken.pem", folder / "key.pem");
    CHECK(broken.status == 1);
    CHECK(broken.err.find(folder / "broken.pem") != std::string::npos);
    CHECK(broken.err.find(is_key ? "is not a PEM key without a passphrase" : "is not a PEM certificate") !=
          std::string::npos);
    CHECK(broken.err.find("top-secret") == std::string::npos);
  }
  // A chain that is cut off within its second certificate.
  std::filesystem::copy_file(folder / "cert.pem", folder / "cut.pem");
  std::ofstream(folder / "cut.pem", std::ios::app) << "-----BEGIN CERTIFICATE-----\nMIIB\n";
  CHECK(start(folder / "cut.pem", folder / "key.pem").err.find("is not a PEM certificate throughout") !=
        std::string::npos);
  std::ofstream(folder / "large.pem") << std::string((1U << 20U) + 1, '\n');
  CHECK(start(folder / "large.pem", folder / "key.pem").err.find("is larger than 1048576 bytes") !=
        std::string::npos);
  CHECK(start("/dev/zero", folder / "key.pem").err.find("is not a regular file") != std::string::npos);
  // A key that others may read is no secret; one that a group may read is.
  for (const perms more : {perms::others_read, perms::group_write, perms::others_write}) {
    std::filesystem::permissions(folder / "key.pem", own | more);
    const Ended open = start(folder / "cert.pem", folder / "key.pem");
    CHECK(open.status == 1);
    CHECK(open.err.find(folder / "key.pem") != std::string::npos);
    CHECK(open.err.find("its mode must be 0600 or 0640") != std::string::npos);
  }
  std::filesystem::permissions(folder / "key.pem", own | perms::group_read);
  Daemon grouped({"--tls-cert", folder / "cert.pem", "--tls-key", folder / "key.pem"});
  CHECK(TlsClient(grouped.port(), folder / "cert.pem")
            .send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  const Ended half = run({POINTWRIGHTD_PATH, "--port", "0", "--tls-cert", folder / "cert.pem"});
  CHECK(half.status == 2);
  CHECK(half.err.find("tls_key") != std::string::npos);
}

TEST_CASE("the command line verifies certificate and name, by --ca or the system's authorities") {
  Certified tls;
  const std::string port = std::to_string(tls.daemon->port());
  // Whoever asked again would pause for longer than that, and be ended.
  constexpr std::chrono::seconds kLessThanThePauses(12);
  const auto ask = [&](const std::string& url, std::vector<std::string> more) {
    std::vector<std::string> command = {POINTWRIGHT_PATH, "cloud", "list", "--server", url};
    command.insert(command.end(), more.begin(), more.end());
    return run(command, kLessThanThePauses);
  };
  std::ofstream(tls.folder / "sheet.ply") << file_of(wavy_sheet(20));
  const Ended uploaded = run(
      {POINTWRIGHT_PATH, "upload", tls.folder / "sheet.ply", "--server", tls.url(), "--ca", tls.certificate});
  CHECK_MESSAGE(uploaded.status == 0, uploaded.err);
  const Ended listed = ask(tls.url(), {"--ca", tls.certificate});
  CHECK(listed.out.find("sheet") != std::string::npos);
  CHECK(ask("https://127.0.0.1:" + port, {"--ca", tls.certificate}).status == 0);
  const Ended unknown = ask(tls.url(), {});
  CHECK(unknown.status == 3);
  CHECK(unknown.err.find("certificate") != std::string::npos);
  write_certificate(tls.folder / "other.pem", tls.folder / "other.key");
  CHECK(ask(tls.url(), {"--ca", tls.folder / "other.pem"}).status == 3);
  const Ended not_sent =
      run({POINTWRIGHT_PATH, "upload", tls.folder / "sheet.ply", "--server", tls.url()}, kLessThanThePauses);
  CHECK(not_sent.status == 3);
  CHECK(not_sent.err.find("certificate") != std::string::npos);
  // A trusted certificate of another name.
  write_certificate(tls.folder / "named.pem", tls.folder / "named.key", "DNS:elsewhere.test");
  Daemon elsewhere({"--tls-cert", tls.folder / "named.pem", "--tls-key", tls.folder / "named.key"});
  const Ended misnamed =
      ask("https://localhost:" + std::to_string(elsewhere.port()), {"--ca", tls.folder / "named.pem"});
  CHECK(misnamed.status == 3);
  CHECK(misnamed.err.find("certificate") != std::string::npos);
  CHECK(ask(tls.url(), {"--ca", tls.folder / "none.pem"}).status == 1);
  CHECK(ask("http://localhost:" + port, {"--ca", tls.certificate}).status == 1);
}
