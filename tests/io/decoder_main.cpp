// The decoder as a program of its own, and one misdeed for each thing that the sandbox forbids.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>
#include <string_view>
#include <vector>

#include "server/ingest/confined.h"
#include "server/ingest/sandbox.h"

namespace {

using namespace pointwright;

// 0: the misdeed went through. Reached only where the sandbox has a hole.
int misdeed(std::string_view name) {
  if (name == "--open") return open("/etc/hostname", O_RDONLY) >= 0 ? 0 : 10;
  if (name == "--socket") return socket(AF_INET, SOCK_STREAM, 0) >= 0 ? 0 : 10;
  if (name == "--fork") return fork() >= 0 ? 0 : 10;
  if (name == "--kill") return kill(getppid(), SIGTERM) == 0 ? 0 : 10;
  if (name == "--execute") {
    char program[] = "/bin/true";
    char* arguments[] = {program, nullptr};
    execv(program, arguments);
    return 10;
  }
  if (name == "--code") {
    void* page = mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return page != MAP_FAILED ? 0 : 10;
  }
  if (name == "--spin") {
    for (std::atomic<unsigned long> i = 0;; ++i) {
    }
  }
  if (name == "--memory") {
    std::vector<char> much(std::size_t{1} << 30);
    return much[12345] == 0 ? 0 : 10;
  }
  if (name == "--output") {
    const std::vector<char> page(std::size_t{1} << 20);
    for (int i = 0; i < 100; ++i) {
      if (write(4, page.data(), page.size()) < 0) return 10;
    }
    return 0;
  }
  if (name == "--descriptors") {
    for (int number = 6; number < 1024; ++number) {
      if (fcntl(number, F_GETFD) >= 0) return 11;
    }
    return 0;
  }
  return 12;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 13;
  const std::string_view name(argv[1]);
  if (name == kDecodeChildArgument) return decode_child_main();
  if (name == "--descriptors") return misdeed(name);
  const bool confined = limit_resources(name == "--spin" ? 1 : 10, std::uint64_t{4} << 20) &&
                        limit_address_space(address_space_bytes(), std::uint64_t{64} << 20) &&
                        forbid_system_calls();
  if (!confined) return 14;
  try {
    return misdeed(name);
  } catch (const std::bad_alloc&) {
    return 20;
  }
}
