#pragma once
// Jobs on small scans in a folder of the test's own.

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "engine/io/cloud_io.h"
#include "protocol/json/parse.h"
#include "server/ingest/files.h"
#include "server/jobs/full_resolution.h"
#include "tests/server/synthetic.h"
#include "tests/server/temporary_folder.h"

namespace pointwright::test {

inline std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline void put(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

inline void put(const std::string& path, const Cloud& cloud, CloudFormat format = CloudFormat::kPly,
                const ExportParams& params = {}) {
  const auto bytes = write_cloud(cloud, format, params);
  REQUIRE(bytes.ok());
  REQUIRE(write_file_atomically(path, bytes.value()).ok());
}

inline Cloud cloud_of(const std::string& path) {
  const auto bytes = read_file(path);
  REQUIRE(bytes.ok());
  const auto format = detect_format(bytes.value());
  REQUIRE(format.ok());
  auto read = read_cloud(bytes.value(), format.value(), {});
  REQUIRE(read.ok());
  return in_caller_order(read.value().cloud);
}

/// Lifts the right of the sheet on level 0, then turns it on level 1; its left stays.
inline protocol::RecipeRequest lifting(std::size_t edits = 2) {
  protocol::RecipeRequest request;
  request.recipe.level_scales = {0.11, 0.05, 0.0};
  protocol::RecipeEdit edit{.paints = true, .zero = {left_of(0.3)}, .one = {right_of(0.7)}};
  edit.edit.deformation.steps = {Translation{.vector = {0.0, 0.05, 0.3}}};
  if (edits > 0) request.recipe.edits.push_back(edit);
  edit.edit.level = 1;
  edit.edit.deformation.steps = {
      Rotation{.point = Vec3d(0.7, 0.5, 0.3), .axis = {0, 1, 0}, .angle_rad = protocol::to_radians(25.0)}};
  if (edits > 1) request.recipe.edits.push_back(edit);
  return request;
}

struct JobFolder {
  TemporaryFolder folder;
  std::string in = folder / "in.ply";
  std::string out = folder / "out.ply";

  [[nodiscard]] server::JobParams params(std::size_t edits = 2) const {
    return {.input = in,
            .output = out,
            .folder = folder / "job",
            .request = lifting(edits),
            .preview = nullptr,
            .preview_count = 2500,
            .neighbors = 10,
            .memory_bytes = std::uint64_t{1} << 20U,
            .mode = {}};
  }
  server::JobReport run(const server::JobParams& params) const {
    const auto report =
        server::run_full_resolution(params, ExecutionContext(), [](const std::string&, double) {});
    REQUIRE_MESSAGE(report.ok(), (report.ok() ? "" : report.problem().detail));
    CHECK_FALSE(std::filesystem::exists(params.folder));
    return report.value();
  }
  protocol::Problem refused(const server::JobParams& params) const {
    const auto report =
        server::run_full_resolution(params, ExecutionContext(), [](const std::string&, double) {});
    REQUIRE_FALSE(report.ok());
    CHECK_FALSE(std::filesystem::exists(params.output));
    return report.problem();
  }
};

}  // namespace pointwright::test
