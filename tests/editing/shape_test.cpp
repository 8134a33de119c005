#include "engine/editing/shape.h"

#include <doctest/doctest.h>

#include <limits>

namespace pointwright {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

void check_refused(const Shape& shape, ErrorCode code, const char* field) {
  const Result<void> result = validate(shape);
  REQUIRE(!result.ok());
  CHECK(result.error().code == code);
  CHECK(result.error().field == field);
  CHECK(!result.error().message.empty());
}

TEST_CASE("a sphere contains its border and nothing beyond") {
  const Shape sphere = Sphere{.center = Vec3d(1.0, 2.0, 3.0), .radius = 2.0};
  CHECK(validate(sphere).ok());
  CHECK(contains(sphere, Vec3d(1.0, 2.0, 3.0)));
  CHECK(contains(sphere, Vec3d(3.0, 2.0, 3.0)));
  CHECK_FALSE(contains(sphere, Vec3d(3.0000001, 2.0, 3.0)));
}

TEST_CASE("a stroke of one vertex is a sphere, of two a capsule, of more their union") {
  const Shape point = Stroke{.vertices = {Vec3d(1.0, 0.0, 0.0)}, .radius = 0.5};
  CHECK(contains(point, Vec3d(1.5, 0.0, 0.0)));
  CHECK_FALSE(contains(point, Vec3d(1.51, 0.0, 0.0)));

  const Shape capsule = Stroke{.vertices = {Vec3d::Zero(), Vec3d(4.0, 0.0, 0.0)}, .radius = 1.0};
  CHECK(contains(capsule, Vec3d(2.0, 1.0, 0.0)));         // beside the segment
  CHECK(contains(capsule, Vec3d(-1.0, 0.0, 0.0)));        // the cap's tip
  CHECK_FALSE(contains(capsule, Vec3d(-0.8, 0.8, 0.0)));  // beyond the round cap
  CHECK_FALSE(contains(capsule, Vec3d(2.0, 0.8, 0.8)));

  const Shape bent =
      Stroke{.vertices = {Vec3d::Zero(), Vec3d(4.0, 0.0, 0.0), Vec3d(4.0, 4.0, 0.0)}, .radius = 0.5};
  CHECK(contains(bent, Vec3d(2.0, 0.4, 0.0)));
  CHECK(contains(bent, Vec3d(4.4, 3.0, 0.0)));
  CHECK_FALSE(contains(bent, Vec3d(2.0, 2.0, 0.0)));

  const Shape standing = Stroke{.vertices = {Vec3d(1.0, 1.0, 1.0), Vec3d(1.0, 1.0, 1.0)}, .radius = 1.0};
  CHECK(contains(standing, Vec3d(2.0, 1.0, 1.0)));  // a segment without length
  CHECK_FALSE(contains(standing, Vec3d(2.1, 1.0, 1.0)));
}

TEST_CASE("a point set is the union of its balls, with one radius for all or one for each") {
  const std::vector<Vec3d> points = {Vec3d::Zero(), Vec3d(4.0, 0.0, 0.0)};
  const Shape same = PointSet{.points = points, .radii = {1.0}};
  CHECK(validate(same).ok());
  CHECK(contains(same, Vec3d(5.0, 0.0, 0.0)));
  CHECK_FALSE(contains(same, Vec3d(2.0, 0.0, 0.0)));
  const Shape each = PointSet{.points = points, .radii = {0.5, 2.0}};
  CHECK(validate(each).ok());
  CHECK(contains(each, Vec3d(2.0, 0.0, 0.0)));
  CHECK(contains(each, Vec3d(0.0, 0.5, 0.0)));
  CHECK_FALSE(contains(each, Vec3d(0.0, 0.51, 0.0)));
  CHECK(vertex_count(each) == 2);
  CHECK(vertex_count(Everything{}) == 0);
}

TEST_CASE("boxes and half-spaces include their borders; a flat box is legal") {
  const Shape box = AxisBox{.min = Vec3d(0.0, 0.0, 0.0), .max = Vec3d(1.0, 2.0, 0.0)};
  CHECK(validate(box).ok());
  CHECK(contains(box, Vec3d(1.0, 2.0, 0.0)));
  CHECK_FALSE(contains(box, Vec3d(0.5, 0.5, 1e-9)));

  const Shape half_space = HalfSpace{.point = Vec3d(0.0, 0.0, 1.0), .normal = Vec3d(0.0, 0.0, 1e-9)};
  CHECK(validate(half_space).ok());
  CHECK(contains(half_space, Vec3d(5.0, 5.0, 1.0)));
  CHECK(contains(half_space, Vec3d(5.0, 5.0, 2.0)));
  CHECK_FALSE(contains(half_space, Vec3d(5.0, 5.0, 0.999)));

  CHECK(validate(Everything{}).ok());
  CHECK(contains(Everything{}, Vec3d(1e300, -1e300, 0.0)));
}

TEST_CASE("shapes with members outside their range are refused by name") {
  check_refused(Sphere{.center = Vec3d(kNan, 0.0, 0.0), .radius = 1.0}, ErrorCode::kNonFinite,
                "shape.center");
  check_refused(Sphere{.radius = kInf}, ErrorCode::kNonFinite, "shape.radius");
  check_refused(Sphere{.radius = 0.0}, ErrorCode::kInvalidArgument, "shape.radius");
  check_refused(Sphere{.radius = -1.0}, ErrorCode::kInvalidArgument, "shape.radius");
  check_refused(Sphere{.radius = 1e13}, ErrorCode::kOutOfRange, "shape.radius");
  check_refused(Sphere{.center = Vec3d(0.0, -1e13, 0.0), .radius = 1.0}, ErrorCode::kOutOfRange,
                "shape.center");
  check_refused(Stroke{.vertices = {}, .radius = 1.0}, ErrorCode::kInvalidArgument, "shape.vertices");
  check_refused(Stroke{.vertices = {Vec3d::Zero(), Vec3d(0.0, kInf, 0.0)}, .radius = 1.0},
                ErrorCode::kNonFinite, "shape.vertices");
  check_refused(Stroke{.vertices = std::vector<Vec3d>(kMaxStrokeVertices + 1, Vec3d::Zero()), .radius = 1.0},
                ErrorCode::kTooLarge, "shape.vertices");
  check_refused(PointSet{.points = {}, .radii = {1.0}}, ErrorCode::kInvalidArgument, "shape.points");
  check_refused(PointSet{.points = {Vec3d(kNan, 0.0, 0.0)}, .radii = {1.0}}, ErrorCode::kNonFinite,
                "shape.points");
  const std::vector<Vec3d> two(2, Vec3d::Zero());
  check_refused(PointSet{.points = two, .radii = {}}, ErrorCode::kInvalidArgument, "shape.radii");
  check_refused(PointSet{.points = two, .radii = {1.0, 1.0, 1.0}}, ErrorCode::kInvalidArgument,
                "shape.radii");
  check_refused(PointSet{.points = two, .radii = {1.0, 0.0}}, ErrorCode::kInvalidArgument, "shape.radii");
  check_refused(PointSet{.points = two, .radii = {kInf}}, ErrorCode::kNonFinite, "shape.radius");
  check_refused(PointSet{.points = std::vector<Vec3d>(kMaxStrokeVertices + 1, Vec3d::Zero()), .radii = {1.0}},
                ErrorCode::kTooLarge, "shape.points");
  check_refused(AxisBox{.min = Vec3d(0.0, 1.0, 0.0), .max = Vec3d(1.0, 0.0, 1.0)},
                ErrorCode::kInvalidArgument, "shape.min");
  check_refused(AxisBox{.max = Vec3d(0.0, 0.0, kNan)}, ErrorCode::kNonFinite, "shape.max");
  check_refused(HalfSpace{.normal = Vec3d::Zero()}, ErrorCode::kInvalidArgument, "shape.normal");
  check_refused(HalfSpace{.point = Vec3d(kNan, 0.0, 0.0)}, ErrorCode::kNonFinite, "shape.point");
}

}  // namespace
}  // namespace pointwright
