#pragma once
// Clouds as the files that stories send and get.

#include <doctest/doctest.h>

#include <span>
#include <string>

#include "engine/io/cloud_io.h"

namespace pointwright::test {

inline std::string file_of(const Cloud& cloud, CloudFormat format = CloudFormat::kPly) {
  const auto file = write_cloud(cloud, format, {});
  REQUIRE(file.ok());
  return {reinterpret_cast<const char*>(file.value().data()), file.value().size()};
}

inline Cloud cloud_of(const std::string& bytes) {
  auto read = read_cloud(std::as_bytes(std::span(bytes.data(), bytes.size())), CloudFormat::kPly, {});
  REQUIRE(read.ok());
  return in_caller_order(read.value().cloud);
}

}  // namespace pointwright::test
