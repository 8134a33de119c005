#include "engine/editing/partial_edit.h"

#include <doctest/doctest.h>

#include <cmath>

#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

using namespace test;

const Vec3d kOrigin(10.0, -20.0, 5.0);

std::vector<Deformation> every_kind() {
  const Vec3d point(10.2, -20.1, 4.5);
  const Translation shift{.vector = {0.3, -0.2, 0.5}};
  const Rotation turn{.point = point, .axis = {1, 2, -1}, .angle_rad = 2.5};
  const Scaling grow{.center = point, .factors = {0.3, 2.0, 1.7}};
  const Twist twist{.point = point, .axis = {0, 1, 0.5}, .angle_rad = -4.0, .length = 0.7};
  const TowardPoint away{.target = point, .amount = -0.8};
  const NormalOffset offset{.distance = -0.05};
  return {shift, turn, grow, twist, away, offset, Deformation({offset, grow, turn, shift, twist, away})};
}

EditParams with_gains(const Deformation& deformation) {
  return {.level = 0, .deformation = deformation, .gains = {2.5F}};
}

struct Scene {
  MultiresSurface surface =
      one_band(plane_level(33), [](std::size_t i) { return 0.02F * std::sin(static_cast<float>(i)); });
  Marks marks = marks_beside(surface.levels[0].position, 0.3F);
  ScaleField field;

  Scene() {
    const std::vector<float> spacing(marks.size(), 0.06F);
    auto regions = regions_from_marks(surface.levels[0].position, spacing, marks, kOrigin);
    REQUIRE(regions.ok());
    field = compute_scale_field(surface.levels[0].position, regions.value(), Blend::kQuartic);
  }
  [[nodiscard]] MultiresSurface after(const EditParams& params) const {
    return edited(surface, params, field, kOrigin);
  }
};

TEST_CASE("a part of a deformation moves a point with t as the whole moves one with s t") {
  const LocalSurface local{.normal = Vec3d(1, 2, 2) / 3.0};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (const Deformation& whole : every_kind()) {
    for (const double s : {0.0, 1e-9, 0.1, 0.25, 1.0 / 3.0, 0.9, 1.0}) {
      const Deformation part = scaled(whole, s);
      CHECK(validate(part).ok());
      for (const double t : {0.0, 0.2, 0.7, 1.0}) {
        const Vec3d p = kOrigin + Vec3d(any(random), any(random), any(random));
        const Vec3d expected = deform_point(whole, p, s * t, local);
        CHECK((deform_point(part, p, t, local) - expected).norm() < 1e-13 * (1.0 + p.norm()));
      }
    }
  }
}

TEST_CASE("no part of an edit is the identity to the bit, all of it is the edit") {
  const Scene scene;
  for (const Deformation& deformation : every_kind()) {
    const EditParams whole = with_gains(deformation);
    CHECK(scaled(whole, 1.0) == whole);
    CHECK(scaled(whole, 0.0).gains == std::vector<float>{1.0F});
    CHECK(same_bytes(scene.after(scaled(whole, 0.0)), scene.surface));
    CHECK_FALSE(same_bytes(scene.after(whole), scene.surface));
  }
}

TEST_CASE("an edit plays continuously from nothing to the whole") {
  const Scene scene;
  constexpr int kSteps = 64;
  for (const Deformation& deformation : every_kind()) {
    const EditParams whole = with_gains(deformation);
    MultiresSurface before = scene.surface;
    double longest = 0.0;
    double way = 0.0;
    for (int step = 1; step <= kSteps; ++step) {
      const MultiresSurface now = scene.after(scaled(whole, static_cast<double>(step) / kSteps));
      double farthest = 0.0;
      for (std::size_t i = 0; i < now.sample_count(); ++i)
        farthest = std::max(
            farthest, static_cast<double>((now.finest().position[i] - before.finest().position[i]).norm()));
      longest = std::max(longest, farthest);
      way += farthest;
      before = now;
    }
    // No step is much longer than the others: nowhere does the surface jump.
    CHECK(way > 0.0);
    CHECK(longest < 4.0 * way / kSteps);
    CHECK(same_bytes(before, scene.after(whole)));
  }
}

TEST_CASE("the one-region of a rotation travels along its arc") {
  const Scene scene;
  const Vec3d point(10.2, -20.1, 4.5);
  const Vec3d axis = Vec3d(1, 2, -1).normalized();
  const EditParams whole{.deformation = Rotation{.point = point, .axis = axis, .angle_rad = 2.5}};
  for (int frame = 0; frame <= 10; ++frame) {
    const double s = frame / 10.0;
    const MultiresSurface now = scene.after(scaled(whole, s));
    const Mat3d rotation = Eigen::AngleAxisd(2.5 * s, axis).toRotationMatrix();
    for (std::size_t i = 0; i < scene.marks.size(); ++i) {
      const Vec3d rest = kOrigin + scene.surface.levels[0].position[i].cast<double>();
      const Vec3d there = kOrigin + now.levels[0].position[i].cast<double>();
      if (scene.marks[i] == static_cast<std::uint8_t>(RegionKind::kZero)) REQUIRE(there == rest);
      if (scene.marks[i] != static_cast<std::uint8_t>(RegionKind::kOne)) continue;
      const Vec3d expected = point + rotation * (rest - point);
      REQUIRE((there - expected).norm() < 5e-7 * (1.0 + (rest - point).norm() + (rest - kOrigin).norm()));
    }
  }
}

TEST_CASE("only parts from none to all are asked for") {
  CHECK_THROWS_AS(scaled(Deformation(), -0.1), LogicError);
  CHECK_THROWS_AS(scaled(Deformation(), 1.1), LogicError);
  CHECK_THROWS_AS(scaled(Deformation(), std::nan("")), LogicError);
}

}  // namespace
}  // namespace pointwright
