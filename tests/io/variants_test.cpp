// Files of other programs, where POINTWRIGHT_DATA names a folder with them (they are not ours to pass on).
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

namespace fs = std::filesystem;

std::vector<std::byte> bytes_in(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return bytes_of(std::string(std::istreambuf_iterator<char>(file), {}));
}

TEST_CASE("files that other programs wrote are read, or refused with a reason, and come back to the bit") {
  const char* folder = std::getenv("POINTWRIGHT_DATA");
  if (folder == nullptr) {
    MESSAGE("POINTWRIGHT_DATA is not set: no files of other programs to try");
    return;
  }
  std::size_t read_files = 0;
  for (const auto& entry :
       fs::recursive_directory_iterator(folder, fs::directory_options::follow_directory_symlink)) {
    constexpr std::array kEndings{".ply", ".drc", ".xyz", ".pwn", ".las", ".off"};
    if (!entry.is_regular_file() ||
        std::find(kEndings.begin(), kEndings.end(), entry.path().extension()) == kEndings.end()) {
      continue;
    }
    CAPTURE(entry.path().string());
    const auto bytes = bytes_in(entry.path());
    const auto format = detect_format(bytes);
    if (!format.ok()) {
      CHECK(format.error().code == ErrorCode::kUnsupportedFormat);
      continue;
    }
    const auto read = read_cloud(bytes, format.value(), {.drop_non_finite = true});
    if (!read.ok()) {
      CHECK_FALSE(read.error().message.empty());
      continue;
    }
    ++read_files;
    const Cloud& cloud = read.value().cloud;
    CHECK(validate(cloud).ok());
    CHECK(difference(through(cloud, CloudFormat::kPly).cloud, cloud) == "");
    CHECK(difference(through(cloud, CloudFormat::kPly, {.ascii = true}).cloud, cloud) == "");
    CHECK(difference(through(cloud, CloudFormat::kDraco).cloud, cloud) == "");
  }
  CHECK(read_files > 0);
}

}  // namespace
}  // namespace pointwright::io_test
