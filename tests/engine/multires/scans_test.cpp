// Decomposition of real scans (tests/support/scans.h).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/multires/hierarchy.h"
#include "tests/support/scans.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// At most this many samples of all three bands together, and at most so far do base points part, as a
// multiple of their samples' distance, for all but a thousandth of the pairs of neighbours: a few per cent
// above what was measured.
struct Scan {
  std::string_view file;
  std::size_t at_limit;
  std::size_t fallback;
  std::size_t flipped;
  double stretch;
};
constexpr Scan kScans[] = {
    {"igea.ply", 2, 4, 4, 1.05},
    {"bunny.ply", 12, 120, 115, 1.12},
    {"bunny_scans_raw.ply", 1'050, 4'900, 4'100, 5.0},   // ten overlapping scans, outliers at their borders
    {"vol_total.ply", 330, 2'050, 1'850, 4.5},           // trees
    {"csite2_lidar.ply", 6'600, 34'500, 29'500, 240.0},  // from the air: roofs and ground, no walls
    {"church.ply", 33'500, 116'000, 90'000,
     16.5}  // 2.6 million samples, photogrammetry, flats and thin parts
};

// The largest |p_{k+1} - (p_k + d_k n_k)| of any band; infinite where anything is not finite.
double identity_error(const MultiresSurface& surface) {
  double worst = 0.0;
  for (std::size_t band = 0; band < surface.band_count(); ++band) {
    const Level& base = surface.levels[band];
    for (std::size_t i = 0; i < surface.sample_count(); ++i) {
      const Vec3d again = base.position[i].cast<double>() +
                          static_cast<double>(surface.detail[band][i]) * base.normal[i].cast<double>();
      const double error = (again - surface.levels[band + 1].position[i].cast<double>()).norm();
      if (!std::isfinite(error) || !base.normal[i].allFinite()) return HUGE_VAL;
      worst = std::max(worst, error);
    }
  }
  return worst;
}

// The 99.9th percentile of |dr| / |dp| over all samples and their nearest neighbours, of the finest band.
double base_stretch(const MultiresSurface& surface, const NeighborGraph& graph) {
  const Points& p = surface.finest().position;
  const Points& r = surface.levels[surface.band_count() - 1].position;
  std::vector<float> ratio;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const std::uint32_t j = graph.index(i, 0);
    ratio.push_back((r[i] - r[j]).norm() / (p[i] - p[j]).norm());
  }
  const auto place = ratio.begin() + static_cast<std::ptrdiff_t>(ratio.size() * 999 / 1000);
  std::nth_element(ratio.begin(), place, ratio.end());
  return static_cast<double>(*place);
}

TEST_CASE("known scans are decomposed with no more failures than measured") {
  for (const Scan& scan : kScans) {
    CAPTURE(scan.file);
    const std::optional<Cloud> found = real_scan(scan.file);
    if (!found) continue;
    const Cloud& cloud = *found;
    const std::vector<float> scales{0.04F, 0.02F, 0.01F};
    const auto built = build_hierarchy(cloud, {.scales = scales}, {});
    REQUIRE(built.ok());
    const MultiresSurface& surface = built.value().surface;
    const auto diagonal = static_cast<double>(bounds_of(cloud.position).diagonal());
    DecompositionReport sum;
    for (std::size_t band = 0; band < scales.size(); ++band) {
      const DecompositionReport& report = built.value().reports[band];
      sum.at_limit += report.at_limit;
      sum.fallback += report.fallback;
      sum.flipped += report.flipped;
      sum.mean_iterations += report.mean_iterations / static_cast<double>(scales.size());
      CHECK(relative_error(static_cast<double>(report.scale), static_cast<double>(scales[band]) * diagonal) <
            0.02);
      CHECK(all_finite(surface.levels[band].normal));
    }
    const double stretch = base_stretch(surface, built.value().graph);
    MESSAGE(scan.file << ": " << sum.at_limit << " at the limit, " << sum.fallback << " on the fallback, "
                      << sum.flipped << " flipped, " << sum.mean_iterations
                      << " iterations, base points part by " << stretch);
    CHECK(sum.at_limit <= scan.at_limit);
    CHECK(sum.fallback <= scan.fallback);
    CHECK(sum.flipped <= scan.flipped);
    CHECK(stretch <= scan.stretch);
    CHECK(surface.finest().position == cloud.position);
    CHECK(identity_error(surface) < 1e-6 * diagonal);
  }
}

}  // namespace
}  // namespace pointwright
