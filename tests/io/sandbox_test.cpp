#include "server/ingest/sandbox.h"

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <csignal>

#include "server/ingest/child_process.h"

namespace pointwright {
namespace {

ChildEnd run(const char* misdeed, double deadline = 20.0, const ExecutionContext* context = nullptr) {
  const Descriptor input(memfd_create("input", MFD_CLOEXEC));
  const Descriptor output(memfd_create("output", MFD_CLOEXEC));
  std::array<int, 2> ends{-1, -1};
  REQUIRE(pipe2(ends.data(), O_CLOEXEC) == 0);
  const Descriptor alive(ends[0]);
  Descriptor held(ends[1]);
  const auto child = start_child({.program = POINTWRIGHT_TEST_DECODER,
                                  .arguments = {"decoder", misdeed},
                                  .descriptors = {input.get(), output.get(), held.get()}});
  REQUIRE(child.has_value());
  held.close();
  return wait_for_child(*child, alive, std::chrono::duration<double>(deadline), context);
}

TEST_CASE("a confined process that opens, connects, forks, kills, runs or writes code dies of it") {
  if (kSanitizedBuild) return;
  for (const char* misdeed : {"--open", "--socket", "--fork", "--kill", "--execute", "--code"}) {
    CAPTURE(misdeed);
    CHECK(run(misdeed).signal == SIGSYS);
  }
}

TEST_CASE("a confined process has so much time, memory and output and no more") {
  CHECK(run("--spin").signal != 0);
  if (kSanitizedBuild) return;
  CHECK(run("--memory").status == 20);  // std::bad_alloc, not the machine's last page
  CHECK(run("--output").signal == SIGXFSZ);
}

TEST_CASE("a child has no descriptor but its own") {
  const Descriptor secret(open("/dev/null", O_RDONLY));  // without close-on-exec, as a library might
  REQUIRE(secret.is_open());
  CHECK(run("--descriptors").status == 0);
}

TEST_CASE("a child that overstays is killed, and so is one whose work was cancelled") {
  const ChildEnd late = run("--spin", 0.2);
  CHECK(late.by_deadline);
  CHECK(late.signal == SIGKILL);
  const ExecutionContext context;
  context.cancel();
  const ChildEnd cancelled = run("--spin", 20.0, &context);
  CHECK(cancelled.by_cancel);
  CHECK(cancelled.signal == SIGKILL);
}

TEST_CASE("a program that is not there does not start") {
  const Descriptor null(open("/dev/null", O_RDWR | O_CLOEXEC));
  CHECK_FALSE(start_child({.program = "/nonexistent/program",
                           .arguments = {"decoder", "--decode-child"},
                           .descriptors = {null.get(), null.get(), null.get()}})
                  .has_value());
}

}  // namespace
}  // namespace pointwright
