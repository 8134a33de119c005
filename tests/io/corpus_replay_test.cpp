// What fuzzing found worth keeping, and the seeds it starts from: each through its target's code on every
// test run.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/fuzz/targets.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

namespace fs = std::filesystem;

std::size_t replay(const char* target, void (*run)(std::span<const std::byte>)) {
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(POINTWRIGHT_CORPUS_DIR) / target)) {
    CAPTURE(entry.path().string());
    std::ifstream file(entry.path(), std::ios::binary);
    CHECK_NOTHROW(run(bytes_of(std::string(std::istreambuf_iterator<char>(file), {}))));
    ++files;
  }
  return files;
}

TEST_CASE("the fuzzing corpus passes through every reader") {
  CHECK(replay("draco", fuzz::try_draco) > 0);
  CHECK(replay("draco_tiles", fuzz::try_draco_tiles) > 0);
  CHECK(replay("ply", fuzz::try_ply) > 0);
  CHECK(replay("xyz", fuzz::try_xyz) > 0);
  CHECK(replay("obj", fuzz::try_obj) > 0);
  CHECK(replay("pcd", fuzz::try_pcd) > 0);
  CHECK(replay("las", fuzz::try_las) > 0);
  CHECK(replay("cloud_blob", fuzz::try_cloud_blob) > 0);
}

}  // namespace
}  // namespace pointwright::io_test
