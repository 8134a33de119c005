#include "engine/multires/reconstruction.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "engine/multires/hierarchy.h"
#include "tests/support/all_machines.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr Bumps kBumps{.count = 500, .height = 0.008, .width = 0.04};

Hierarchy built(const Surface& surface, const std::vector<float>& scales) {
  auto result = build_hierarchy(to_cloud(surface.position), {.scales = scales}, {});
  REQUIRE(result.ok());
  return std::move(result).value();
}

const Hierarchy& bumpy() {
  static const Hierarchy hierarchy = built(bumpy_sphere(20'000, kBumps), {0.06F, 0.03F});
  return hierarchy;
}

MultiresSurface rebuilt(const Hierarchy& hierarchy, const Level& moved, const ReconstructParams& params) {
  auto result = reconstruct(hierarchy.surface, hierarchy.graph, moved, params);
  REQUIRE(result.ok());
  return std::move(result).value();
}

Level turned(const Level& level, const Mat3d& rotation, const Vec3d& offset) {
  Level result = level;
  for (std::size_t i = 0; i < level.position.size(); ++i) {
    result.position.set(i, (rotation * level.position[i].cast<double>() + offset).cast<float>());
    result.normal.set(i, (rotation * level.normal[i].cast<double>()).cast<float>());
  }
  return result;
}

double largest_distance(const Points& a, const Points& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    worst = std::max(worst, static_cast<double>((a[i] - b[i]).norm()));
  return worst;
}

double rms(const std::vector<float>& values) {
  double sum = 0.0;
  for (const float v : values) sum += static_cast<double>(v) * static_cast<double>(v);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

TEST_CASE("from any level, nothing moved gives every level back to the bit") {
  for (const Surface& surface : {bumpy_sphere(8'000, kBumps), with_noise(hemisphere(4'000, 1.0), 0.01),
                                 cube(25, 1.0), parallel_sheets(40, 0.02, 0.03, Sampling::kRandom)}) {
    const Hierarchy hierarchy = built(surface, {0.08F, 0.04F, 0.02F});
    for (std::uint32_t level = 0; level <= 3; ++level) {
      CAPTURE(level);
      const MultiresSurface again = rebuilt(hierarchy, hierarchy.surface.levels[level], {.level = level});
      CHECK(again.levels == hierarchy.surface.levels);
      CHECK(again.detail == hierarchy.surface.detail);
    }
  }
}

TEST_CASE("re-estimated normals lose the identity: the reason why normals are carried") {
  const MultiresSurface& rest = bumpy().surface;
  const MultiresSurface again = rebuilt(bumpy(), rest.levels[0], {.normals = RebuiltNormals::kReestimated});
  CHECK(again.levels[1].position == rest.levels[1].position);  // its base still has its own normals
  const double lost = largest_distance(again.finest().position, rest.finest().position);
  CHECK(lost > 1e-3 * rms(rest.detail[1]));
}

TEST_CASE("a rigid motion of a level moves everything rigidly") {
  for (const double degrees : {37.0, 90.0, 180.0, 270.0}) {
    CAPTURE(degrees);
    const Mat3d rotation(
        Eigen::AngleAxisd(degrees * 3.14159265358979 / 180.0, Vec3d(0.3, -0.5, 0.8).normalized()));
    const Vec3d offset(0.4, -0.2, 0.1);
    const MultiresSurface& rest = bumpy().surface;
    const auto diagonal = static_cast<double>(bounds_of(rest.finest().position).diagonal());
    for (std::uint32_t level = 0; level <= 2; ++level) {
      CAPTURE(level);
      const MultiresSurface moved =
          rebuilt(bumpy(), turned(rest.levels[level], rotation, offset), {.level = level});
      for (std::uint32_t k = level; k <= 2; ++k) {
        const Level expected = turned(rest.levels[k], rotation, offset);
        CHECK(largest_distance(moved.levels[k].position, expected.position) < 1e-6 * diagonal);
        CHECK(largest_distance(moved.levels[k].normal, expected.normal) < 1e-4);
      }
    }
  }
}

TEST_CASE("a bent and stretched plane keeps its waves at right angles to itself") {
  // Rolled onto a cylinder, where offset curves and their normals are known: the base at height 0, the wave a
  // height above it.
  constexpr double kRadius = 1.5;
  const auto height = [](double x, double y) { return 0.01 * std::sin(20.0 * x) * std::sin(20.0 * y); };
  const Surface flat = plane(200, 0.01, Sampling::kJittered);
  Surface waved = flat;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    const Vec3d p = flat.position[i].cast<double>();
    waved.position.set(i, (p + height(p.x(), p.y()) * Vec3d::UnitZ()).cast<float>());
  }
  // The hierarchy by hand: the flat plane is the exact base.
  Hierarchy hierarchy;
  const std::size_t n = flat.size();
  hierarchy.surface.levels = {{flat.position, flat.normal}, {waved.position, flat.normal}};
  hierarchy.surface.detail.resize(1);
  for (std::size_t i = 0; i < n; ++i) {
    hierarchy.surface.detail[0].push_back(waved.position[i].z());
    const double x = static_cast<double>(flat.position[i].x());
    const double y = static_cast<double>(flat.position[i].y());
    const Vec3d normal(-0.2 * std::cos(20.0 * x) * std::sin(20.0 * y),
                       -0.2 * std::sin(20.0 * x) * std::cos(20.0 * y), 1.0);
    hierarchy.surface.levels[1].normal.set(i, normal.normalized().cast<float>());
  }
  hierarchy.graph = build_neighbor_graph(waved.position, 10);
  const auto rolled = [&](double x, double y, double z) {
    const double angle = x / kRadius;
    return Vec3d((kRadius + z) * std::sin(angle), 1.3 * y, (kRadius + z) * std::cos(angle) - kRadius);
  };
  Level base = hierarchy.surface.levels[0];
  for (std::size_t i = 0; i < n; ++i) {
    const double x = static_cast<double>(flat.position[i].x());
    base.position.set(i, rolled(x, static_cast<double>(flat.position[i].y()), 0.0).cast<float>());
    base.normal.set(i, Vec3d(std::sin(x / kRadius), 0.0, std::cos(x / kRadius)).cast<float>());
  }
  const MultiresSurface result = rebuilt(hierarchy, base, {});
  double squares = 0.0;
  double worst = 0.0;
  std::size_t inside = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = static_cast<double>(flat.position[i].x());
    const double y = static_cast<double>(flat.position[i].y());
    const double z = static_cast<double>(waved.position[i].z());
    worst = std::max(worst, (result.finest().position[i].cast<double>() - rolled(x, y, z)).norm());
    if (std::abs(x) > 0.9 || std::abs(y) > 0.9) continue;
    // The true normal from the tangents of (x, y) -> rolled(x, y, height(x, y)).
    constexpr double kStep = 1e-5;
    const Vec3d along_x =
        rolled(x + kStep, y, height(x + kStep, y)) - rolled(x - kStep, y, height(x - kStep, y));
    const Vec3d along_y =
        rolled(x, y + kStep, height(x, y + kStep)) - rolled(x, y - kStep, height(x, y - kStep));
    const Vec3d normal = along_x.cross(along_y).normalized();
    squares += (result.finest().normal[i].cast<double>() - normal).squaredNorm();
    ++inside;
  }
  CHECK(worst < 1e-6);
  // The waves' normals swing by 0.2: a hundredth of that.
  CHECK(std::sqrt(squares / static_cast<double>(inside)) < 0.002);
}

