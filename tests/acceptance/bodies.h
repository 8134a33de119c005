#pragma once
// What stories send and get.

#include <doctest/doctest.h>

#include <span>
#include <string>

#include "engine/io/cloud_io.h"
#include "tests/server/synthetic.h"

namespace pointwright::test {

/// Operations that paint the two ends of a wavy sheet.
inline const std::string kLeft = R"({"mode":"add","shape":{"type":"box","min":[-1,-1,-1],"max":[0.2,2,1]}})";
inline const std::string kRight = R"({"mode":"add","shape":{"type":"box","min":[0.8,-1,-1],"max":[2,2,1]}})";

/// An edit of level 0; `more`: further members after a comma.
inline std::string translation(double z, const std::string& more = "") {
  return R"({"level":0,"blend":"quartic","deformation":{"type":"translation","vector":[0,0,)" +
         std::to_string(z) + "]}" + more + "}";
}

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
