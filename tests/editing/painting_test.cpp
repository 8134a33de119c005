#include "engine/editing/painting.h"

#include <doctest/doctest.h>

#include <chrono>
#include <limits>
#include <vector>

#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

constexpr std::uint8_t kZeroBit = 1;
constexpr std::uint8_t kOneBit = 2;

// Four samples at x = 0, 1, 2, 3; the last one faces away.
struct Row {
  Points position = test::points_of({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  Points normal = test::points_of({{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, -1}});
  Marks marks = Marks(4, 0);

  std::size_t apply(const PaintOperation& operation, RegionKind kind = RegionKind::kZero) {
    return paint(operation, kind, position, normal, Vec3d(10.0, 0.0, 0.0), marks);
  }
};

PaintOperation from_x(double x, PaintMode mode) {
  return {.mode = mode, .shape = HalfSpace{.point = Vec3d(10.0 + x, 0.0, 0.0), .normal = Vec3d::UnitX()}};
}

TEST_CASE("the modes add, remove, intersect and set") {
  Row row;
  CHECK(row.apply(from_x(1.5, PaintMode::kAdd)) == 2);
  CHECK(row.marks == Marks{0, 0, 1, 1});
  CHECK(row.apply(from_x(1.5, PaintMode::kAdd)) == 0);  // nothing is left to change
  CHECK(row.apply(from_x(2.5, PaintMode::kRemove)) == 1);
  CHECK(row.marks == Marks{0, 0, 1, 0});
  CHECK(row.apply(from_x(0.5, PaintMode::kSet)) == 2);
  CHECK(row.marks == Marks{0, 1, 1, 1});
  CHECK(row.apply(from_x(1.5, PaintMode::kIntersect)) == 1);
  CHECK(row.marks == Marks{0, 0, 1, 1});
  CHECK(count_marked(row.marks, RegionKind::kZero) == 2);
  CHECK(count_marked(row.marks, RegionKind::kOne) == 0);
}

TEST_CASE("a facing brush does not paint samples that look away") {
  Row row;
  PaintOperation brush = from_x(0.5, PaintMode::kAdd);
  brush.facing = Vec3d(0.0, 0.0, 5.0);
  CHECK(row.apply(brush) == 2);
  CHECK(row.marks == Marks{0, 1, 1, 0});
  brush.mode = PaintMode::kIntersect;  // what is not covered leaves
  brush.facing = Vec3d(0.0, 0.0, -1.0);
  CHECK(row.apply(brush) == 2);
  CHECK(row.marks == Marks{0, 0, 0, 0});
}

TEST_CASE("without steal a sample ends in both regions, with it in the newer one") {
  Row row;
  row.apply(from_x(0.5, PaintMode::kAdd), RegionKind::kZero);
  Row both = row;
  CHECK(both.apply(from_x(1.5, PaintMode::kAdd), RegionKind::kOne) == 2);
  CHECK(both.marks == Marks{0, kZeroBit, kZeroBit | kOneBit, kZeroBit | kOneBit});
  PaintOperation thief = from_x(1.5, PaintMode::kSet);
  thief.steal = true;
  CHECK(row.apply(thief, RegionKind::kOne) == 2);
  CHECK(row.marks == Marks{0, kZeroBit, kOneBit, kOneBit});
  PaintOperation eraser = from_x(0.0, PaintMode::kRemove);
  eraser.steal = true;  // nobody joins, so nobody leaves the other region
  CHECK(row.apply(eraser, RegionKind::kZero) == 1);
  CHECK(row.marks == Marks{0, 0, kOneBit, kOneBit});
}

TEST_CASE("culling never changes what a shape covers") {
  const std::size_t n = 20'000;
  const Points position = test::random_points(n, 3);
  const Vec3d origin(100.0, -50.0, 3.0);
  Stroke scribble{.vertices = {}, .radius = 0.05};
  const Points path = test::random_points(300, 4);
  for (std::size_t i = 0; i < path.size(); ++i) scribble.vertices.push_back(origin + path[i].cast<double>());
  const std::vector<Shape> shapes = {
      Shape(scribble),
      Shape(Sphere{.center = origin + Vec3d(0.3, 0.2, 0.1), .radius = 0.4}),
      Shape(AxisBox{.min = origin - Vec3d(0.5, 0.1, 2.0), .max = origin + Vec3d(0.1, 0.7, 0.3)}),
      Shape(HalfSpace{.point = origin, .normal = Vec3d(1.0, -2.0, 0.5)}),
      Shape(Everything{}),
      Shape(Stroke{.vertices = {origin + Vec3d(5.0, 5.0, 5.0)}, .radius = 0.1})};  // misses the cloud
  for (const Shape& shape : shapes) {
    Marks marks(n, 0);
    const std::size_t changed = paint({.shape = shape}, RegionKind::kOne, position, Points(), origin, marks);
    std::size_t expected = 0;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const bool inside = contains(shape, origin + position[i].cast<double>());
      expected += inside ? 1 : 0;
      wrong += (marks[i] == kOneBit) != inside;
    }
    CHECK(wrong == 0);
    CHECK(changed == expected);
    test::for_all_machines(
        [&] {
          Marks again(n, 0);
          paint({.shape = shape}, RegionKind::kOne, position, Points(), origin, again);
          return again;
        },
        [](const Marks& a, const Marks& b) { CHECK(a == b); });
  }
}

TEST_CASE("a long stroke of long segments costs what lies within its radius, not samples times segments") {
  // Diagonals that zig-zag past the cloud: the bounding box of each holds all of it, none comes near.
  const Points position = test::random_points(20'000, 5);
  Stroke zigzag{.vertices = {}, .radius = 0.01};
  for (std::size_t i = 0; i < kMaxStrokeVertices; ++i) {
    const double z = static_cast<double>(i) * 1e-6;
    zigzag.vertices.push_back(i % 2 == 0 ? Vec3d(-10.0, 5.0, z) : Vec3d(5.0, -10.0, z));
  }
  Marks marks(position.size(), 0);
  const auto begin = std::chrono::steady_clock::now();
  CHECK(paint({.shape = zigzag}, RegionKind::kZero, position, Points(), Vec3d::Zero(), marks) == 0);
  // Testing every segment at every sample takes 30 s.
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(10));
}

TEST_CASE("culling keeps the segments that only just reach, at large coordinates too") {
  const Vec3d origin(1e9, -3e8, 7e8);
  Points position;
  Stroke stroke{.vertices = {}, .radius = 0.25};
  std::vector<Vec3f> places;
  for (int i = 0; i < 2000; ++i) {
    const auto x = static_cast<float>(i % 100);
    const auto y = static_cast<float>(i / 100);
    places.emplace_back(x, y, i % 2 == 0 ? 0.25F : 0.5F);  // at the radius, and beyond it
    stroke.vertices.push_back(origin + Vec3d(static_cast<double>(x), static_cast<double>(y), 0.0));
  }
  position.resize(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) position.set(i, places[i]);
  Marks marks(places.size(), 0);
  paint({.shape = stroke}, RegionKind::kZero, position, Points(), origin, marks);
  for (std::size_t i = 0; i < places.size(); ++i) {
    REQUIRE((marks[i] != 0) == contains(stroke, origin + position[i].cast<double>()));
  }
  CHECK(count_marked(marks, RegionKind::kZero) >= 1000);
}

TEST_CASE("cancelled painting stops") {
  ExecutionContext context;
  context.cancel();
  Marks marks(300, 0);
  paint({.shape = Everything{}}, RegionKind::kZero, Points(300), Points(), Vec3d::Zero(), marks, &context);
  CHECK(count_marked(marks, RegionKind::kZero) == 0);
}

TEST_CASE("painting works on any number of samples") {
  for (const std::size_t n : {0, 1, 15, 16, 17}) {
    Marks marks(n, 0);
    CHECK(paint({.shape = Everything{}}, RegionKind::kZero, Points(n), Points(n), Vec3d::Zero(), marks) == n);
    CHECK(count_marked(marks, RegionKind::kZero) == n);
  }
}

TEST_CASE("operations are validated") {
  CHECK(validate(PaintOperation{.shape = Everything{}, .facing = Vec3d::UnitX()}).ok());
  const Result<void> zero = validate(PaintOperation{.shape = Everything{}, .facing = Vec3d::Zero()});
  REQUIRE(!zero.ok());
  CHECK(zero.error().code == ErrorCode::kInvalidArgument);
  CHECK(zero.error().field == "facing");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Result<void> not_finite =
      validate(PaintOperation{.shape = Everything{}, .facing = Vec3d(nan, 0.0, 1.0)});
  REQUIRE(!not_finite.ok());
  CHECK(not_finite.error().code == ErrorCode::kNonFinite);
  const Result<void> shape = validate(PaintOperation{.shape = Sphere{.radius = -1.0}});
  REQUIRE(!shape.ok());
  CHECK(shape.error().field == "shape.radius");
}

}  // namespace
}  // namespace pointwright