TEST_CASE("gains suppress, keep and exaggerate a band") {
  const MultiresSurface& rest = bumpy().surface;
  const auto diagonal = static_cast<double>(bounds_of(rest.finest().position).diagonal());
  const MultiresSurface flat = rebuilt(bumpy(), rest.levels[0], {.gains = {0.0F, 0.0F}});
  CHECK(largest_distance(flat.finest().position, rest.levels[0].position) < 1e-6 * diagonal);
  const MultiresSurface coarse = rebuilt(bumpy(), rest.levels[0], {.gains = {1.0F, 0.0F}});
  CHECK(largest_distance(coarse.finest().position, rest.levels[1].position) < 1e-6 * diagonal);
  const MultiresSurface doubled = rebuilt(bumpy(), rest.levels[1], {.level = 1, .gains = {9.0F, 2.0F}});
  CHECK(doubled.levels[0] == rest.levels[0]);
  CHECK(doubled.detail[0] == rest.detail[0]);  // coarser than the level: its gain does not count
  double worst = 0.0;
  for (std::size_t i = 0; i < rest.sample_count(); ++i) {
    const Vec3f expected = rest.levels[1].position[i] + 2.0F * rest.detail[1][i] * rest.levels[1].normal[i];
    worst = std::max(worst, static_cast<double>((doubled.finest().position[i] - expected).norm()));
    CHECK(doubled.detail[1][i] == 2.0F * rest.detail[1][i]);
  }
  CHECK(worst < 1e-6 * diagonal);
  // A taller bump leans its normals over by as much: the angle between the base's and the surface's grows.
  const auto lean = [](const MultiresSurface& surface) {
    return mean_line_angle(surface.levels[1].normal, surface.finest().normal);
  };
  CHECK(lean(doubled) > 1.7 * lean(rest));
  CHECK(lean(coarse) < 0.3 * lean(rest));
}

