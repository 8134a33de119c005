// Simplification and subsampling of real scans (tests/support/scans.h).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "engine/normals/rest_surface.h"
#include "engine/simplification/simplification.h"
#include "engine/simplification/subsample.h"
#include "tests/support/scans.h"
#include "tests/support/spacing.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

// In ten-thousandths of the diagonal, at most: root mean square and greatest distance of the scan's samples
// to the planes of the samples that stand for them, and of the kept samples to the plane of the scan's
// nearest.
struct Limits {
  double to_planes;
  double to_planes_most;
  double from_kept;
  double from_kept_most;
};
struct Scan {
  std::string_view file;
  Limits tenth;
  Limits fiftieth;
};
// A tenth above what was measured, a fifth for the greatest.
constexpr Scan kScans[] = {{"bunny.ply", {6.0, 72.0, 2.7, 17.0}, {29.2, 260.0, 6.5, 31.0}},
                           {"igea.ply", {1.82, 38.0, 0.96, 11.2}, {8.5, 133.0, 2.35, 17.1}},
                           {"dragon.ply", {1.02, 27.5, 0.42, 8.1}, {5.55, 83.0, 1.13, 10.6}}};

struct Distance {
  double rms = 0.0;
  double most = 0.0;
};
template <typename OfSample>
Distance distance_over(std::size_t count, double unit, const OfSample& of_sample) {
  Distance result;
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double d = std::abs(static_cast<double>(of_sample(i))) / unit;
    sum += d * d;
    result.most = std::max(result.most, d);
  }
  result.rms = std::sqrt(sum / static_cast<double>(count));
  return result;
}

TEST_CASE("known scans are simplified no farther off than measured, and restored to the bit") {
  for (const Scan& scan : kScans) {
    CAPTURE(scan.file);
    const std::optional<Cloud> cloud = real_scan(scan.file);
    if (!cloud) continue;
    const Points& position = cloud->position;
    const auto rest = rest_surface(*cloud, 10, {});
    REQUIRE(rest.ok());
    const Points& normal = rest.value().normal;
    const double unit = 1e-4 * static_cast<double>(bounds_of(position).diagonal());
    const KdTree tree(position);
    for (const double ratio : {0.1, 0.02}) {
      const Limits& limits = ratio == 0.1 ? scan.tenth : scan.fiftieth;
      const auto outcome = simplify(position, normal, rest.value().graph, {.target = KeepRatio{ratio}});
      REQUIRE(outcome.ok());
      const Simplification& result = outcome.value();
      CHECK(result.kept.size() == kept_of(KeepRatio{ratio}, position.size()));
      CHECK(all_finite(result.position));
      const Distance to_planes = distance_over(position.size(), unit, [&](std::size_t i) {
        const std::uint32_t m = result.parent[i];
        return result.normal[m].dot(position[i] - result.position[m]);
      });
      std::vector<Neighbor> found;
      const Distance from_kept = distance_over(result.kept.size(), unit, [&](std::size_t m) {
        tree.nearest(result.position[m], 1, found);
        return normal[found[0].index].dot(result.position[m] - position[found[0].index]);
      });
      MESSAGE(scan.file << " to " << ratio << ": samples to planes " << to_planes.rms << ", at most "
                        << to_planes.most << "; kept to the scan " << from_kept.rms << ", at most "
                        << from_kept.most << " (1e-4 of the diagonal)");
      CHECK(to_planes.rms < limits.to_planes);
      CHECK(to_planes.most < limits.to_planes_most);
      CHECK(from_kept.rms < limits.from_kept);
      CHECK(from_kept.most < limits.from_kept_most);
      const Simplification all = reinsert(result, position, normal, position.size());
      CHECK(all.position == position);
      CHECK(all.normal == normal);
    }
  }
}

TEST_CASE("known scans are subsampled evenly") {
  for (const Scan& scan : kScans) {
    CAPTURE(scan.file);
    const std::optional<Cloud> cloud = real_scan(scan.file);
    if (!cloud) continue;
    const auto rest = rest_surface(*cloud, 10, {});
    REQUIRE(rest.ok());
    const auto kept = subsample(cloud->position, rest.value().normal, {.target = KeepRatio{0.05}});
    REQUIRE(kept.ok());
    const Points subset = reordered(cloud->position, kept.value());
    const std::vector<double> nearest = nearest_distances(subset);
    const double median = nearest[nearest.size() / 2];
    const Spacing spacing = spacing_of(subset, median);
    const double gap = largest_gap(cloud->position, subset, median);
    MESSAGE(scan.file << ": first percentile " << nearest[nearest.size() / 100] / median
                      << " of the median, variation " << spacing.variation << ", largest gap " << gap);
    // Of the samples next to a sharp edge or in a thin part some stand beside others that face away.
    CHECK(nearest[nearest.size() / 100] > 0.6 * median);
    CHECK(spacing.variation < 0.1);
    CHECK(gap < 1.5);
  }
}

}  // namespace
}  // namespace pointwright
