// The two elementary deformations of Figure 5 against their closed forms: a disc of a plane is lifted, and
// turned about its axis, inside a ring that stays. And that t is C1 across the regions' borders.
#include <doctest/doctest.h>

#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

constexpr double kInner = 0.3;  // the one-region is the disc within this radius
constexpr double kOuter = 0.8;  // the zero-region begins here
constexpr std::array kBlends = {Blend::kQuartic, Blend::kCubic, Blend::kQuintic, Blend::kCosine};

// Around the z axis, t depends on the distance r to it alone.
double closed_t(double r) {
  const double x = std::clamp((r - kInner) / (kOuter - kInner), 0.0, 1.0);
  return (x * x - 1.0) * (x * x - 1.0);
}
double closed_slope(double r) {
  if (r <= kInner || r >= kOuter) return 0.0;
  const double x = (r - kInner) / (kOuter - kInner);
  return 4.0 * x * (x * x - 1.0) / (kOuter - kInner);
}

// The disc as one ball, the ring's border as points so close that their distance is that of the circle.
RegionPair disc_and_circle() {
  constexpr std::size_t kPoints = 40'000;
  Points circle(kPoints);
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / double{kPoints};
    circle.set(i, Vec3d(kOuter * std::cos(angle), kOuter * std::sin(angle), 0.0).cast<float>());
  }
  return {.zero = Region(circle, std::vector<float>(kPoints, 0.0F), BallOrder::kCoherent),
          .one = Region(test::points_of({Vec3f::Zero()}), {static_cast<float>(kInner)})};
}

// Samples of the plane inside the circle.
Level plate(std::size_t side) {
  const double spacing = 2.0 / static_cast<double>(side - 1);
  const test::Surface plane = test::plane(side, spacing, test::Sampling::kJittered);
  std::vector<Vec3f> kept;
  for (std::size_t i = 0; i < plane.size(); ++i)
    if (plane.position[i].cast<double>().norm() < kOuter) kept.push_back(plane.position[i]);
  Level level{.position = test::points_of(kept), .normal = Points(kept.size())};
  for (std::size_t i = 0; i < kept.size(); ++i) level.normal.set(i, Vec3f::UnitZ());
  return level;
}

struct Expected {
  Vec3d position;
  Vec3d normal;
};
struct Errors {
  double position = 0.0;
  double normal = 0.0;
};
Errors errors_of(const Level& rest, const RegionPair& regions, const Deformation& deformation,
                 const std::function<Expected(const Vec3d&)>& closed_form) {
  const ScaleField field = compute_scale_field(rest.position, regions, Blend::kQuartic);
  const MultiresSurface after =
      test::edited({.levels = {rest}, .detail = {}}, {.deformation = deformation}, field, Vec3d::Zero());
  Errors worst;
  for (std::size_t i = 0; i < rest.position.size(); ++i) {
    const Expected expected = closed_form(rest.position[i].cast<double>());
    const Level& level = after.finest();
    worst.position = std::max(worst.position, (level.position[i].cast<double>() - expected.position).norm());
    worst.normal = std::max(worst.normal, (level.normal[i].cast<double>() - expected.normal).norm());
  }
  return worst;
}

const Translation kLift{.vector = Vec3d(0.0, 0.0, 0.6)};
Expected lifted(const Vec3d& p) {
  const double r = p.norm();
  const Vec3d outward = r > 0.0 ? Vec3d(p / r) : Vec3d::Zero();
  const double slope = 0.6 * closed_slope(r);
  return {p + 0.6 * closed_t(r) * Vec3d::UnitZ(), (Vec3d::UnitZ() - slope * outward).normalized()};
}

// About the x axis: the disc turns over whole, what is around it follows by t.
constexpr double kTurn = 2.0 * std::numbers::pi / 3.0;
const Rotation kTip{.point = Vec3d::Zero(), .axis = Vec3d::UnitX(), .angle_rad = kTurn};
Expected tipped(const Vec3d& p) {
  const double r = p.norm();
  const auto turned = [&](const Vec3d& q) -> Vec3d {
    const double angle = kTurn * closed_t(q.norm());
    return {q.x(), q.y() * std::cos(angle), q.y() * std::sin(angle)};
  };
  const double angle = kTurn * closed_t(r);
  // d/dx and d/dy of (x, y cos(angle(r)), y sin(angle(r))).
  const double swing = r > 0.0 ? kTurn * closed_slope(r) * p.y() / r : 0.0;
  const Vec3d along(0.0, -std::sin(angle), std::cos(angle));
  const Vec3d u = Vec3d::UnitX() + swing * p.x() * along;
  const Vec3d v = Vec3d(0.0, std::cos(angle), std::sin(angle)) + swing * p.y() * along;
  return {turned(p), u.cross(v).normalized()};
}

TEST_CASE("a lifted disc and a tipped disc stand where their closed forms say, normals included") {
  const Level rest = plate(160);
  const RegionPair regions = disc_and_circle();
  const Errors lift = errors_of(rest, regions, kLift, lifted);
  const Errors tip = errors_of(rest, regions, kTip, tipped);
  MESSAGE("lifted: " << lift.position << ", normals " << lift.normal << "; tipped: " << tip.position
                     << ", normals " << tip.normal);
  // Halfway between two of the circle's points, s apart, their distance d is too long by s^2 / (8 d), and its
  // gradient is off by s / (2 d): times |grad t| <= 8 d / gap^2 and |dF/dt|.
  const double s = 2.0 * std::numbers::pi * kOuter / 40'000.0;
  const double tilt = 8.0 / ((kOuter - kInner) * (kOuter - kInner)) * s / 2.0;
  CHECK(lift.position < 1e-6);
  CHECK(tip.position < 1e-6);
  CHECK(lift.normal < 1.05 * 0.6 * tilt);
  CHECK(tip.normal < 1.05 * kTurn * kOuter * tilt);
}

