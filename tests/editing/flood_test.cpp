#include <doctest/doctest.h>

#include <limits>
#include <numbers>

#include "engine/editing/painting.h"
#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

// A flat floor (y < 0) and a wall that stands on its edge (y = 0, z > 0), 20 samples wide, spacing 0.1; and
// an island far away.
struct Corner {
  Points position, normal;
  NeighborGraph graph;
  Vec3d origin = Vec3d(5.0, 0.0, 0.0);

  Corner() {
    std::vector<Vec3f> places;
    std::vector<Vec3f> normals;
    for (int row = -20; row <= 20; ++row) {
      for (int column = 0; column < 20; ++column) {
        const float along = 0.1F * static_cast<float>(column);
        const float across = 0.1F * static_cast<float>(row);
        places.push_back(row <= 0 ? Vec3f(along, across, 0.0F) : Vec3f(along, 0.0F, across));
        normals.push_back(row <= 0 ? Vec3f::UnitZ() : Vec3f(-Vec3f::UnitY()));
      }
    }
    for (int i = 0; i < 400; ++i) {
      const int row = i / 20;
      places.emplace_back(50.0F + 0.1F * static_cast<float>(i % 20), 0.1F * static_cast<float>(row), 0.0F);
      normals.push_back(Vec3f::UnitZ());
    }
    position = test::points_of(places);
    normal = test::points_of(normals);
    graph = build_neighbor_graph(position, 8);
  }

  [[nodiscard]] PaintSurface surface() const {
    return {.position = position, .normal = normal, .origin = origin, .graph = &graph};
  }
  [[nodiscard]] Marks filled(const FloodFill& flood, Marks marks = {}) const {
    marks.resize(position.size());
    const PaintOperation operation{.mode = PaintMode::kFlood, .flood = flood};
    REQUIRE(validate(operation).ok());
    paint(operation, RegionKind::kZero, surface(), marks);
    return marks;
  }
  /// Exactly the samples that the test is true of carry the zero-region.
  template <typename Test>
  void check(const Marks& marks, const Test& inside) const {
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < marks.size(); ++i)
      wrong += ((marks[i] & test::kZeroBit) != 0) != inside(position[i]);
    CHECK(wrong == 0);
  }
};

TEST_CASE("a flood fills what is connected, bounded by angle, radius and the other region") {
  const Corner corner;
  const Vec3d seed = corner.origin + Vec3d(1.02, -1.01, 0.3);  // near the floor, not on a sample
  corner.check(corner.filled({.seed = seed}), [](const Vec3f& p) { return p.x() < 10.0F; });
  corner.check(corner.filled({.seed = seed, .angle_rad = std::numbers::pi / 4}),
               [](const Vec3f& p) { return p.x() < 10.0F && p.z() <= 0.0F; });
  corner.check(corner.filled({.seed = seed, .angle_rad = 0.0}),  // equal normals are at no angle
               [](const Vec3f& p) { return p.x() < 10.0F && p.z() <= 0.0F; });
  for (const double wide : {0.6 * std::numbers::pi, std::numbers::pi})
    corner.check(corner.filled({.seed = seed, .angle_rad = wide}),
                 [](const Vec3f& p) { return p.x() < 10.0F; });
  corner.check(corner.filled({.seed = seed, .radius = 0.65}),
               [&](const Vec3f& p) { return (corner.origin + p.cast<double>() - seed).norm() <= 0.65; });
  corner.check(corner.filled({.seed = seed, .radius = 0.2}), [](const Vec3f&) { return false; });
  // A line of samples of the other region, wide enough that no list reaches across it.
  Marks fence(corner.position.size(), 0);
  for (std::size_t i = 0; i < fence.size(); ++i) {
    const float y = corner.position[i].y();
    if (y < -0.35F && y > -0.75F) fence[i] = test::kOneBit;
  }
  const Marks held = corner.filled({.seed = seed, .stop_at_other = true}, fence);
  corner.check(held, [](const Vec3f& p) { return p.x() < 10.0F && p.y() < -0.75F; });
  CHECK(count_marked(held, RegionKind::kOne) == count_marked(fence, RegionKind::kOne));
  corner.check(corner.filled({.seed = seed}, fence), [](const Vec3f& p) { return p.x() < 10.0F; });
  const Vec3d on_fence = corner.origin + Vec3d(1.0, -0.5, 0.0);
  corner.check(corner.filled({.seed = on_fence, .stop_at_other = true}, fence),
               [](const Vec3f&) { return false; });
}

TEST_CASE("floods are the same on any machine, steal, reach duplicates and take any number of samples") {
  const Corner corner;
  test::for_all_machines(
      [&] { return corner.filled({.seed = corner.origin, .angle_rad = 0.1, .radius = 1.0}); },
      [](const Marks& a, const Marks& b) { CHECK(a == b); });

  const Points row = test::points_of({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {2, 0, 0}});
  const NeighborGraph graph = build_neighbor_graph(row, 2);
  const Vec3d origin = Vec3d::Zero();
  Marks marks(5, test::kOneBit);
  CHECK(paint({.mode = PaintMode::kFlood, .steal = true, .flood = {.seed = Vec3d(-1.0, 0.0, 0.0)}},
              RegionKind::kZero, {.position = row, .normal = row, .origin = origin, .graph = &graph},
              marks) == 5);
  CHECK(marks == Marks(5, test::kZeroBit));

  for (const std::size_t n : {0UL, 1UL, 2UL, 17UL}) {
    const Points one_place(n);
    const NeighborGraph none = build_neighbor_graph(one_place, 8);
    Marks all(n, 0);
    CHECK(paint({.mode = PaintMode::kFlood}, RegionKind::kOne,
                {.position = one_place, .normal = one_place, .origin = origin, .graph = &none}, all) == n);
  }
}

TEST_CASE("a cancelled flood changes nothing, and floods are validated") {
  const Corner corner;
  ExecutionContext context;
  context.cancel();
  Marks marks(corner.position.size(), 0);
  CHECK(paint({.mode = PaintMode::kFlood}, RegionKind::kZero, corner.surface(), marks, &context) == 0);

  const auto refused = [](const FloodFill& flood, ErrorCode code, const char* field) {
    const Result<void> result = validate(PaintOperation{.mode = PaintMode::kFlood, .flood = flood});
    REQUIRE(!result.ok());
    CHECK(result.error().code == code);
    CHECK(result.error().field == field);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused({.seed = Vec3d(nan, 0.0, 0.0)}, ErrorCode::kNonFinite, "seed");
  refused({.seed = Vec3d(1e13, 0.0, 0.0)}, ErrorCode::kOutOfRange, "seed");
  refused({.radius = 0.0}, ErrorCode::kInvalidArgument, "radius");
  refused({.angle_rad = nan}, ErrorCode::kNonFinite, "angle");
  refused({.angle_rad = -0.1}, ErrorCode::kInvalidArgument, "angle");
  refused({.angle_rad = 3.2}, ErrorCode::kInvalidArgument, "angle");
}

}  // namespace
}  // namespace pointwright
