// A real scan under a large deformation, against the same edit of a denser sampling of it.
#include <doctest/doctest.h>

#include <numbers>

#include "engine/multires/hierarchy.h"
#include "engine/simplification/subsample.h"
#include "tests/resampling/resampling_support.h"
#include "tests/support/scans.h"

namespace pointwright {
namespace {

constexpr std::size_t kSamples = 30'000;

TEST_CASE("a scan twisted by a full turn stays covered, sound and close to a denser sampling of it") {
  const std::optional<Cloud> found = test::real_scan("igea.ply");
  if (!found) return;
  const auto built = build_hierarchy(*found, {.scales = {0.01F}}, {});
  REQUIRE(built.ok());
  // Both samplings of one surface: the coarse one is a subset, with the normals of the dense one.
  const Level dense = built.value().surface.finest();
  const auto chosen =
      subsample(dense.position, dense.normal, {.target = KeepCount{static_cast<std::uint32_t>(kSamples)}});
  REQUIRE(chosen.ok());
  Level coarse{.position = Points(kSamples), .normal = Points(kSamples)};
  for (std::size_t i = 0; i < kSamples; ++i) {
    coarse.position.set(i, dense.position[chosen.value()[i]]);
    coarse.normal.set(i, dense.normal[chosen.value()[i]]);
  }
  const Box3f box = bounds_of(coarse.position);
  const float height = box.max.y() - box.min.y();
  const float low = box.min.y() + 0.2F * height;
  const float high = box.max.y() - 0.2F * height;
  const Vec3d middle = (0.5F * (box.min + box.max)).cast<double>();
  const Rotation turn{.point = middle, .axis = Vec3d::UnitY(), .angle_rad = 2.0 * std::numbers::pi};
  const test::EditScene scene = test::scene_of(
      {.levels = {coarse}, .detail = {}},
      [&](const Vec3f& p) { return p.y() < low    ? 1
                                   : p.y() > high ? 2
                                                  : 0; }, test::resampling_by(turn));
  const ResampledEdit edit = test::resampled(scene);
  test::check_sound(edit);
  CHECK(edit.inserted > kSamples / 10);

  const Points& p = edit.surface.finest().position;
  const Points truth = test::evenly_on_deformed(scene, dense);
  double unit = 0.0;
  for (const float spacing : scene.sampling->spacing) unit += static_cast<double>(spacing) / kSamples;
  const test::Holes holes = test::holes_of(truth, p, unit);
  const test::Holes rest = test::holes_of(dense.position, coarse.position, unit);
  // From the inserted samples to the dense sampling under the same edit.
  Points children(edit.inserted);
  for (std::size_t c = 0; c < edit.inserted; ++c) children.set(c, p[kSamples + c]);
  const std::vector<double> away =
      test::distances_to(children, test::deformed_by(scene, dense).level.position);
  MESSAGE(kSamples << " -> " << p.size() << " samples, discs " << holes.p999 << " / " << holes.most
                   << " (at rest " << rest.p999 << " / " << rest.most << "), from the dense sampling "
                   << away[away.size() / 2] / unit << " in the median, p99 "
                   << away[away.size() * 99 / 100] / unit);
  CHECK(holes.p999 < 1.5 * rest.p999);
  CHECK(away[away.size() / 2] < 0.6 * unit);
}

}  // namespace
}  // namespace pointwright
