#include "engine/editing/visibility.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/spatial/splat_radius.h"
#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

const Vec3d kOrigin(500'000.0, -4'000'000.0, 300.0);

// An eye that looks at a place, both relative to kOrigin; model to clip space as a browser's camera has it.
struct Camera {
  Vec3d eye;
  Vec3d target = Vec3d::Zero();
  double half_height = 0.5;  // of the picture: at distance 1, or of all of it in a parallel view
  bool parallel = false;
  double near = 0.01;
  double far = 100.0;

  [[nodiscard]] ScreenShape all() const {
    const Vec3d back = (eye - target).normalized();
    const Vec3d right = back.unitOrthogonal();
    const Vec3d up = back.cross(right);
    Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
    view.block<1, 3>(0, 0) = right.transpose();
    view.block<1, 3>(1, 0) = up.transpose();
    view.block<1, 3>(2, 0) = back.transpose();
    view.block<3, 1>(0, 3) = -view.block<3, 3>(0, 0) * (eye + kOrigin);
    Eigen::Matrix4d clip = Eigen::Matrix4d::Zero();
    clip(0, 0) = clip(1, 1) = 1.0 / half_height;
    if (parallel) {
      clip(2, 2) = -2.0 / (far - near);
      clip(2, 3) = -(far + near) / (far - near);
      clip(3, 3) = 1.0;
    } else {
      clip(2, 2) = -(far + near) / (far - near);
      clip(2, 3) = -2.0 * far * near / (far - near);
      clip(3, 2) = -1.0;
    }
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = clip * view;
    ScreenShape shape{.outline = ScreenPolygon{.vertices = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}},
                      .visible = true};
    std::copy_n(rows.data(), 16, shape.view.begin());
    REQUIRE(validate(Shape(shape)).ok());
    return shape;
  }
  // From the place to the eye, unit length.
  [[nodiscard]] Vec3d towards(const Vec3d& place) const {
    return parallel ? (eye - target).normalized() : (eye - place).normalized();
  }
};

struct Subject {
  test::Surface surface;
  NeighborGraph graph;
  float largest_radius = 0.0F;

  explicit Subject(const test::Surface& made)
      : surface(made), graph(build_neighbor_graph(surface.position, 10)) {
    for (const float radius : splat_radii(surface.position, surface.normal, graph))
      largest_radius = std::max(largest_radius, radius);
  }
  [[nodiscard]] PaintSurface painted_on() const {
    return {.position = surface.position, .normal = surface.normal, .origin = kOrigin, .graph = &graph};
  }
  [[nodiscard]] SampleMask seen_by(const Camera& camera) const {
    return visible_samples(camera.all(), painted_on());
  }
  [[nodiscard]] Vec3d place(std::size_t i) const { return surface.position[i].cast<double>(); }
  [[nodiscard]] double cosine(std::size_t i, const Camera& camera) const {
    return surface.normal[i].cast<double>().dot(camera.towards(place(i)));
  }
};

