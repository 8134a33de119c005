#pragma once
// The real daemon in a process of its own, on a free port, and requests to it.

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace pointwright::test {

/// A folder that is gone at the end of the test.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// How a process ended, and what it wrote.
struct Ended {
  /// Exit status; 128 + signal where one ended it; -1 where it had to be killed at the deadline.
  int status = -1;
  std::string out;
  std::string err;
};

/// Runs a program to its end.
Ended run(const std::vector<std::string>& command, std::chrono::seconds deadline = std::chrono::seconds(60));

struct Reply {
  int status = 0;                              ///< 0: no answer came
  std::map<std::string, std::string> headers;  ///< names in lower case
  std::string body;                            ///< chunks put together
  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(body, nullptr, false); }
};

class Daemon {
 public:
  /// Starts it with further arguments, and "NAME=value" beside the environment of the test, and waits until
  /// it answers. Throws std::runtime_error with its log where it does not.
  explicit Daemon(const std::vector<std::string>& arguments = {},
                  const std::vector<std::string>& environment = {});
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] bool is_alive();
  [[nodiscard]] std::string log() const;
  [[nodiscard]] std::size_t descriptors() const;
  [[nodiscard]] std::size_t resident_kilobytes() const;

  /// Sends the signal and waits; the exit status as in Ended.
  int stop(int signal, std::chrono::seconds deadline = std::chrono::seconds(15));

  Reply ask(const std::string& method, const std::string& target, const std::string& body = "",
            const std::string& headers = "");
  Reply get(const std::string& target, const std::string& headers = "") {
    return ask("GET", target, "", headers);
  }
  Reply upload(const std::string& bytes, const std::string& type = "application/octet-stream",
               const std::string& query = "?name=test");
  /// The path of a session on the cloud, ready.
  std::string open_session(const std::string& cloud, const std::string& scales = "[0.05]");

 private:
  TemporaryFolder folder_;
  pid_t pid_ = -1;
  std::uint16_t port_ = 0;
  std::optional<int> ended_;
};

/// An answer's bytes as status, headers and body.
Reply parse_reply(const std::string& bytes);

}  // namespace pointwright::test
