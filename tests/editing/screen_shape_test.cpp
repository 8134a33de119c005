#include "engine/editing/screen_shape.h"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "engine/editing/painting.h"
#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A camera at (0, 0, 5) that looks along -z: what stands at z = 0 is shown at a fifth of its x and y.
constexpr std::array<double, 16> kCamera{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1.02, 4.9, 0, 0, -1, 5};

ScreenPolygon star(std::size_t corners, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> coordinate(-0.3, 0.3);
  ScreenPolygon polygon;
  for (std::size_t i = 0; i < corners; ++i)
    polygon.vertices.emplace_back(coordinate(random), coordinate(random));
  return polygon;
}

void check_refused(const ScreenShape& shape, ErrorCode code, const char* field) {
  const Result<void> result = validate(Shape(shape));
  REQUIRE(!result.ok());
  CHECK(result.error().code == code);
  CHECK(result.error().field == field);
  CHECK(!result.error().message.empty());
}

TEST_CASE("a view projects points, those behind the eye nowhere") {
  const ScreenShape shape{.view = kCamera, .outline = ScreenEllipse{.half_axes = Vec2d(1.0, 1.0)}};
  REQUIRE(project(shape, Vec3d(1.0, -2.0, 0.0)).has_value());
  CHECK(*project(shape, Vec3d(1.0, -2.0, 0.0)) == Vec2d(0.2, -0.4));
  CHECK(*project(shape, Vec3d(1.0, 1.0, 3.0)) == Vec2d(0.5, 0.5));
  CHECK_FALSE(project(shape, Vec3d(0.0, 0.0, 5.0)).has_value());
  CHECK_FALSE(project(shape, Vec3d(0.0, 0.0, 6.0)).has_value());
  CHECK(contains(shape, Vec3d(4.9, 0.0, 0.0)));
  CHECK_FALSE(contains(shape, Vec3d(4.9, 0.0, 1.0)));
  CHECK_FALSE(contains(shape, Vec3d(0.0, 0.0, 6.0)));
}

TEST_CASE("a rectangle holds what a box holds, an outline that turns twice leaves its core out") {
  const ScreenShape rectangle{
      .outline = ScreenPolygon{.vertices = {{-0.5, -0.25}, {0.5, -0.25}, {0.5, 0.25}, {-0.5, 0.25}}}};
  CHECK(outline_contains(rectangle, Vec2d(0.49, 0.24)));
  CHECK(outline_contains(rectangle, Vec2d(-0.49, -0.24)));
  CHECK_FALSE(outline_contains(rectangle, Vec2d(0.51, 0.0)));
  CHECK_FALSE(outline_contains(rectangle, Vec2d(0.0, 0.26)));
  ScreenPolygon pentagram;
  for (int i = 0; i < 5; ++i) {
    const double angle = 4.0 * std::numbers::pi / 5.0 * i;
    pentagram.vertices.emplace_back(std::sin(angle), std::cos(angle));
  }
  const ScreenShape drawn{.outline = pentagram};
  CHECK(outline_contains(drawn, Vec2d(0.0, 0.8)));
  CHECK_FALSE(outline_contains(drawn, Vec2d(0.0, 0.0)));
}

TEST_CASE("ellipses have two half axes, lines a width") {
  const ScreenShape ellipse{.outline =
                                ScreenEllipse{.center = Vec2d(0.5, 0.0), .half_axes = Vec2d(0.25, 0.5)}};
  CHECK(outline_contains(ellipse, Vec2d(0.75, 0.0)));
  CHECK(outline_contains(ellipse, Vec2d(0.5, -0.5)));
  CHECK_FALSE(outline_contains(ellipse, Vec2d(0.7, 0.4)));
  const ScreenShape line{.outline = ScreenPolyline{.vertices = {{0, 0}, {1, 0}, {1, 1}}, .width = 0.5}};
  CHECK(outline_contains(line, Vec2d(0.5, -0.25)));
  CHECK(outline_contains(line, Vec2d(1.25, 0.5)));
  CHECK_FALSE(outline_contains(line, Vec2d(0.5, 0.375)));
  const ScreenShape dot{.outline = ScreenPolyline{.vertices = {{0.5, 0.5}}, .width = 1.0}};
  CHECK(outline_contains(dot, Vec2d(0.5, 1.0)));
  CHECK_FALSE(outline_contains(dot, Vec2d(1.0, 1.0)));
}