TEST_CASE("of a sphere the front is visible, from near and far, in perspective and parallel views") {
  const Subject sphere(test::sphere(20'000, 1.0, test::Sampling::kRegular));
  const double r = static_cast<double>(sphere.largest_radius);
  // Nearer to the horizon than this, a tangent disc of the front may stand before a sample, or the sheet
  // behind stand no more than the tolerance (2 r / 0.2 along the ray) behind the one in front: 2 cos < 2 r /
  // 0.2.
  const double band = 5.0 * r + r;
  REQUIRE(band < 0.3);
  for (const Camera& camera :
       {Camera{.eye = {0.0, 0.0, 4.0}}, Camera{.eye = {2.0, -1.0, 1.0}, .half_height = 1.0},
        Camera{.eye = {0.0, 50.0, 3.0}, .half_height = 0.03},
        Camera{.eye = {3.0, 2.0, 1.0}, .half_height = 1.2, .parallel = true}}) {
    const SampleMask visible = sphere.seen_by(camera);
    std::size_t hidden_front = 0;
    std::size_t seen_back = 0;
    std::size_t front = 0;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const double cosine = sphere.cosine(i, camera);
      front += cosine > band ? 1 : 0;
      hidden_front += cosine > band && visible[i] == 0 ? 1 : 0;
      seen_back += cosine < -band && visible[i] != 0 ? 1 : 0;
    }
    CHECK(front > 4'000);
    CHECK(hidden_front == 0);
    CHECK(seen_back == 0);
  }
}

TEST_CASE("of two sheets the one in front is visible, all of it, at any zoom") {
  const double gap = 0.1;
  const std::size_t side = 150;
  const double spacing = 2.0 / static_cast<double>(side);
  // On a lattice discs of 0.9 spacings leave no gap: half of a cell's diagonal is 0.71.
  const Subject sheets(test::parallel_sheets(side, spacing, gap, test::Sampling::kRegular));
  const double half = 0.5 * gap;
  for (const Camera& camera : {Camera{.eye = {0.0, 0.0, 3.0}}, Camera{.eye = {0.1, 0.2, 0.4}},
                               Camera{.eye = {0.01, 0.02, 0.1}, .half_height = 0.3, .near = 1e-4},
                               Camera{.eye = {0.0, 0.0, 2.0}, .half_height = 1.3, .parallel = true},
                               Camera{.eye = {0.5, 0.1, 2.0}, .half_height = 0.05, .parallel = true},
                               Camera{.eye = {0.0, 0.3, -3.0}}}) {
    const SampleMask visible = sheets.seen_by(camera);
    const ScreenShape shape = camera.all();
    const bool above = camera.eye.z() > 0.0;
    std::size_t shown = 0;
    std::size_t missing = 0;
    std::size_t behind = 0;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const Vec3d place = sheets.place(i);
      if (!contains(shape, kOrigin + place)) continue;
      if ((place.z() > 0.0) == above) {
        ++shown;
        missing += visible[i] == 0 ? 1 : 0;
        continue;
      }
      // Where the ray to the sample passes the other sheet; past its rim it is seen.
      const Vec3d ray = camera.towards(place);
      const Vec3d passed = place + ray * ((above ? half : -half) - place.z()) / ray.z();
      const bool inside = passed.head<2>().cwiseAbs().maxCoeff() < 1.0 - 3.0 * spacing;
      behind += inside && visible[i] != 0 ? 1 : 0;
    }
    CHECK(shown > 5);
    CHECK(missing == 0);
    CHECK(behind == 0);
  }
}

// How far along the ray from `from` a torus around z is met, beyond `least`; infinite where it is not. By
// small steps of the distance field, which never pass the surface.
double meets_torus(const Vec3d& from, const Vec3d& dir, double least, double major, double minor) {
  for (double s = least; s < 10.0;) {
    const Vec3d p = from + s * dir;
    const double ring = std::hypot(p.x(), p.y()) - major;
    const double distance = std::hypot(ring, p.z()) - minor;
    if (distance < 1e-6) return s;
    s += distance;
  }
  return 1e300;
}

TEST_CASE("a thin line and a dot see no more of the sheet behind than a broad outline does") {
  const Subject sheets(test::parallel_sheets(101, 0.01, 1.0, test::Sampling::kRegular));
  ScreenShape shape = Camera{.eye = {0.0, 0.0, 4.0}, .half_height = 1.0, .parallel = true}.all();
  std::size_t seen = 0;
  for (const double width : {1e-4, 1e-3, 0.012, 0.05}) {
    for (const std::vector<Vec2d>& vertices :
         {std::vector<Vec2d>{{0.0, -0.4}, {0.0, 0.4}}, std::vector<Vec2d>{{0.005, 0.0}},
          std::vector<Vec2d>{{-0.4, 0.1}, {0.4, 0.1}}}) {
      shape.outline = ScreenPolyline{.vertices = vertices, .width = width};
      Marks marks(sheets.surface.size(), 0);
      paint({.shape = shape}, RegionKind::kOne, sheets.painted_on(), marks);
      for (std::size_t i = 0; i < marks.size(); ++i) {
        if (marks[i] == 0) continue;
        ++seen;
        CHECK(sheets.surface.position[i].z() > 0.0F);
      }
    }
  }
  CHECK(seen > 100);
}

TEST_CASE("a torus that hides part of itself: as rays find it") {
  const Subject torus(test::torus(30'000, 1.0, 0.35, test::Sampling::kRegular));
  const double r = static_cast<double>(torus.largest_radius);
  for (const Camera& camera : {Camera{.eye = {3.0, 0.5, 1.2}, .half_height = 0.8},
                               Camera{.eye = {2.2, 0.0, 0.3}, .half_height = 1.5},
                               Camera{.eye = {3.0, 1.0, 0.8}, .half_height = 1.6, .parallel = true}}) {
    const SampleMask visible = torus.seen_by(camera);
    std::size_t asked = 0;
    std::size_t wrong = 0;
    std::size_t hidden = 0;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const double cosine = torus.cosine(i, camera);
      // Near its own horizon a sample's disc is seen from its edge.
      if (std::abs(cosine) < 0.3) continue;
      // A back side is hidden by its own front, a chord of 0.7 |cos| before it: more than 2 r / |cos|, and
      // some room.
      if (cosine < 0.0 && 0.7 * cosine * cosine < 3.0 * r) continue;
      const Vec3d place = torus.place(i);
      const Vec3d ray = camera.towards(place);
      // Other parts that end near the ray may or may not be met by it: moved rays must agree.
      const Vec3d u = ray.unitOrthogonal();
      const Vec3d v = ray.cross(u);
      int met = 0;
      for (int k = 0; k < 8; ++k) {
        const double angle = k * std::numbers::pi / 4.0;
        const Vec3d from = place + 3.0 * r * (std::cos(angle) * u + std::sin(angle) * v);
        // Past the surface around the sample itself, whose tolerance is 2 r / cos along the ray.
        const double least = (cosine > 0.0 ? 1.0 : -1.0) * 3.0 * r / std::abs(cosine) + 4.0 * r;
        const double at = cosine > 0.0 ? meets_torus(from, ray, least + 2.0 * r, 1.0, 0.35) : 0.0;
        met += at < 9.0 ? 1 : 0;
      }
      if (met != 0 && met != 8) continue;
      ++asked;
      hidden += met == 8 ? 1 : 0;
      wrong += (visible[i] != 0) != (met == 0) ? 1 : 0;
    }
    CHECK(asked > 2 * visible.size() / 5);
    CHECK(hidden > visible.size() / 10);
    CHECK(wrong == 0);
  }
}

TEST_CASE("what the view does not show hides nothing and is not visible") {
  // A sheet, and samples on the way to it: in front of the near plane, behind the eye, beyond the far plane.
  test::Surface sheet = test::plane(40, 0.05, test::Sampling::kRegular);
  const std::size_t n = sheet.size();
  const Camera camera{.eye = {0.0, 0.0, 2.0}, .near = 0.1, .far = 10.0};
  const std::vector<Vec3f> others = {{0.0F, 0.0F, 1.95F}, {0.0F, 0.0F, 2.05F}, {0.0F, 0.0F, -9.0F}};
  Points position(n + others.size());
  Points normal(n + others.size());
  for (std::size_t i = 0; i < n; ++i) {
    position.set(i, sheet.position[i]);
    normal.set(i, sheet.normal[i]);
  }
  for (std::size_t i = 0; i < others.size(); ++i) {
    position.set(n + i, others[i]);
    normal.set(n + i, Vec3f::UnitZ());
  }
  const Subject subject({.position = position, .normal = normal});
  const SampleMask visible = subject.seen_by(camera);
  for (std::size_t i = 0; i < n; ++i) {
    const bool inside = contains(camera.all(), kOrigin + subject.place(i));
    REQUIRE((visible[i] != 0) == inside);
  }
  for (std::size_t i = n; i < visible.size(); ++i) CHECK(visible[i] == 0);
}

TEST_CASE("any number of samples can be looked at; the same ones are visible on any machine") {
  const Camera camera{.eye = {0.0, 0.0, 3.0}, .half_height = 1.0};
  for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{17}}) {
    test::Surface surface{.position = test::identical(n, {0.1F, 0.1F, 0.0F}), .normal = Points(n)};
    for (std::size_t i = 0; i < n; ++i) surface.normal.set(i, Vec3f::UnitZ());
    const SampleMask visible = Subject(surface).seen_by(camera);
    CHECK(std::ranges::count(visible, std::uint8_t{1}) == static_cast<std::ptrdiff_t>(n));
  }
  const Subject torus(test::torus(20'000, 1.0, 0.4, test::Sampling::kRandom, 8));
  test::for_all_machines(
      [&] {
        return torus.seen_by({.eye = {2.0, 1.0, 1.0}});
      },
      [](const SampleMask& a, const SampleMask& b) { CHECK(a == b); });
  ExecutionContext context;
  context.cancel();
  const SampleMask none = visible_samples(camera.all(), torus.painted_on(), &context);
  CHECK(std::ranges::count(none, std::uint8_t{1}) == 0);
}

TEST_CASE("an outline with `visible` paints what is in it and in front") {
  const Subject sheets(test::parallel_sheets(60, 0.03, 0.2, test::Sampling::kRegular));
  ScreenShape shape = Camera{.eye = {0.0, 0.0, 3.0}}.all();
  shape.outline = ScreenEllipse{.center = {0.1, 0.0}, .half_axes = {0.2, 0.3}};
  Marks marks(sheets.surface.size(), 0);
  const PaintOperation operation{.shape = shape};
  CHECK(depends_on_sampling(operation));
  const std::size_t painted = paint(operation, RegionKind::kZero, sheets.painted_on(), marks);
  CHECK(painted > 50);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const Vec3d place = sheets.place(i);
    REQUIRE((marks[i] != 0) == (place.z() > 0.0 && contains(shape, kOrigin + place)));
  }
}

}  // namespace
}  // namespace pointwright
