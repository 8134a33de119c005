#include "server/ingest/sandbox.h"

#include <fcntl.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <csignal>
#include <cstddef>

namespace pointwright {
namespace {

bool lower_limit(decltype(RLIMIT_AS) which, std::uint64_t value) {
  rlimit now{};
  if (getrlimit(which, &now) != 0) return false;
  const rlim_t wanted = std::min<rlim_t>(value, now.rlim_max);
  const rlimit next{.rlim_cur = wanted, .rlim_max = wanted};
  return setrlimit(which, &next) == 0;
}

}  // namespace

std::uint64_t address_space_bytes() {
  const int file = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  if (file < 0) return 0;
  std::array<char, 64> text{};
  const ssize_t length = read(file, text.data(), text.size());
  close(file);
  std::uint64_t pages = 0;
  if (length <= 0 || std::from_chars(text.data(), text.data() + length, pages).ec != std::errc()) return 0;
  return pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

bool limit_address_space(std::uint64_t base, std::uint64_t extra) {
  if (kSanitizedBuild) return true;
  return base > 0 && lower_limit(RLIMIT_AS, base + extra);
}

bool limit_resources(std::uint64_t cpu_seconds, std::uint64_t output_bytes) {
  return prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && lower_limit(RLIMIT_CPU, cpu_seconds) &&
         lower_limit(RLIMIT_FSIZE, output_bytes) && lower_limit(RLIMIT_CORE, 0) &&
         (kSanitizedBuild || lower_limit(RLIMIT_NPROC, 0));
}

bool forbid_system_calls() {
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  if (kSanitizedBuild) return true;
  constexpr std::array kAllowed{SCMP_SYS(read),         SCMP_SYS(write),        SCMP_SYS(munmap),
                                SCMP_SYS(mremap),       SCMP_SYS(brk),          SCMP_SYS(madvise),
                                SCMP_SYS(exit),         SCMP_SYS(exit_group),   SCMP_SYS(close),
                                SCMP_SYS(futex),        SCMP_SYS(rt_sigreturn), SCMP_SYS(rt_sigprocmask),
                                SCMP_SYS(rt_sigaction), SCMP_SYS(getpid),       SCMP_SYS(gettid),
                                SCMP_SYS(tgkill),       SCMP_SYS(getrandom),    SCMP_SYS(clock_gettime)};
  scmp_filter_ctx filter = seccomp_init(SCMP_ACT_KILL_PROCESS);
  if (filter == nullptr) return false;
  bool good = true;
  for (const int call : kAllowed) good = good && seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0) == 0;
  // Memory that is not executable; lowering our own limits further.
  const scmp_arg_cmp not_executable = SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0);
  const scmp_arg_cmp ourselves = SCMP_A0(SCMP_CMP_EQ, 0);
  for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)}) {
    good = good && seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1, not_executable) == 0;
  }
  good = good && seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(prlimit64), 1, ourselves) == 0;
  good = good && seccomp_load(filter) == 0;
  seccomp_release(filter);
  return good;
}

}  // namespace pointwright
