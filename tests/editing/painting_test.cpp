#include "engine/editing/painting.h"

#include <doctest/doctest.h>

#include <chrono>
#include <limits>
#include <memory>
#include <vector>

#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

// Four samples at x = 0, 1, 2, 3; the last one faces away.
struct Row {
  Points position = test::points_of({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  Points normal = test::points_of({{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, -1}});
  Marks marks = Marks(4, 0);

  std::size_t apply(const PaintOperation& operation, RegionKind kind = RegionKind::kZero) {
    const Vec3d origin(10.0, 0.0, 0.0);
    return paint(operation, kind, {.position = position, .normal = normal, .origin = origin}, marks);
  }
};

// Paints samples without normals.
std::size_t paint_shape(const Shape& shape, RegionKind kind, const Points& position, const Vec3d& origin,
                        Marks& marks, const ExecutionContext* context = nullptr) {
  const Points no_normals;
  return paint({.shape = shape}, kind, {.position = position, .normal = no_normals, .origin = origin}, marks,
               context);
}

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

TEST_CASE("a region's samples are painted by their places among the samples, through every mode and filter") {
  Row row;
  PaintOperation use{.shape =
                         RegionShape{.source = "wing",
                                     .members = std::make_shared<const SampleMask>(SampleMask{0, 1, 0, 1})}};
  CHECK(validate(use).ok());
  CHECK(depends_on_sampling(use));
  CHECK(has_its_data(use.shape));
  CHECK_FALSE(has_its_data(RegionShape{.source = "wing", .members = nullptr}));
  CHECK(row.apply(use) == 2);
  CHECK(row.marks == Marks{0, 1, 0, 1});
  use.mode = PaintMode::kRemove;
  use.facing = Vec3d::UnitZ();
  CHECK(row.apply(use) == 1);  // the last sample faces away
  CHECK(row.marks == Marks{0, 0, 0, 1});
  use.facing.reset();
  use.mode = PaintMode::kSet;
  CHECK(row.apply(use, RegionKind::kOne) == 2);
  CHECK(row.marks == Marks{0, test::kOneBit, 0, test::kZeroBit | test::kOneBit});
  row.apply(from_x(0.5, PaintMode::kAdd));
  use.mode = PaintMode::kIntersect;
  CHECK(row.apply(use) == 1);
  CHECK(row.marks == Marks{0, test::kZeroBit | test::kOneBit, 0, test::kZeroBit | test::kOneBit});
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
  CHECK(both.marks ==
        Marks{0, test::kZeroBit, test::kZeroBit | test::kOneBit, test::kZeroBit | test::kOneBit});
  PaintOperation thief = from_x(1.5, PaintMode::kSet);
  thief.steal = true;
  CHECK(row.apply(thief, RegionKind::kOne) == 2);
  CHECK(row.marks == Marks{0, test::kZeroBit, test::kOneBit, test::kOneBit});
  PaintOperation eraser = from_x(0.0, PaintMode::kRemove);
  eraser.steal = true;  // nobody joins, so nobody leaves the other region
  CHECK(row.apply(eraser, RegionKind::kZero) == 1);
  CHECK(row.marks == Marks{0, 0, test::kOneBit, test::kOneBit});
}

PaintOperation of_mode(PaintMode mode, double distance = 0.0) {
  return {.mode = mode, .distance = distance};
}

TEST_CASE("inverting swaps members and others, clearing empties the region; other regions stay") {
  Row row;
  row.marks = {test::kZeroBit, 0, test::kOneBit, test::kZeroBit | test::kOneBit};
  Row thief = row;
  CHECK(row.apply(of_mode(PaintMode::kInvert)) == 4);
  CHECK(row.marks == Marks{0, test::kZeroBit, test::kZeroBit | test::kOneBit, test::kOneBit});
  CHECK(row.apply(of_mode(PaintMode::kInvert)) == 4);
  CHECK(row.marks == Marks{test::kZeroBit, 0, test::kOneBit, test::kZeroBit | test::kOneBit});
  PaintOperation steal = of_mode(PaintMode::kInvert);
  steal.steal = true;  // who joins leaves the other region, who leaves keeps it
  CHECK(thief.apply(steal) == 4);
  CHECK(thief.marks == Marks{0, test::kZeroBit, test::kZeroBit, test::kOneBit});
  CHECK(row.apply(of_mode(PaintMode::kClear)) == 2);
  CHECK(row.marks == Marks{0, 0, test::kOneBit, test::kOneBit});
  CHECK(row.apply(of_mode(PaintMode::kClear)) == 0);
}

TEST_CASE(
    "growing takes in what lies within the distance, shrinking gives up what lies that near to others") {
  Row row;
  row.marks = {test::kOneBit, 0, test::kOneBit, test::kZeroBit};
  CHECK(row.apply(of_mode(PaintMode::kGrow, 0.999)) == 0);
  Row stolen = row;
  CHECK(row.apply(of_mode(PaintMode::kGrow, 1.0)) == 1);  // the distance itself counts
  CHECK(row.marks == Marks{test::kOneBit, 0, test::kZeroBit | test::kOneBit, test::kZeroBit});
  PaintOperation steal = of_mode(PaintMode::kGrow, 3.0);
  steal.steal = true;
  CHECK(stolen.apply(steal) == 3);
  CHECK(stolen.marks == Marks{test::kZeroBit, test::kZeroBit, test::kZeroBit, test::kZeroBit});
  CHECK(stolen.apply(of_mode(PaintMode::kShrink, 100.0)) == 0);  // no others to be near to
  CHECK(row.apply(of_mode(PaintMode::kShrink, 1.5)) == 1);
  CHECK(row.marks == Marks{test::kOneBit, 0, test::kOneBit, test::kZeroBit});
  CHECK(row.apply(of_mode(PaintMode::kClear)) == 1);
  CHECK(row.apply(of_mode(PaintMode::kGrow, 100.0)) == 0);  // no member to grow from
}

TEST_CASE("growing and shrinking are those of brute force, on any machine") {
  const std::size_t n = 5000;
  const Points position = test::random_points(n, 11);
  const Points no_normals;
  const Vec3d origin(3.0, -2.0, 1.0);
  const PaintSurface surface{.position = position, .normal = no_normals, .origin = origin};
  Marks before(n, 0);
  paint({.shape = Sphere{.center = origin, .radius = 0.5}}, RegionKind::kZero, surface, before);
  REQUIRE(count_marked(before, RegionKind::kZero) > 50);
  for (const PaintMode mode : {PaintMode::kGrow, PaintMode::kShrink}) {
    const double distance = 0.125;
    const std::uint8_t side = mode == PaintMode::kGrow ? 1 : 0;
    Marks expected = before;
    for (std::size_t i = 0; i < n; ++i) {
      if (before[i] == side) continue;
      float nearest = std::numeric_limits<float>::infinity();
      for (std::size_t j = 0; j < n; ++j) {
        if (before[j] == side) nearest = std::min(nearest, (position[i] - position[j]).norm());
      }
      if (nearest <= distance) expected[i] = side;
    }
    REQUIRE(expected != before);
    test::for_all_machines(
        [&] {
          Marks marks = before;
          paint(of_mode(mode, distance), RegionKind::kZero, surface, marks);
          return marks;
        },
        [&](const Marks&, const Marks& marks) { CHECK(marks == expected); });
  }
}

TEST_CASE("culling never changes what a shape covers") {
  const std::size_t n = 20'000;
  const Points position = test::random_points(n, 3);
  const Vec3d origin(100.0, -50.0, 3.0);
  Stroke scribble{.vertices = {}, .radius = 0.05};
  const Points path = test::random_points(300, 4);
  for (std::size_t i = 0; i < path.size(); ++i) scribble.vertices.push_back(origin + path[i].cast<double>());
  PointSet balls{.points = scribble.vertices, .radii = {}};
  for (std::size_t i = 0; i < path.size(); ++i)
    balls.radii.push_back(0.001 * static_cast<double>(i % 100 + 1));
  const std::vector<Shape> shapes = {
      Shape(scribble),
      Shape(balls),
      Shape(PointSet{.points = scribble.vertices, .radii = {0.03}}),
      Shape(Sphere{.center = origin + Vec3d(0.3, 0.2, 0.1), .radius = 0.4}),
      Shape(AxisBox{.min = origin - Vec3d(0.5, 0.1, 2.0), .max = origin + Vec3d(0.1, 0.7, 0.3)}),
      Shape(HalfSpace{.point = origin, .normal = Vec3d(1.0, -2.0, 0.5)}),
      Shape(Everything{}),
      Shape(Stroke{.vertices = {origin + Vec3d(5.0, 5.0, 5.0)}, .radius = 0.1})};  // misses the cloud
  for (const Shape& shape : shapes) {
    Marks marks(n, 0);
    const std::size_t changed = paint_shape(shape, RegionKind::kOne, position, origin, marks);
    std::size_t expected = 0;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const bool inside = contains(shape, origin + position[i].cast<double>());
      expected += inside ? 1 : 0;
      wrong += (marks[i] == test::kOneBit) != inside;
    }
    CHECK(wrong == 0);
    CHECK(changed == expected);
    test::for_all_machines(
        [&] {
          Marks again(n, 0);
          paint_shape(shape, RegionKind::kOne, position, origin, again);
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
  CHECK(paint_shape(zigzag, RegionKind::kZero, position, Vec3d::Zero(), marks) == 0);
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
  paint_shape(stroke, RegionKind::kZero, position, origin, marks);
  for (std::size_t i = 0; i < places.size(); ++i) {
    REQUIRE((marks[i] != 0) == contains(stroke, origin + position[i].cast<double>()));
  }
  CHECK(count_marked(marks, RegionKind::kZero) >= 1000);
}

TEST_CASE("cancelled painting stops") {
  ExecutionContext context;
  context.cancel();
  Marks marks(300, 0);
  paint_shape(Everything{}, RegionKind::kZero, Points(300), Vec3d::Zero(), marks, &context);
  CHECK(count_marked(marks, RegionKind::kZero) == 0);
}

TEST_CASE("painting works on any number of samples") {
  for (const std::size_t n : {0, 1, 15, 16, 17}) {
    const Points position(n);  // all in one place
    const Vec3d origin = Vec3d::Zero();
    const PaintSurface surface{.position = position, .normal = position, .origin = origin};
    Marks grown(n, 0);
    CHECK(paint(of_mode(PaintMode::kGrow, 1e-30), RegionKind::kZero, surface, grown) == 0);
    if (n > 0) grown[0] = test::kZeroBit;
    CHECK(paint(of_mode(PaintMode::kGrow, 1e-30), RegionKind::kZero, surface, grown) == (n > 0 ? n - 1 : 0));
    CHECK(paint(of_mode(PaintMode::kInvert), RegionKind::kZero, surface, grown) == n);
    CHECK(paint(of_mode(PaintMode::kShrink, 1.0), RegionKind::kZero, surface, grown) == 0);
    Marks marks(n, 0);
    CHECK(paint_shape(Everything{}, RegionKind::kZero, Points(n), Vec3d::Zero(), marks) == n);
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
  // A shape that the mode does not paint with is not looked at; a direction without a shape is refused.
  CHECK(validate(PaintOperation{.mode = PaintMode::kInvert, .shape = Sphere{.radius = -1.0}}).ok());
  const Result<void> facing =
      validate(PaintOperation{.mode = PaintMode::kGrow, .facing = Vec3d::UnitX(), .distance = 1.0});
  REQUIRE(!facing.ok());
  CHECK(facing.error().field == "facing");
  const auto distance_refused = [](double distance, ErrorCode code) {
    const Result<void> result = validate(of_mode(PaintMode::kShrink, distance));
    REQUIRE(!result.ok());
    CHECK(result.error().code == code);
    CHECK(result.error().field == "distance");
  };
  distance_refused(0.0, ErrorCode::kInvalidArgument);
  distance_refused(-1.0, ErrorCode::kInvalidArgument);
  distance_refused(nan, ErrorCode::kNonFinite);
  distance_refused(2e12, ErrorCode::kOutOfRange);
  CHECK(validate(of_mode(PaintMode::kGrow, 1e-6)).ok());
}

}  // namespace
}  // namespace pointwright