TEST_CASE("levels and gains out of range are refused and named") {
  const MultiresSurface& rest = bumpy().surface;
  const auto field = [&](const ReconstructParams& params) { return validate(params, rest).error().field; };
  CHECK(field({.level = 3}) == "level");
  CHECK(field({.gains = {1.0F}}) == "gains");
  CHECK(field({.gains = {1.0F, 17.0F}}) == "gains");
  CHECK(field({.gains = {1.0F, std::nanf("")}}) == "gains");
  CHECK(validate({.level = 2, .gains = {-16.0F, 16.0F}}, rest).ok());
  const auto refused = reconstruct(rest, bumpy().graph, rest.levels[0], {.level = 7});
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "level");
}

TEST_CASE("degenerate clouds are rebuilt without a number that is not one") {
  for (const Points& points :
       {identical(1, {1, 2, 3}), identical(2000, {1, 2, 3}), collinear(300, {0, 0, 0}, {1, 2, 3}),
        from_list({{0, 0, 0}, {1, 0, 0}}), plane(20, 1.0, Sampling::kRegular).position}) {
    auto hierarchy = build_hierarchy(to_cloud(points), {.scales = {0.1F, 0.02F}}, {});
    REQUIRE(hierarchy.ok());
    const MultiresSurface& rest = hierarchy.value().surface;
    const Mat3d rotation(Eigen::AngleAxisd(3.14159265358979, Vec3d::UnitX()));
    for (const ReconstructParams& params : {ReconstructParams{}, ReconstructParams{.gains = {3.0F, -2.0F}},
                                            ReconstructParams{.normals = RebuiltNormals::kReestimated}}) {
      const MultiresSurface moved =
          rebuilt(hierarchy.value(), turned(rest.levels[0], rotation, Vec3d(5.0, 0.0, 0.0)), params);
      for (const Level& level : moved.levels) {
        CHECK(all_finite(level.position));
        for (std::size_t i = 0; i < points.size(); ++i)
          CHECK(std::abs(level.normal[i].norm() - 1.0F) < 1e-4F);
      }
    }
  }
}

TEST_CASE("rebuilding has the same bytes for any thread count and instruction set") {
  const MultiresSurface& rest = bumpy().surface;
  const Mat3d rotation(Eigen::AngleAxisd(0.7, Vec3d(1.0, 2.0, -1.0).normalized()));
  Level bent = turned(rest.levels[0], rotation, Vec3d::Zero());
  for (std::size_t i = 0; i < rest.sample_count(); ++i)
    bent.position.set(i, bent.position[i] * (1.0F + 0.3F * bent.position[i].x()));
  const ReconstructParams params{.gains = {1.5F, 0.5F}};
  for_all_machines(
      [&] { return rebuilt(bumpy(), bent, params); },
      [](const MultiresSurface& one, const MultiresSurface& other) { CHECK(other.levels == one.levels); });
}

TEST_CASE("a cancelled rebuilding says so") {
  const ExecutionContext context;
  context.cancel();
  const auto result = reconstruct(bumpy().surface, bumpy().graph, bumpy().surface.levels[0], {}, &context);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kCancelled);
}

}  // namespace
}  // namespace pointwright