TEST_CASE("painted on samples, the same deformations approach their closed forms as the spacing") {
  // The balls end within a spacing of the painted border, and d_0 + d_1 is at least the gap less two
  // spacings: |dt| <= max |beta'| * 2 h / (gap - 2 h), with max |beta'| = 1.54.
  double before = 0.0;
  for (const std::size_t side : {100, 200, 400}) {
    const double h = 2.0 / static_cast<double>(side - 1);
    const test::Surface plane = test::plane(side, h, test::Sampling::kJittered);
    Marks marks(plane.size(), 0);
    const PaintSurface surface{.position = plane.position, .normal = plane.normal, .origin = Vec3d::Zero()};
    const Vec3d center = Vec3d::Zero();
    paint({.shape = Sphere{.center = center, .radius = kInner}}, RegionKind::kOne, surface, marks);
    paint({.shape = Sphere{.center = center, .radius = kOuter}}, RegionKind::kZero, surface, marks);
    paint({.mode = PaintMode::kInvert}, RegionKind::kZero, surface, marks);
    const RegionPair regions =
        regions_from_marks(plane.position, std::vector<float>(plane.size(), static_cast<float>(h)), marks,
                           center)
            .value();
    const Level rest{.position = plane.position, .normal = plane.normal};
    const double bound = 1.54 * 2.0 * h / (kOuter - kInner - 2.0 * h);
    const double lift = errors_of(rest, regions, kLift, lifted).position / 0.6;
    const double tip = errors_of(rest, regions, kTip, tipped).position / (kTurn * kOuter);
    MESSAGE("spacing " << h << ": lifted " << lift << ", tipped " << tip << ", bound " << bound);
    CHECK(lift < bound);
    CHECK(tip < bound);
    if (before > 0.0) CHECK(lift < 0.6 * before);
    before = lift;
  }
}

TEST_CASE("t is C1: its gradient falls to nothing toward both borders and never jumps") {
  const RegionPair regions = disc_and_circle();
  constexpr std::size_t kSteps = 40'000;
  Points walk(kSteps);  // from inside the one-region to the circle
  const auto radius_at = [](std::size_t i) {
    return 0.2 + (kOuter - 0.2) * static_cast<double>(i) / double{kSteps - 1};
  };
  for (std::size_t i = 0; i < kSteps; ++i)
    walk.set(i, Vec3d(radius_at(i), 0.0, 0.0).cast<float>());  // through a point of the circle
  const double gap = kOuter - kInner;
  const double step = radius_at(1) - radius_at(0);
  for (const Blend blend : kBlends) {
    CAPTURE(static_cast<int>(blend));
    const ScaleField field = compute_scale_field(walk, regions, blend);
    // |beta''| <= 8 for every blend: the gradient's Lipschitz constant is 8 / gap^2.
    const double steepest_change = 8.0 / (gap * gap);
    double jump = 0.0;
    double excess = 0.0;
    for (std::size_t i = 1; i < kSteps; ++i) {
      const double change = static_cast<double>((field.gradient[i] - field.gradient[i - 1]).norm());
      jump = std::max(jump, change);
      const double border = std::min(std::abs(radius_at(i) - kInner), kOuter - radius_at(i));
      const double slope = static_cast<double>(field.gradient[i].norm());
      if (radius_at(i) > kInner) excess = std::max(excess, slope - steepest_change * border);
    }
    CHECK(jump < 2.0 * steepest_change * step + 1e-4);
    CHECK(excess < 1e-4);
    CHECK(field.gradient[0] == Vec3f::Zero());
    CHECK(field.t[0] == 1.0F);
    CHECK(field.t[kSteps - 1] < 1e-6F);
  }
}

TEST_CASE("samples beside the borders move as their neighbours inside the regions do") {
  // F is C1 too: across a border the deformed surface has no crease.
  const RegionPair regions = disc_and_circle();
  for (const double border : {kInner, kOuter}) {
    const auto sample = [](double r) { return Vec3f(static_cast<float>(r), 0.0F, 0.0F); };
    Level rest{.position = test::points_of({sample(border - 1e-3), sample(border + 1e-3)}),
               .normal = test::points_of({Vec3f::UnitZ(), Vec3f::UnitZ()})};
    if (border == kOuter) rest.position.set(1, sample(border));
    const Errors lift = errors_of(rest, regions, kLift, lifted);
    const Errors flat = errors_of(rest, regions, kLift, [&](const Vec3d& p) -> Expected {
      return {p + (border == kInner ? 0.6 : 0.0) * Vec3d::UnitZ(), Vec3d::UnitZ()};
    });
    CHECK(lift.position < 1e-6);
    CHECK(flat.position < 0.6 * 4.0 * 1e-6 / ((kOuter - kInner) * (kOuter - kInner)) * 1.01 + 1e-6);
    CHECK(flat.normal < 0.6 * 8.0 * 1e-3 / ((kOuter - kInner) * (kOuter - kInner)) * 1.01 + 1e-5);
  }
}

}  // namespace
}  // namespace pointwright
