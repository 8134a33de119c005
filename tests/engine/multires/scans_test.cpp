// Real scans, where POINTWRIGHT_DATA names a folder with them (they are not ours to pass on).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>

#include "engine/io/cloud_io.h"
#include "engine/multires/hierarchy.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// At most this many samples; a few per cent above what was measured at the default scale, 0.02.
struct Scan {
  const char* file;
  std::size_t at_limit;
  std::size_t fallback;
  std::size_t flipped;
};
constexpr Scan kScans[] = {
    {"igea.ply", 2, 4, 4},
    {"bunny.ply", 3, 30, 30},
    {"bunny_scans_raw.ply", 560, 2'250, 1'850},  // ten overlapping scans, outliers at their borders
    {"vol_total.ply", 70, 1'300, 1'260},         // trees
    {"csite2_lidar.ply", 4'200, 28'000, 24'600}  // from the air: roofs and ground, no walls
};

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// The largest |p - (r + d n)|; infinite where anything is not finite.
double identity_error(const MultiresSurface& surface) {
  const Level& base = surface.levels.front();
  double worst = 0.0;
  for (std::size_t i = 0; i < surface.sample_count(); ++i) {
    const Vec3d again = base.position[i].cast<double>() +
                        static_cast<double>(surface.detail.front()[i]) * base.normal[i].cast<double>();
    const double error = (again - surface.finest().position[i].cast<double>()).norm();
    if (!std::isfinite(error) || !surface.finest().normal[i].allFinite()) return HUGE_VAL;
    worst = std::max(worst, error);
  }
  return worst;
}

TEST_CASE("known scans are decomposed with no more failures than measured") {
  const char* folder = std::getenv("POINTWRIGHT_DATA");
  if (folder == nullptr) {
    MESSAGE("POINTWRIGHT_DATA is not set: no scans to decompose");
    return;
  }
  for (const Scan& scan : kScans) {
    CAPTURE(scan.file);
    const std::filesystem::path path = std::filesystem::path(folder) / scan.file;
    if (!std::filesystem::exists(path)) {
      MESSAGE("not there, left out: " << scan.file);
      continue;
    }
    const std::string bytes = bytes_of(path);
    const auto read = read_cloud(std::as_bytes(std::span(bytes)), CloudFormat::kPly, {});
    REQUIRE(read.ok());
    const Cloud& cloud = read.value().cloud;
    const auto built = build_hierarchy(cloud, {}, {});
    REQUIRE(built.ok());
    const DecompositionReport& report = built.value().reports[0];
    const auto diagonal = static_cast<double>(bounds_of(cloud.position).diagonal());
    CHECK(report.at_limit <= scan.at_limit);
    CHECK(report.fallback <= scan.fallback);
    CHECK(report.flipped <= scan.flipped);
    CHECK(relative_error(static_cast<double>(report.scale), 0.02 * diagonal) < 0.02);
    CHECK(built.value().surface.finest().position == cloud.position);
    CHECK(all_finite(built.value().surface.levels.front().normal));
    CHECK(identity_error(built.value().surface) < 1e-6 * diagonal);
  }
}

}  // namespace
}  // namespace pointwright
