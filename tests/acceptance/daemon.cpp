#include "tests/acceptance/daemon.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "tests/server/raw_client.h"

namespace pointwright::test {
namespace {

std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

/// As execve() takes them; they live as long as the strings.
std::vector<char*> pointers_to(const std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  for (const std::string& text : strings) pointers.push_back(const_cast<char*>(text.c_str()));  // NOLINT
  return pointers;
}

pid_t start(const std::vector<std::string>& command, const std::string& out, const std::string& err,
            const std::vector<std::string>& environment = {}) {
  std::vector<char*> arguments = pointers_to(command);
  arguments.push_back(nullptr);
  std::vector<char*> variables = pointers_to(environment);
  for (char** variable = environ; *variable != nullptr; ++variable) variables.push_back(*variable);
  variables.push_back(nullptr);
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error("cannot fork");
  if (child > 0) return child;
  const int out_file = ::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int err_file = ::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::dup2(out_file, 1);
  ::dup2(err_file, 2);
  ::execve(arguments[0], arguments.data(), variables.data());
  ::_exit(127);
}

/// The exit status as in Ended; nullopt while it runs.
std::optional<int> poll_end(pid_t child) {
  int status = 0;
  if (::waitpid(child, &status, WNOHANG) != child) return std::nullopt;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int wait_end(pid_t child, std::chrono::seconds deadline) {
  const auto until = std::chrono::steady_clock::now() + deadline;
  while (std::chrono::steady_clock::now() < until) {
    if (const auto status = poll_end(child)) return *status;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  return -1;
}

std::string joined_chunks(std::string_view text) {
  std::string body;
  while (true) {
    const std::size_t end = text.find("\r\n");
    if (end == std::string_view::npos) return body;
    const std::size_t size = std::stoul(std::string(text.substr(0, end)), nullptr, 16);
    if (size == 0 || end + 2 + size > text.size()) return body;
    body.append(text.substr(end + 2, size));
    text.remove_prefix(std::min(end + 2 + size + 2, text.size()));
  }
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  char name[] = "/tmp/pointwright-test-XXXXXX";
  if (::mkdtemp(name) == nullptr) throw std::runtime_error("cannot make a temporary folder");
  path_ = name;
}
TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

Ended run(const std::vector<std::string>& command, std::chrono::seconds deadline) {
  const TemporaryFolder folder;
  const pid_t child = start(command, folder / "out", folder / "err");
  Ended ended;
  ended.status = wait_end(child, deadline);
  ended.out = text_of(folder / "out");
  ended.err = text_of(folder / "err");
  return ended;
}

Reply parse_reply(const std::string& bytes) {
  Reply reply{.status = status_of(bytes)};
  const std::size_t head_end = bytes.find("\r\n\r\n");
  if (reply.status == 0 || head_end == std::string::npos) return reply;
  std::istringstream head(bytes.substr(0, head_end));
  for (std::string line; std::getline(head, line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos) continue;
    std::string name = line.substr(0, colon);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    std::string value = line.substr(std::min(colon + 2, line.size()));
    if (!value.empty() && value.back() == '\r') value.pop_back();
    reply.headers[name] = value;
  }
  reply.body = bytes.substr(head_end + 4);
  if (reply.headers.count("transfer-encoding") > 0) reply.body = joined_chunks(reply.body);
  return reply;
}

Daemon::Daemon(const std::vector<std::string>& arguments, const std::vector<std::string>& environment) {
  std::vector<std::string> command = {POINTWRIGHTD_PATH, "--port", "0", "--port-file", folder_ / "port"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  pid_ = start(command, folder_ / "out", folder_ / "err", environment);
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (port_ == 0) {
    const std::string text = text_of(folder_ / "port");
    if (!text.empty() && text.back() == '\n') port_ = static_cast<std::uint16_t>(std::stoi(text));
    if (port_ == 0 && (!is_alive() || std::chrono::steady_clock::now() > until))
      throw std::runtime_error("the daemon does not start: " + log());
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

Daemon::~Daemon() {
  if (is_alive()) stop(SIGKILL);
}

bool Daemon::is_alive() {
  if (!ended_) ended_ = poll_end(pid_);
  return !ended_;
}

std::string Daemon::log() const {
  return text_of(folder_ / "err");
}

std::size_t Daemon::descriptors() const {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/" + std::to_string(pid_) + "/fd")) {
    (void)entry;
    ++count;
  }
  return count;
}

std::size_t Daemon::resident_kilobytes() const {
  std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmRSS:", 0) == 0) return std::stoul(line.substr(6));
  return 0;
}

int Daemon::stop(int signal, std::chrono::seconds deadline) {
  if (!is_alive()) return *ended_;
  ::kill(pid_, signal);
  ended_ = wait_end(pid_, deadline);
  return *ended_;
}

Reply Daemon::ask(const std::string& method, const std::string& target, const std::string& body,
                  const std::string& headers) {
  std::string request = method + " " + target + " HTTP/1.1\r\nHost: localhost\r\n" + headers;
  if (!body.empty() || method == "POST" || method == "PUT") {
    if (headers.find("Content-Type") == std::string::npos) request += "Content-Type: application/json\r\n";
    request += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  }
  RawClient client(port_);
  client.send(request + "\r\n" + body);
  return parse_reply(client.receive_all(std::chrono::minutes(2)));
}

Reply Daemon::upload(const std::string& bytes, const std::string& type, const std::string& query) {
  return ask("POST", "/v1/clouds" + query, bytes, "Content-Type: " + type + "\r\n");
}

std::string Daemon::open_session(const std::string& cloud, const std::string& scales) {
  const Reply made = ask("POST", "/v1/sessions", R"({"cloud":")" + cloud + R"(","scales":)" + scales + "}");
  if (made.status != 202) throw std::runtime_error("no session: " + made.body);
  std::string path = made.headers.at("location");
  const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(3);
  while (std::chrono::steady_clock::now() < until) {
    const std::string state = get(path).json().value("state", "");
    if (state == "ready") return path;
    if (state == "failed") throw std::runtime_error("the session failed");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  throw std::runtime_error("the session does not become ready");
}

}  // namespace pointwright::test
