#pragma once
// Real scans, where POINTWRIGHT_DATA names a folder with them (they are not ours to pass on).

#include <doctest/doctest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "engine/io/cloud_io.h"

namespace pointwright::test {

/// The scan of this file name, a PLY, as the importer leaves it; says so where it is not there.
inline std::optional<Cloud> real_scan(std::string_view name) {
  const char* folder = std::getenv("POINTWRIGHT_DATA");
  if (folder == nullptr) {
    MESSAGE("POINTWRIGHT_DATA is not set: no scans");
    return {};
  }
  const std::filesystem::path path = std::filesystem::path(folder) / name;
  if (!std::filesystem::exists(path)) {
    MESSAGE("not there, left out: " << std::string(name));
    return {};
  }
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  auto read = read_cloud(std::as_bytes(std::span(bytes)), CloudFormat::kPly, {});
  REQUIRE(read.ok());
  return std::move(read).value().cloud;
}

}  // namespace pointwright::test