TEST_CASE("bands never change what an outline contains, and painting is the same on any machine") {
  const std::size_t n = 20'000;
  const Points position = test::random_points(n, 21, 2.0F);
  const Vec3d origin(0.1, -0.2, 0.3);
  const ScreenPolygon level{.vertices = {{-0.2, 0.1}, {0.2, 0.1}, {0.2, 0.1}}};
  const std::vector<ScreenShape> shapes = {
      {.view = kCamera, .outline = star(3, 1)},
      {.view = kCamera, .outline = star(1000, 2)},
      {.view = kCamera, .outline = level},
      {.view = kCamera, .outline = ScreenEllipse{.center = Vec2d(0.1, 0.1), .half_axes = Vec2d(0.2, 0.1)}},
      {.view = kCamera, .outline = ScreenPolyline{.vertices = star(200, 3).vertices, .width = 0.01}},
      {.view = kCamera, .outline = ScreenPolyline{.vertices = {{0.0, 0.0}}, .width = 0.1}}};
  for (const ScreenShape& shape : shapes) {
    REQUIRE(validate(Shape(shape)).ok());
    Marks expected(n, 0);
    for (std::size_t i = 0; i < n; ++i)
      expected[i] = contains(shape, origin + position[i].cast<double>()) ? 2 : 0;
    CHECK((count_marked(expected, RegionKind::kOne) > 0) ==
          (std::get_if<ScreenPolygon>(&shape.outline) == nullptr ||
           std::get<ScreenPolygon>(shape.outline).vertices != level.vertices));
    test::for_all_machines(
        [&] {
          Marks marks(n, 0);
          paint({.shape = shape}, RegionKind::kOne,
                {.position = position, .normal = position, .origin = origin}, marks);
          return marks;
        },
        [&](const Marks&, const Marks& marks) { CHECK(marks == expected); });
  }
}

TEST_CASE("screen shapes with members outside their range are refused by name") {
  const ScreenEllipse disc{.half_axes = Vec2d(1.0, 1.0)};
  ScreenShape shape{.view = kCamera, .outline = disc};
  CHECK(validate(Shape(shape)).ok());
  shape.view[5] = kNan;
  check_refused(shape, ErrorCode::kNonFinite, "shape.view");
  shape.view[5] = 1e13;
  check_refused(shape, ErrorCode::kOutOfRange, "shape.view");
  shape.view[5] = 0.0;
  check_refused(shape, ErrorCode::kInvalidArgument, "shape.view");  // a row of zeros
  shape.view = kCamera;
  std::copy_n(shape.view.begin(), 4, shape.view.begin() + 4);
  check_refused(shape, ErrorCode::kInvalidArgument, "shape.view");  // two equal rows
  // Depths far from the other lengths make no matrix singular.
  shape.view = {1, 0, 0, 1e8, 0, 1, 0, -1e8, 0, 0, -1.0, -2e-3, 0, 0, -1, 1e8};
  CHECK(validate(Shape(shape)).ok());

  const auto with = [](const auto& outline) { return ScreenShape{.view = kCamera, .outline = outline}; };
  constexpr const char* kVertices = "shape.outline.vertices";
  check_refused(with(ScreenPolygon{.vertices = {{0, 0}, {1, 1}}}), ErrorCode::kInvalidArgument, kVertices);
  check_refused(with(ScreenPolygon{.vertices = {{0, 0}, {1, 1}, {0, kNan}}}), ErrorCode::kNonFinite,
                kVertices);
  check_refused(with(ScreenPolygon{.vertices = std::vector<Vec2d>(kMaxOutlineVertices + 1, Vec2d::Zero())}),
                ErrorCode::kTooLarge, kVertices);
  check_refused(with(ScreenPolyline{.vertices = {}, .width = 1.0}), ErrorCode::kInvalidArgument, kVertices);
  check_refused(with(ScreenPolyline{.vertices = {{0, 0}}, .width = 0.0}), ErrorCode::kInvalidArgument,
                "shape.outline.width");
  check_refused(with(ScreenEllipse{.half_axes = Vec2d(1.0, 0.0)}), ErrorCode::kInvalidArgument,
                "shape.outline.half_axes");
  check_refused(with(ScreenEllipse{.center = Vec2d(1e13, 0.0), .half_axes = Vec2d(1.0, 1.0)}),
                ErrorCode::kOutOfRange, "shape.outline.center");
  CHECK(vertex_count(with(star(7, 1))) == 7);
}

}  // namespace
}  // namespace pointwright
