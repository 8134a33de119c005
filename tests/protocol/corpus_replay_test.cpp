// The seeds of the protocol's fuzzing targets and what was found worth keeping: each through its target's
// code on every test run. The golden documents are seeds of the JSON target.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/fuzz/targets.h"

namespace pointwright::fuzz {
namespace {

namespace fs = std::filesystem;

std::size_t replay(const fs::path& folder, void (*run)(std::span<const std::byte>)) {
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(POINTWRIGHT_SOURCE_DIR) / folder)) {
    CAPTURE(entry.path().string());
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(file), {});
    CHECK_NOTHROW(run(std::as_bytes(std::span(bytes))));
    ++files;
  }
  return files;
}

TEST_CASE("the fuzzing corpus passes through the decoders of the protocol") {
  CHECK(replay("tests/fuzz/corpus/frame", try_frame) > 0);
  CHECK(replay("tests/fuzz/corpus/stream", try_stream) > 0);
  CHECK(replay("tests/fuzz/corpus/json", try_json) > 0);
  CHECK(replay("protocol/examples", try_json) > 0);
}

}  // namespace
}  // namespace pointwright::fuzz
