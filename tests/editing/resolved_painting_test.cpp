#include "engine/editing/resolved_painting.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "engine/spatial/kd_tree.h"
#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

// A torus beside a large origin, to be painted.
struct Scan {
  test::Surface surface;
  NeighborGraph graph;
  Vec3d origin = Vec3d(400'000.0, 5'000'000.0, 100.0);

  explicit Scan(std::size_t count, std::uint64_t seed = 3)
      : surface(test::torus(count, 1.0, 0.4, test::Sampling::kRandom, seed)),
        graph(build_neighbor_graph(surface.position, 10)) {}

  [[nodiscard]] PaintSurface painted_on() const {
    return {.position = surface.position, .normal = surface.normal, .origin = origin, .graph = &graph};
  }
  void apply(const std::vector<PaintOperation>& operations, RegionKind kind, Marks& marks) const {
    for (const PaintOperation& operation : operations) {
      REQUIRE(validate(operation).ok());
      CHECK_FALSE(depends_on_sampling(operation));
      paint(operation, kind, painted_on(), marks);
    }
  }
  [[nodiscard]] Vec3d at(double x, double y, double z) const { return origin + Vec3d(x, y, z); }
};

// From above, over all of the torus: orthographic.
ScreenShape from_above(const Scan& scan, double half) {
  ScreenShape screen;
  const double s = 0.5;
  screen.view = {s, 0, 0,  -s * scan.origin.x(), 0, s, 0, -s * scan.origin.y(),
                 0, 0, -s, s * scan.origin.z(),  0, 0, 0, 1};
  screen.outline = ScreenPolygon{.vertices = {{-half, -half}, {half, -half}, {half, half}, {-half, half}}};
  return screen;
}

std::vector<PaintOperation> dependent_operations(const Scan& scan) {
  const Shape ball = Sphere{.center = scan.at(0.9, 0.3, 0.2), .radius = 0.6};
  const Vec3d up = Vec3d::UnitZ();
  ScreenShape seen = from_above(scan, 0.45);
  seen.visible = true;
  SampleMask kept(scan.surface.size(), 0);
  for (std::size_t i = 0; i < kept.size(); ++i)
    kept[i] = scan.surface.position[i].y() > 0.1F && i % 7 != 0 ? 1 : 0;
  const RegionShape region{.source = "kept", .members = std::make_shared<const SampleMask>(kept)};
  std::vector<PaintOperation> operations;
  for (const PaintMode mode : {PaintMode::kAdd, PaintMode::kRemove, PaintMode::kIntersect, PaintMode::kSet}) {
    operations.push_back({.mode = mode, .shape = ball, .facing = up});
    operations.push_back({.mode = mode, .shape = Everything{}, .facing = up});
    operations.push_back({.mode = mode, .shape = seen});
    operations.push_back({.mode = mode, .shape = region});
    operations.push_back({.mode = mode, .shape = region, .facing = up});
    // Covers nothing.
    operations.push_back(
        {.mode = mode, .shape = Sphere{.center = scan.at(9.0, 0.0, 0.0), .radius = 1.0}, .facing = up});
  }
  operations.push_back({.mode = PaintMode::kGrow, .distance = 0.1});
  operations.push_back({.mode = PaintMode::kGrow, .distance = 1e-9});
  operations.push_back({.mode = PaintMode::kShrink, .distance = 0.1});
  operations.push_back({.mode = PaintMode::kShrink, .distance = 10.0});
  operations.push_back({.mode = PaintMode::kFlood,
                        .flood = {.seed = scan.at(1.4, 0.0, 0.0), .radius = 0.7, .stop_at_other = true}});
  operations.push_back({.mode = PaintMode::kFlood,
                        .flood = {.seed = scan.at(1.0, 0.1, 0.4), .angle_rad = 0.05, .radius = 0.4}});
  return operations;
}

TEST_CASE("an operation and what is recorded of it leave the same marks") {
  const Scan scan(6000);
  Marks before(scan.surface.size(), 0);
  scan.apply({{.shape = Sphere{.center = scan.at(1.0, 0.0, 0.0), .radius = 0.5}}}, RegionKind::kZero, before);
  scan.apply({{.shape = Sphere{.center = scan.at(0.5, 0.8, 0.1), .radius = 0.7}}}, RegionKind::kOne, before);
  REQUIRE(std::ranges::count(before, std::uint8_t{3}) > 0);
  for (PaintOperation operation : dependent_operations(scan)) {
    for (const bool steal : {false, true}) {
      for (const RegionKind kind : {RegionKind::kZero, RegionKind::kOne}) {
        operation.steal = steal;
        CHECK(validate(operation).ok());
        CHECK(depends_on_sampling(operation));
        Marks expected = before;
        paint(operation, kind, scan.painted_on(), expected);
        Marks marks = before;
        scan.apply(resolved(operation, kind, scan.painted_on(), before), kind, marks);
        CHECK(marks == expected);
      }
    }
  }
}

TEST_CASE("what does not depend on the sampling, or loses nothing to its filters, is recorded as it is") {
  const Scan scan(3000);
  const Marks marks(scan.surface.size(), 0);
  const Sphere ball{.center = scan.at(1.0, 0.0, 0.4), .radius = 0.2};
  const auto recorded = [&](const PaintOperation& operation) {
    return resolved(operation, RegionKind::kOne, scan.painted_on(), marks);
  };
  for (const PaintMode mode : {PaintMode::kAdd, PaintMode::kInvert, PaintMode::kClear}) {
    const auto list = recorded({.mode = mode, .shape = ball, .steal = true});
    REQUIRE(list.size() == 1);
    CHECK(list[0].mode == mode);
    CHECK(list[0].steal);
  }
  // On the top of the tube everything looks up.
  const auto list = recorded({.shape = ball, .facing = Vec3d::UnitZ(), .steal = true});
  REQUIRE(list.size() == 1);
  CHECK(std::holds_alternative<Sphere>(list[0].shape));
  CHECK_FALSE(list[0].facing.has_value());
  CHECK(list[0].steal);
  // A flood that starts nowhere near, and growing of an empty region, change nothing.
  CHECK(recorded({.mode = PaintMode::kFlood, .flood = {.seed = scan.at(9.0, 9.0, 9.0), .radius = 0.1}})
            .empty());
  CHECK(recorded({.mode = PaintMode::kGrow, .distance = 1.0}).empty());
}

// Samples of a fine scan whose verdict is not that of the nearest sample of the preview, and those within one
// spacing of the preview of where its verdict changes: nobody else may differ.
struct Overlap {
  std::size_t fine = 0;
  std::size_t differ = 0;
  std::size_t at_border = 0;
  std::size_t far_off = 0;  ///< differ and are not at the border
  std::size_t both = 0;     ///< selected on the fine scan, and by the nearest sample of the preview
  std::size_t either = 0;

