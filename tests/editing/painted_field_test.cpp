#include "engine/editing/painted_field.h"

#include <doctest/doctest.h>

#include <array>
#include <cstring>
#include <random>

#include "engine/spatial/coherent_order.h"
#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

constexpr auto kZero = static_cast<std::uint8_t>(RegionKind::kZero);
constexpr auto kOne = static_cast<std::uint8_t>(RegionKind::kOne);

// A sphere in coherent order, some of its samples twice.
Points coherent_sphere(std::size_t n) {
  const Points sphere = test::sphere_level(n, 1.0F).position;
  const auto order = coherent_order(sphere);
  Points position(n);
  for (std::size_t i = 0; i < n; ++i) position.set(i, sphere[order[i]]);
  for (std::size_t i = 100; i < n; i += 1000) position.set(i, position[i - 1]);
  return position;
}

Marks poles(const Points& position) {
  Marks marks(position.size(), 0);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const float z = position[i].z();
    marks[i] = z > 0.8F ? kOne : z < -0.8F ? kZero : std::uint8_t{0};
  }
  return marks;
}

bool same_bits(const ScaleField& a, const ScaleField& b) {
  if (a.t.size() != b.t.size()) return false;
  const std::size_t bytes = a.t.size() * sizeof(float);
  return std::memcmp(a.t.data(), b.t.data(), bytes) == 0 &&
         std::memcmp(a.gradient.x(), b.gradient.x(), bytes) == 0 &&
         std::memcmp(a.gradient.y(), b.gradient.y(), bytes) == 0 &&
         std::memcmp(a.gradient.z(), b.gradient.z(), bytes) == 0;
}

ScaleField from_scratch(const Points& position, const std::vector<float>& spacing, const Marks& marks,
                        Blend blend) {
  return compute_scale_field(position, regions_from_marks(position, spacing, marks, Vec3d::Zero()).value(),
                             blend);
}

// Paints or erases a disc with one of the regions, which takes what the other had.
void dab(const Points& position, std::mt19937& random, Marks& marks) {
  std::uniform_real_distribution<float> coordinate(-1.0F, 1.0F);
  const Vec3f centre = Vec3f(coordinate(random), coordinate(random), coordinate(random)).normalized();
  const float radius = 0.02F + 0.2F * std::abs(coordinate(random));
  const std::array<std::uint8_t, 3> kinds{kZero, kOne, std::uint8_t{0}};
  const std::uint8_t kind = kinds[random() % 3];
  for (std::size_t i = 0; i < marks.size(); ++i)
    if ((position[i] - centre).norm() < radius) marks[i] = kind;
}

TEST_CASE("a field repainted over and over has the bits of one from scratch") {
  const std::size_t n = 12'345;  // the last window is not full
  const Points position = coherent_sphere(n);
  const std::vector<float> spacing(n, 0.03F);
  for (const Blend blend : {Blend::kQuartic, Blend::kCosine}) {
    Marks marks = poles(position);
    PaintedField painted = PaintedField::make(position, spacing, marks, Vec3d::Zero(), blend).value();
    REQUIRE(painted.computed_samples() == n);
    REQUIRE(same_bits(*painted.field(), from_scratch(position, spacing, marks, blend)));
    std::mt19937 random(11);
    std::size_t kept = 0;
    std::size_t refused = 0;
    for (int step = 0; step < 60; ++step) {
      CAPTURE(step);
      Marks next = marks;
      dab(position, random, next);
      const auto repainted = painted.repainted(position, spacing, next, Vec3d::Zero());
      const auto regions = regions_from_marks(position, spacing, next, Vec3d::Zero());
      REQUIRE(repainted.ok() == regions.ok());
      if (!repainted.ok()) {  // twins in different regions: the stroke is not taken
        CHECK(repainted.error().message == regions.error().message);
        ++refused;
        continue;
      }
      REQUIRE(same_bits(*repainted.value().field(), compute_scale_field(position, regions.value(), blend)));
      kept += n - repainted.value().computed_samples();
      painted = repainted.value();
      marks = next;
    }
    CHECK(refused < 30);
    CHECK(kept > 10 * n);
  }
}

TEST_CASE("repainting with the same marks computes nothing, and a hole in a region little") {
  const std::size_t n = 20'000;
  const Points position = coherent_sphere(n);
  const std::vector<float> spacing(n, 0.02F);
  const Marks marks = poles(position);
  const PaintedField painted =
      PaintedField::make(position, spacing, marks, Vec3d::Zero(), Blend::kQuartic).value();
  const PaintedField again = painted.repainted(position, spacing, marks, Vec3d::Zero()).value();
  CHECK(again.computed_samples() == 0);
  CHECK(same_bits(*again.field(), *painted.field()));
  // What stood on the hole moves; the windows are wide against this sphere, so others are looked at as well.
  Marks hole = marks;
  for (std::size_t i = 0; i < n; ++i)
    if (position[i].z() > 0.999F) hole[i] = 0;
  const PaintedField open = painted.repainted(position, spacing, hole, Vec3d::Zero()).value();
  CHECK(open.computed_samples() > 0);
  CHECK(open.computed_samples() < n * 3 / 5);
  CHECK(same_bits(*open.field(), from_scratch(position, spacing, hole, Blend::kQuartic)));
}

TEST_CASE("a repainted field is the same for any thread count and instruction set") {
  const std::size_t n = 5'000;
  const Points position = coherent_sphere(n);
  const std::vector<float> spacing(n, 0.05F);
  const Marks marks = poles(position);
  Marks next = marks;
  for (std::size_t i = 0; i < n; ++i)
    if ((position[i] - Vec3f(0.7F, 0.0F, 0.7F)).norm() < 0.2F) next[i] = kOne;
  const auto compute = [&] {
    return *PaintedField::make(position, spacing, marks, Vec3d::Zero(), Blend::kQuartic)
                .value()
                .repainted(position, spacing, next, Vec3d::Zero())
                .value()
                .field();
  };
  test::for_all_machines(compute, [](const ScaleField& a, const ScaleField& b) { CHECK(same_bits(a, b)); });
}

TEST_CASE("repainting refuses what painting from scratch refuses") {
  const Points position = coherent_sphere(2'000);
  const std::vector<float> spacing(position.size(), 0.05F);
  const Marks marks = poles(position);
  const PaintedField painted =
      PaintedField::make(position, spacing, marks, Vec3d::Zero(), Blend::kQuartic).value();
  const Marks none(position.size(), 0);
  CHECK(painted.repainted(position, spacing, none, Vec3d::Zero()).error().code == ErrorCode::kEmptyRegion);
  CHECK(PaintedField::make(position, spacing, none, Vec3d::Zero(), Blend::kQuartic).error().code ==
        ErrorCode::kEmptyRegion);
}

}  // namespace
}  // namespace pointwright
