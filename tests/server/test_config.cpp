#include <doctest/doctest.h>

#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>

#include "server/config/config.h"

using namespace pointwright::server;

namespace {

using Variables = std::map<std::string, std::string>;

ConfigOutcome read(const std::vector<std::string>& arguments, const Variables& variables = {}) {
  EnvironmentNames names;
  for (const auto& entry : variables) names.push_back(entry.first);
  return read_config(
      arguments,
      [variables](const std::string& name) -> std::optional<std::string> {
        const auto it = variables.find(name);
        return it == variables.end() ? std::nullopt : std::optional<std::string>(it->second);
      },
      names);
}

Config good(const ConfigOutcome& outcome) {
  const auto* exit = std::get_if<ConfigExit>(&outcome);
  REQUIRE_MESSAGE(exit == nullptr, (exit == nullptr ? "" : exit->text));
  return std::get<Config>(outcome);
}

std::string refusal(const ConfigOutcome& outcome) {
  const auto* exit = std::get_if<ConfigExit>(&outcome);
  REQUIRE(exit != nullptr);
  CHECK(exit->status == 2);
  return exit->text;
}

/// A file that is gone at the end of the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) {
    char name[] = "/tmp/pointwright-config-XXXXXX";
    const int descriptor = mkstemp(name);
    REQUIRE(descriptor >= 0);
    ::close(descriptor);
    path_ = name;
    std::ofstream(path_) << text;
  }
  ~TemporaryFile() { std::remove(path_.c_str()); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace

TEST_CASE("without any setting the defaults hold") {
  const Config config = good(read({}));
  CHECK(config == Config{});
  CHECK(config.host == "127.0.0.1");
  CHECK(config.port == 7878);
}

TEST_CASE(
    "the command line stands over the environment, the environment over the file, the file over the "
    "defaults") {
  const TemporaryFile file(
      "port = 1001\nlog_level = \"warn\"\nthreads = 3\n[limits]\nmax_samples = 11\nmax_clouds = 12\n"
      "max_sessions = 13\n");
  const Config config = good(read({"--config", file.path(), "--port", "1003", "--max-clouds", "32"},
                                  {{"POINTWRIGHT_PORT", "1002"},
                                   {"POINTWRIGHT_MAX_SAMPLES", "21"},
                                   {"POINTWRIGHT_MAX_CLOUDS", "22"},
                                   {"POINTWRIGHT_LOG_LEVEL", "error"}}));
  CHECK(config.port == 1003);
  CHECK(config.log_level == "error");
  CHECK(config.threads == 3);
  CHECK(config.limits.max_samples == 21);
  CHECK(config.limits.max_clouds == 32);
  CHECK(config.limits.max_sessions == 13);
  CHECK(config.limits.max_streams == Limits{}.max_streams);
}

TEST_CASE("the environment can name the file") {
  const TemporaryFile file("port = 4242\n");
  CHECK(good(read({}, {{"POINTWRIGHT_CONFIG", file.path()}})).port == 4242);
}

TEST_CASE("samples and allowed hosts can be given several times") {
  const Config config = good(read({"--sample", "a/dragon.drc=Stanford dragon", "--sample", "b.ply",
                                   "--allowed-hosts", "Scan.Example.org"}));
  REQUIRE(config.samples.size() == 2);
  CHECK(config.samples[0] == SampleFile{"a/dragon.drc", "Stanford dragon"});
  CHECK(config.samples[1] == SampleFile{"b.ply", "b.ply"});
  CHECK(config.allowed_hosts == std::vector<std::string>{"scan.example.org"});
  CHECK(good(read({}, {{"POINTWRIGHT_ALLOWED_HOSTS", "a.org,b.org"}})).allowed_hosts.size() == 2);
  CHECK(good(read({"--sample", "a=b/c.ply"})).samples[0] == SampleFile{"a=b/c.ply", "c.ply"});
  CHECK(good(read({"--sample", "a=b/c.ply=d"})).samples[0] == SampleFile{"a=b/c.ply", "d"});
  // Hosts are compared without a port: one that is given would never match.
  CHECK(refusal(read({"--allowed-hosts", "scan.example.org:8080"})).find("port") != std::string::npos);
  CHECK(refusal(read({"--allowed-hosts", "[fd00::1]:8080"})).find("port") != std::string::npos);
  CHECK(good(read({"--allowed-hosts", "[fd00::1]"})).allowed_hosts == std::vector<std::string>{"[fd00::1]"});
}

TEST_CASE("unknown options and keys are errors, unknown variables are kept for a warning") {
  CHECK(refusal(read({"--prot", "1"})).find("--prot") != std::string::npos);
  const Config config = good(read({}, {{"POINTWRIGHT_PROT", "1"}, {"POINTWRIGHT_PORT", "8"}}));
  CHECK(config.unknown_variables == std::vector<std::string>{"POINTWRIGHT_PROT"});
  CHECK(config.port == 8);
  const TemporaryFile top("prot = 1\n");
  CHECK(refusal(read({"--config", top.path()})).find("prot") != std::string::npos);
  const TemporaryFile below("[limits]\nmax_dragons = 1\n");
  CHECK(refusal(read({"--config", below.path()})).find("max_dragons") != std::string::npos);
  const TemporaryFile misplaced("max_samples = 5\n");
  CHECK(refusal(read({"--config", misplaced.path()})).find("max_samples") != std::string::npos);
}

TEST_CASE("wrong types, numbers out of range and broken files are errors") {
  for (const char* value : {"x", "-1", "70000", "1.5", "", "0x10", " 1"})
    CHECK_MESSAGE(
        refusal(read({}, {{"POINTWRIGHT_PORT", value}})).find("POINTWRIGHT_PORT") != std::string::npos,
        value);
  refusal(read({"--max-samples", "0"}));
  refusal(read({"--log-level", "loud"}));
  refusal(read({"--sample", "=name"}));
  refusal(read({"--config", "/nonexistent/file.toml"}));
  for (const char* text : {"port = \"80\"\n", "port = 1.5\n", "host = 5\n", "allow_remote = \"yes\"\n",
                           "port = \n", "allowed_hosts = \"a\"\n", "port = 1\nport = 2\n"}) {
    const TemporaryFile file(text);
    CHECK_MESSAGE(!refusal(read({"--config", file.path()})).empty(), text);
  }
}

TEST_CASE("an address beyond loopback must be asked for") {
  CHECK(refusal(read({"--host", "0.0.0.0"})).find("--tokens") != std::string::npos);
  CHECK(refusal(read({"--host", "0.0.0.0", "--allow-remote"})).find("--tokens") != std::string::npos);
  CHECK(refusal(read({"--host", "0.0.0.0", "--tokens", "t"})).find("--behind-proxy") != std::string::npos);
  CHECK(good(read({"--host", "0.0.0.0", "--tokens", "t", "--allow-remote"})).allow_remote);
  CHECK(good(read({"--host", "0.0.0.0", "--tokens", "t", "--behind-proxy"})).behind_proxy);
  CHECK(refusal(read({"--host", "0.0.0.0", "--tokens", "t"})).find("--tls-cert") != std::string::npos);
  const std::vector<std::string> tls = {"--host", "0.0.0.0", "--tls-cert", "c.pem", "--tls-key", "k.pem"};
  CHECK(refusal(read(tls)).find("--tokens") != std::string::npos);
  std::vector<std::string> with_tokens = tls;
  with_tokens.insert(with_tokens.end(), {"--tokens", "t"});
  CHECK(good(read(with_tokens)).tls_key == "k.pem");
  CHECK(refusal(read({"--tls-cert", "c.pem"})).find("tls_key") != std::string::npos);
  CHECK(refusal(read({}, {{"POINTWRIGHT_TLS_KEY", "k.pem"}})).find("tls_cert") != std::string::npos);
  CHECK(good(read({"--host", "127.0.0.2"})).host == "127.0.0.2");
  CHECK_FALSE(is_loopback("127.0.0.1.example.org"));
}

TEST_CASE("the printed settings read back to the same settings") {
  const Config config = good(read({"--port", "0", "--sample", "x \"y\".drc=a\\b", "--max-edits", "77",
                                   "--allow-remote", "--web", "web/dist", "--allowed-hosts", "a.org"}));
  const TemporaryFile file(to_toml(config));
  CHECK(good(read({"--config", file.path()})) == config);
  const auto printed = read({"--port", "0", "--print-config"});
  REQUIRE(std::holds_alternative<ConfigExit>(printed));
  CHECK(std::get<ConfigExit>(printed).status == 0);
  CHECK(std::get<ConfigExit>(printed).text.find("port = 0") != std::string::npos);
}

TEST_CASE("printed settings say where each came from") {
  const TemporaryFile file("port = 81\nweb = \"w\"\n[limits]\nmax_edits = 5\n");
  const auto printed =
      read({"--config", file.path(), "--port", "0", "--print-config"}, {{"POINTWRIGHT_MAX_SESSIONS", "7"}});
  REQUIRE(std::holds_alternative<ConfigExit>(printed));
  std::istringstream lines(std::get<ConfigExit>(printed).text);
  std::map<std::string, std::string> by_key;
  for (std::string line; std::getline(lines, line);) by_key[line.substr(0, line.find(' '))] = line;
  const auto says = [&](const std::string& key, const std::string& source) {
    return by_key[key].size() > source.size() + 2 &&
           by_key[key].substr(by_key[key].size() - source.size() - 2) == "(" + source + ")";
  };
  CHECK(says("port", "--port"));
  CHECK(says("web", file.path() + ":2"));
  CHECK(says("max_edits", file.path() + ":4"));
  CHECK(says("max_sessions", "POINTWRIGHT_MAX_SESSIONS"));
  CHECK(says("host", "default"));
}

TEST_CASE("origins are taken as browsers write them") {
  const Config config =
      good(read({"--cors-origins", "https://App.example:443", "--cors-origins", "http://[::1]:5173"}));
  CHECK(config.cors_origins == std::vector<std::string>{"https://app.example", "http://[::1]:5173"});
  for (const char* text :
       {"*", "null", "app.example", "https://", "ftp://a", "https://a/b", "https://a:0", "https://a:x"})
    CHECK_MESSAGE(!refusal(read({"--cors-origins", text})).empty(), text);
}

TEST_CASE("help and version are printed and exit well") {
  for (const char* flag : {"--help", "--version"}) {
    const auto outcome = read({flag});
    REQUIRE(std::holds_alternative<ConfigExit>(outcome));
    CHECK(std::get<ConfigExit>(outcome).status == 0);
    CHECK_FALSE(std::get<ConfigExit>(outcome).text.empty());
  }
}

TEST_CASE("every limit has a default within its own borders, a name of its own and a meaning") {
  const Limits defaults;
  for (const LimitInfo& info : limit_table()) {
    CHECK_MESSAGE(defaults.*info.member >= info.least, info.name);
    CHECK_MESSAGE(defaults.*info.member <= info.greatest, info.name);
    CHECK_FALSE(info.meaning.empty());
  }
  CHECK(limit_table().size() * sizeof(std::uint64_t) == sizeof(Limits));
}
