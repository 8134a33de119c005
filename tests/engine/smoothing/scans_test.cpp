// Smoothing of real scans (tests/support/scans.h).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "engine/normals/estimation.h"
#include "engine/normals/rest_surface.h"
#include "engine/smoothing/smoothing_hierarchy.h"
#include "engine/smoothing/umbrella.h"
#include "engine/smoothing/v_cycle.h"
#include "tests/support/scans.h"
#include "tests/support/spacing.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr const char* kHead = "igea.ply";  // closed

TEST_CASE("a V-cycle on a known scan reaches its scale, piles nothing up and turns no normal over") {
  const std::optional<Cloud> cloud = real_scan(kHead);
  if (!cloud) return;
  const Points& before = cloud->position;
  const auto rest = rest_surface(*cloud, 10, {});
  REQUIRE(rest.ok());
  const Points& normal = rest.value().normal;
  const NeighborGraph& graph = rest.value().graph;
  for (const float share : {0.01F, 0.03F}) {
    CAPTURE(share);
    const float scale = share * bounds_of(before).diagonal();
    const auto hierarchy = build_smoothing_hierarchy(before, normal, graph, scale, contracting_coarsener());
    REQUIRE(hierarchy.ok());
    const auto cycle = v_cycle(before, normal, graph, hierarchy.value(), {.scale = scale});
    REQUIRE(cycle.ok());
    const Points& after = cycle.value().points;
    CHECK(relative_error(static_cast<double>(cycle.value().scale), static_cast<double>(scale)) < 0.02);
    CHECK(all_finite(after));
    const auto first_percentile = [](const Points& points) {
      const std::vector<double> nearest = nearest_distances(points);
      return nearest[nearest.size() / 100];
    };
    // Fitted from nothing, without sides, and fitted anew from the old ones.
    Points refitted;
    estimate_normals(after, build_neighbor_graph(after, 10), {}, refitted);
    std::size_t across = 0;  // more than 60 degrees from where they were
    for (std::size_t i = 0; i < after.size(); ++i)
      across += line_angle(refitted[i], normal[i]) > 1.047 ? 1 : 0;
    Points carried = normal;
    refit_normals(after, graph, carried);
    const std::size_t opposed = count_opposed(carried, normal);
    double moved = 0.0;
    for (std::size_t i = 0; i < after.size(); ++i)
      moved += static_cast<double>((after[i] - before[i]).norm());
    MESSAGE("scale " << cycle.value().scale / bounds_of(before).diagonal()
                     << ": first percentile of distances "
                     << first_percentile(after) / first_percentile(before) << " of before, " << across
                     << " normals far off, " << opposed << " opposed, moved by "
                     << moved / static_cast<double>(after.size()) / static_cast<double>(scale)
                     << " of the scale");
    CHECK(first_percentile(after) > 0.5 * first_percentile(before));
    CHECK(opposed == 0);
    CHECK(static_cast<double>(across) < 3e-3 * static_cast<double>(after.size()));
    CHECK(moved > 0.0);
  }
}

TEST_CASE("Figure 1 on a known scan: local preservation keeps the volume of a noisy head within 1 %") {
  const std::optional<Cloud> cloud = real_scan(kHead);
  if (!cloud) return;
  const auto rest = rest_surface(*cloud, 10, {});
  REQUIRE(rest.ok());
  // Volumes through what the clean scan's samples have of its area, along its normals: 1/3 sum a n . p, and
  // what a change of positions adds to that, to first order sum a (p' - p) . n. Neither reads the noisy
  // surface.
  const Points& clean = cloud->position;
  const Points& normal = rest.value().normal;
  const std::vector<float> spacing = local_spacing(clean, rest.value().graph);
  const Box3f box = bounds_of(clean);
  const Vec3f center = 0.5F * (box.min + box.max);
  const auto flux = [&](std::size_t i, const Vec3f& v) {
    return static_cast<double>(spacing[i]) * static_cast<double>(spacing[i]) *
           static_cast<double>(normal[i].dot(v));
  };
  double volume = 0.0;
  for (std::size_t i = 0; i < clean.size(); ++i) volume += flux(i, clean[i] - center) / 3.0;
  const double radius = std::cbrt(std::abs(volume) * 0.75 / 3.14159265358979);
  // In the clean samples' order, which pairs the two.
  Random random(1);
  Points noisy(clean.size());
  for (std::size_t i = 0; i < clean.size(); ++i) {
    const Vec3d noise(random.normal(), random.normal(), random.normal());
    noisy.set(i, (clean[i].cast<double>() + 0.01 * radius * noise).cast<float>());
  }
  const NeighborGraph graph = build_neighbor_graph(noisy, 10);
  Points noisy_normal = normal;
  refit_normals(noisy, graph, noisy_normal);
  const auto change = [&](VolumePreservation preserve) {
    const auto after = smooth(noisy, noisy_normal, graph, {.preserve = preserve, .iterations = 100});
    REQUIRE(after.ok());
    double sum = 0.0;
    double off = 0.0;
    for (std::size_t i = 0; i < clean.size(); ++i) {
      sum += flux(i, after.value()[i] - noisy[i]);
      const auto d = static_cast<double>(normal[i].dot(after.value()[i] - clean[i]));
      off += d * d;
    }
    MESSAGE("volume " << 100.0 * sum / volume << " %, off the clean scan by "
                      << std::sqrt(off / static_cast<double>(clean.size())) / (0.01 * radius)
                      << " of the noise");
    return sum / volume;
  };
  const double none = change(VolumePreservation::kNone);
  const double global = change(VolumePreservation::kGlobal);
  const double local = change(VolumePreservation::kLocal);
  CHECK(none < -0.005);
  CHECK(std::abs(global) < 0.01);
  CHECK(std::abs(local) < 0.01);
  CHECK(std::abs(local) < 0.5 * std::abs(none));
}

}  // namespace
}  // namespace pointwright
