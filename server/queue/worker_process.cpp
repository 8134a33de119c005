#include "server/queue/worker_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>
#include <thread>

#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kLook{20};

/// When the process began, in ticks since the machine did: with its number, it is that process and no other.
/// Empty where there is none.
std::string beginning_of(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  if (!std::getline(file, text)) return {};
  // The second field is a name in brackets and may hold anything; the beginning is the twenty-second.
  constexpr int kFieldsAfterName = 20;
  std::istringstream rest(text.substr(std::min(text.rfind(')') + 1, text.size())));
  std::string field;
  for (int i = 0; i < kFieldsAfterName; ++i)
    if (!(rest >> field)) return {};
  return field;
}

bool is_gone(pid_t group) {
  return ::kill(-group, 0) != 0 && errno == ESRCH;
}

/// Whole lines out of what comes piece by piece.
class Lines {
 public:
  explicit Lines(const std::function<void(const std::string&)>& take) : take_(take) {}
  void add(std::string_view piece) {
    for (const char c : piece) {
      if (c == '\n')
        end();
      else if (line_.size() < WorkerProcess::kMostLineBytes)
        line_.push_back(c);
    }
  }
  void end() {
    if (!line_.empty()) take_(line_);
    line_.clear();
  }

 private:
  const std::function<void(const std::string&)>& take_;
  std::string line_;
};

}  // namespace

std::optional<WorkerProcess> WorkerProcess::start(const std::vector<std::string>& command,
                                                  const std::string& folder, int log,
                                                  const std::string& pid_file) {
  std::array<int, 2> ends{-1, -1};
  if (command.empty() || ::pipe2(ends.data(), O_CLOEXEC) != 0) return std::nullopt;
  Descriptor ours(ends[0]);
  const Descriptor theirs(ends[1]);
  const auto child = start_child({.program = command.front(),
                                  .arguments = command,
                                  .output = theirs.get(),
                                  .errors = log,
                                  .folder = folder,
                                  .leads_group = true,
                                  .inherits_environment = true});
  if (!child) return std::nullopt;
  const std::string text = std::to_string(*child) + " " + beginning_of(*child) + "\n";
  // Where this fails the next daemon does not find it: it then ends by itself.
  static_cast<void>(write_file_atomically(pid_file, std::as_bytes(std::span(text.data(), text.size()))));
  return WorkerProcess(*child, std::move(ours), pid_file);
}

ChildEnd WorkerProcess::run(const std::function<void(const std::string&)>& take,
                            const std::function<bool()>& must_end) {
  Lines lines(take);
  std::array<char, 1U << 16U> piece{};
  bool open = true;
  int status = 0;
  ChildEnd end;
  std::optional<Clock::time_point> asked;
  while (true) {
    const pid_t gone = ::waitpid(group_, &status, WNOHANG);
    const bool has_ended = gone == group_ || (gone < 0 && errno != EINTR);
    if (!has_ended && must_end()) {
      const bool first = !asked.has_value();
      if (first) asked = Clock::now();
      if (first) ::kill(-group_, SIGTERM);
      if (!first && Clock::now() - *asked > kGrace) ::kill(-group_, SIGKILL);
    }
    pollfd watched{.fd = output_.get(), .events = POLLIN, .revents = 0};
    const int wait = has_ended ? 0 : static_cast<int>(kLook.count());
    const int ready = ::poll(open ? &watched : nullptr, open ? 1 : 0, wait);
    const ssize_t count = ready > 0 ? ::read(output_.get(), piece.data(), piece.size()) : -1;
    if (count > 0) lines.add({piece.data(), static_cast<std::size_t>(count)});
    if (ready > 0 && count == 0) open = false;
    if (has_ended && count <= 0) break;
  }
  lines.end();
  ::kill(-group_, SIGKILL);  // what it may have left behind
  std::error_code none;
  std::filesystem::remove(pid_file_, none);
  end.by_cancel = asked.has_value();
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  if (WIFEXITED(status)) end.status = WEXITSTATUS(status);
  return end;
}

Descriptor open_job_log(const std::string& path) {
  return Descriptor(::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0600));
}

void end_left_worker(const std::string& pid_file) {
  std::ifstream file(pid_file);
  pid_t group = 0;
  std::string beginning;
  const bool is_known = static_cast<bool>(file >> group >> beginning) && group > 1;
  if (is_known && beginning == beginning_of(group)) {
    ::kill(-group, SIGKILL);
    for (int i = 0; i < 100 && !is_gone(group); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  std::error_code none;
  std::filesystem::remove(pid_file, none);
}

}  // namespace pointwright::server