  [[nodiscard]] double jaccard() const { return static_cast<double>(both) / static_cast<double>(either); }
};

// `reach`: how far a sample may stand from the nearest one of the preview.
Overlap overlap_of(const Scan& preview, const Marks& preview_marks, const Scan& full, const Marks& full_marks,
                   float reach) {
  const KdTree tree(preview.surface.position);
  std::vector<Neighbor> found;
  Overlap overlap{.fine = full.surface.size()};
  for (std::size_t i = 0; i < full.surface.size(); ++i) {
    const Vec3f place = full.surface.position[i];
    tree.nearest(place, 1, found);
    const bool near = preview_marks[found[0].index] != 0;
    const bool verdict = full_marks[i] != 0;
    // The border is near where samples of both kinds are.
    tree.within(place, 2.0F * reach, preview.surface.size(), found);
    const bool border = std::ranges::any_of(
        found, [&](const Neighbor& other) { return (preview_marks[other.index] != 0) != near; });
    overlap.differ += near != verdict ? 1 : 0;
    overlap.at_border += border ? 1 : 0;
    overlap.far_off += near != verdict && !border ? 1 : 0;
    overlap.both += near && verdict ? 1 : 0;
    overlap.either += near || verdict ? 1 : 0;
  }
  return overlap;
}

TEST_CASE("a painting selects the same part of the surface on a preview and on the full scan") {
  const Scan preview(10'000, 5);
  const Scan full(40'000, 6);
  // The farthest that a full sample is from the preview.
  const KdTree tree(preview.surface.position);
  std::vector<Neighbor> found;
  float reach = 0.0F;
  for (std::size_t i = 0; i < full.surface.size(); ++i) {
    tree.nearest(full.surface.position[i], 1, found);
    reach = std::max(reach, std::sqrt(found[0].distance_sq));
  }
  const Vec3d on_top = preview.at(1.0, 0.0, 0.4);
  ScreenShape lasso = from_above(preview, 0.45);
  ScreenShape seen = lasso;
  seen.visible = true;
  struct Case {
    std::string name;
    std::vector<PaintOperation> operations;
  };
  Stroke stroke{.vertices = {}, .radius = 0.12};
  for (int i = 0; i < 30; ++i)
    stroke.vertices.push_back(
        preview.at(1.4 * std::cos(0.1 * i), 1.4 * std::sin(0.1 * i), 0.2 * std::sin(0.3 * i)));
  const PaintOperation ball{.shape = Sphere{.center = on_top, .radius = 0.5}};
  const std::vector<Case> cases = {
      {"sphere", {ball}},
      {"stroke", {{.shape = stroke}}},
      {"box", {{.shape = AxisBox{.min = preview.at(-0.5, -2.0, -1.0), .max = preview.at(0.7, 0.4, 0.3)}}}},
      {"half space", {{.shape = HalfSpace{.point = on_top, .normal = Vec3d(1.0, 0.3, -0.5)}}}},
      {"points", {{.shape = PointSet{.points = {on_top, preview.at(-1.0, 0.3, 0.4)}, .radii = {0.3, 0.45}}}}},
      {"screen", {{.shape = lasso}}},
      {"all", {{.shape = Everything{}}}},
      {"facing", {{.shape = stroke, .facing = Vec3d(1.0, 0.0, 0.2)}}},
      {"visible", {{.shape = seen}}},
      {"flood", {{.mode = PaintMode::kFlood, .flood = {.seed = on_top, .radius = 0.8}}}},
      {"grow", {ball, {.mode = PaintMode::kGrow, .distance = 0.15}}},
      {"shrink", {ball, {.mode = PaintMode::kShrink, .distance = 0.15}}},
  };
  for (const Case& each : cases) {
    INFO(each.name);
    Marks preview_marks(preview.surface.size(), 0);
    Marks full_marks(full.surface.size(), 0);
    for (const PaintOperation& operation : each.operations) {
      const auto recorded = resolved(operation, RegionKind::kOne, preview.painted_on(), preview_marks);
      preview.apply(recorded, RegionKind::kOne, preview_marks);
      full.apply(recorded, RegionKind::kOne, full_marks);
    }
    const Overlap overlap = overlap_of(preview, preview_marks, full, full_marks, reach);
    MESSAGE(each.name, ": Jaccard ", overlap.jaccard(), ", ", overlap.differ, " differ of ",
            overlap.at_border, " at the border, of ", overlap.fine);
    CHECK(overlap.either > overlap.fine / 50);
    // A volume's own border crosses between a sample and its nearest one of the preview, which is at most
    // `reach` away: there both kinds are within twice that. Balls reach no farther than that, either.
    CHECK(overlap.far_off == 0);
    CHECK(2 * overlap.differ <= overlap.at_border);
  }
}

}  // namespace
}  // namespace pointwright
