#include "server/ingest/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <string_view>
#include <utility>
#include <vector>

#include "server/ingest/sandbox.h"

namespace pointwright {
namespace {

constexpr int kFarDescriptor = 64;  // above every number that the child's own descriptors get
constexpr std::chrono::milliseconds kLook{50};

// What a child may need to start at all; our settings (tokens!) never go to it.
std::vector<char*> child_environment(bool inherits) {
  constexpr std::array<std::string_view, 6> kPassed{
      "LD_LIBRARY_PATH=", "ASAN_OPTIONS=",      "UBSAN_OPTIONS=",
      "TSAN_OPTIONS=",    "LLVM_PROFILE_FILE=", "LSAN_OPTIONS="};
  std::vector<char*> result;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    const bool is_passed = inherits ? !text.starts_with("POINTWRIGHT_")
                                    : std::any_of(kPassed.begin(), kPassed.end(),
                                                  [&](auto name) { return text.starts_with(name); });
    if (is_passed) result.push_back(*entry);
  }
  result.push_back(nullptr);
  return result;
}

// posix_spawn's two bundles, destroyed whatever happens.
struct SpawnPlan {
  posix_spawn_file_actions_t actions{};
  posix_spawnattr_t attributes{};
  bool good = true;

  SpawnPlan() {
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }
  void require(int error) { good = good && error == 0; }
};

void reset_signals(SpawnPlan& plan, bool leads_group) {
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  plan.require(posix_spawnattr_setsigmask(&plan.attributes, &none));
  plan.require(posix_spawnattr_setsigdefault(&plan.attributes, &all));
  const int group = leads_group ? POSIX_SPAWN_SETPGROUP : 0;
  plan.require(posix_spawnattr_setpgroup(&plan.attributes, 0));
  plan.require(posix_spawnattr_setflags(
      &plan.attributes, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | group)));
}

void give(SpawnPlan& plan, const Descriptor& ours, int number, int flags) {
  if (ours.is_open())
    plan.require(posix_spawn_file_actions_adddup2(&plan.actions, ours.get(), number));
  else
    plan.require(posix_spawn_file_actions_addopen(&plan.actions, number, "/dev/null", flags, 0));
}

}  // namespace

std::optional<pid_t> start_child(const ChildPlan& wanted) {
  // Copies far up: dup2 onto 1, 2, 3, … must not hit one that is still to be copied.
  const auto far_copy = [](int descriptor) {
    return Descriptor(fcntl(descriptor, F_DUPFD_CLOEXEC, kFarDescriptor));
  };
  std::vector<Descriptor> far;
  for (const int descriptor : wanted.descriptors) {
    far.push_back(far_copy(descriptor));
    if (!far.back().is_open()) return std::nullopt;
  }
  const Descriptor output = wanted.output < 0 ? Descriptor() : far_copy(wanted.output);
  const Descriptor errors = wanted.errors < 0 ? Descriptor() : far_copy(wanted.errors);
  if ((wanted.output >= 0 && !output.is_open()) || (wanted.errors >= 0 && !errors.is_open()))
    return std::nullopt;

  SpawnPlan plan;
  reset_signals(plan, wanted.leads_group);
  give(plan, Descriptor(), STDIN_FILENO, O_RDONLY);
  give(plan, output, STDOUT_FILENO, O_WRONLY);
  // A sanitizer's report is worth having.
  if (errors.is_open() || !kSanitizedBuild) give(plan, errors, STDERR_FILENO, O_WRONLY);
  for (std::size_t i = 0; i < far.size(); ++i)
    plan.require(posix_spawn_file_actions_adddup2(&plan.actions, far[i].get(), static_cast<int>(3 + i)));
  plan.require(posix_spawn_file_actions_addclosefrom_np(&plan.actions, static_cast<int>(3 + far.size())));
  if (!wanted.folder.empty())
    plan.require(posix_spawn_file_actions_addchdir_np(&plan.actions, wanted.folder.c_str()));
  if (!plan.good) return std::nullopt;
  std::vector<std::string> texts = wanted.arguments;
  std::vector<char*> arguments;
  arguments.reserve(texts.size() + 1);
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);
  std::vector<char*> environment = child_environment(wanted.inherits_environment);
  pid_t child = 0;
  const auto start = wanted.program.find('/') == std::string::npos ? posix_spawnp : posix_spawn;
  if (start(&child, wanted.program.c_str(), &plan.actions, &plan.attributes, arguments.data(),
            environment.data()) != 0)
    return std::nullopt;
  return child;
}

ChildEnd wait_for_child(pid_t child, const Descriptor& alive, std::chrono::duration<double> deadline,
                        const ExecutionContext* context) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(deadline);
  ChildEnd result;
  int status = 0;
  bool closed = false;
  while (true) {
    const pid_t gone = waitpid(child, &status, WNOHANG);
    if (gone == child || (gone < 0 && errno != EINTR)) break;
    result.by_cancel = context != nullptr && context->is_cancelled();
    result.by_deadline = !result.by_cancel && Clock::now() >= end;
    if (result.by_cancel || result.by_deadline) {
      kill(child, SIGKILL);
      while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      break;
    }
    // The pipe wakes us the moment the child is gone; a child that closed it and lives on is looked at now
    // and then.
    pollfd watched{.fd = alive.get(), .events = POLLIN, .revents = 0};
    const int ready =
        poll(closed ? nullptr : &watched, closed ? 0 : 1, closed ? 1 : static_cast<int>(kLook.count()));
    closed = closed || ready > 0;
  }
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  if (WIFEXITED(status)) result.status = WEXITSTATUS(status);
  return result;
}

}  // namespace pointwright
