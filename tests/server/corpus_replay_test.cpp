// What fuzzing of the service's own parsers starts from and found worth keeping, on every test run.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/fuzz/targets.h"

namespace pointwright {
namespace {

std::size_t replay(const char* target, void (*run)(std::span<const std::byte>)) {
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(POINTWRIGHT_CORPUS_DIR) / target)) {
    CAPTURE(entry.path().string());
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(file), {});
    CHECK_NOTHROW(run(std::as_bytes(std::span(bytes))));
    ++files;
  }
  return files;
}

TEST_CASE("the fuzzing corpus passes through the readers of heads, answers and marks") {
  CHECK(replay("head", fuzz::try_head) >= 8);
  CHECK(replay("answer", fuzz::try_answer) >= 5);
  CHECK(replay("marks", fuzz::try_marks) >= 5);
}

}  // namespace
}  // namespace pointwright
