#include "engine/editing/deformation.h"

#include <doctest/doctest.h>

#include <limits>

#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

constexpr double kPi = std::numbers::pi;

struct Deformed {
  Points position;
  Points normal;
};

Deformed deformed(const Deformation& deformation, const Vec3d& origin, const ScaleField& field,
                  const Level& level) {
  Deformed result;
  deform(deformation, origin, field, level.position, level.normal, result.position, result.normal);
  return result;
}

// Random positions, unit normals, t and gradients.
struct Samples {
  Level level;
  ScaleField field;
};
Samples random_samples(std::size_t n, unsigned seed, float largest_gradient) {
  Samples samples{
      .level = {.position = test::random_points(n, seed), .normal = test::random_points(n, seed + 1)},
      .field = test::constant_field(n, 0.0F)};
  std::mt19937 random(seed + 2);
  std::uniform_real_distribution<float> t(0.0F, 1.0F);
  samples.field.gradient = test::random_points(n, seed + 3, largest_gradient);
  for (std::size_t i = 0; i < n; ++i) {
    samples.level.normal.set(i, samples.level.normal[i].normalized());
    samples.field.t[i] = t(random);
  }
  return samples;
}

void check_refused(const Deformation& deformation, ErrorCode code, const char* field) {
  const Result<void> result = validate(deformation);
  REQUIRE(!result.ok());
  CHECK(result.error().code == code);
  CHECK(result.error().field == field);
}

TEST_CASE("a translation moves by t v") {
  const Samples samples = random_samples(100, 1, 0.0F);
  const Translation translation{.vector = Vec3d(1.0, -2.0, 0.5)};
  const Deformed result = deformed(translation, Vec3d(7.0, 8.0, 9.0), samples.field, samples.level);
  for (std::size_t i = 0; i < 100; ++i) {
    const Vec3f expected = samples.level.position[i] + samples.field.t[i] * translation.vector.cast<float>();
    CHECK((result.position[i] - expected).norm() < 1e-6F);
    CHECK((result.normal[i] - samples.level.normal[i]).norm() == 0.0F);  // without a gradient nothing bends
  }
}

TEST_CASE("a quarter turn about z maps x to y, wherever the axis and the cloud's origin are") {
  const Level level{.position = test::points_of({{1, 0, 0}}), .normal = test::points_of({{1, 0, 0}})};
  const Vec3d origin(1000.0, 2000.0, 3000.0);
  const Rotation turn{
      .point = origin + Vec3d(0.0, 0.0, 77.0), .axis = Vec3d(0.0, 0.0, 5.0), .angle_rad = kPi / 2.0};
  const Deformed result = deformed(turn, origin, test::constant_field(1, 1.0F), level);
  CHECK((result.position[0] - Vec3f(0, 1, 0)).norm() < 1e-6F);
  CHECK((result.normal[0] - Vec3f(0, 1, 0)).norm() < 1e-6F);
}

TEST_CASE("rotations agree with double precision for any angle, axis and t") {
  std::mt19937 random(77);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const double diagonal = 2.0 * std::sqrt(3.0);
  double worst = 0.0;
  for (int round = 0; round < 200; ++round) {
    const Samples samples = random_samples(64, static_cast<unsigned>(1000 + 10 * round), 0.0F);
    const double turns = round < 20 ? round / 2.0 : 100.0 * uniform(random);
    const Vec3d axis(uniform(random), uniform(random), uniform(random));
    const Rotation rotation{.point = Vec3d(uniform(random), uniform(random), uniform(random)) + 50.0 * axis,
                            .axis = axis,
                            .angle_rad = turns * 2.0 * kPi};
    for (const bool everything : {true, false}) {
      const ScaleField field = everything ? test::constant_field(64, 1.0F) : samples.field;
      const Deformed result = deformed(rotation, Vec3d::Zero(), field, samples.level);
      for (std::size_t i = 0; i < 64; ++i) {
        const Vec3d expected =
            deform_point(rotation, samples.level.position[i].cast<double>(), double{field.t[i]});
        worst = std::max(worst, (result.position[i].cast<double>() - expected).norm() / diagonal);
      }
    }
  }
  CHECK(worst < 1e-6);
}

TEST_CASE("one and two full turns wind: t = 1 comes home to the bit, t = 1/2 and 1/4 stand across") {
  const Level level{.position = test::points_of({{1, 0, 0}, {1, 0, 0}, {1, 0, 0}}),
                    .normal = test::points_of({{0, 0, 1}, {1, 0, 0}, {0, 1, 0}})};
  ScaleField field = test::constant_field(3, 1.0F);
  field.t[1] = 0.5F;
  field.t[2] = 0.25F;
  const Deformed once = deformed(Rotation{.angle_rad = 2.0 * kPi}, Vec3d::Zero(), field, level);
  CHECK(test::same_sample(once.position, level.position, 0));
  CHECK(test::same_sample(once.normal, level.normal, 0));
  CHECK((once.position[1] - Vec3f(-1, 0, 0)).norm() < 1e-6F);
  CHECK((once.position[2] - Vec3f(0, 1, 0)).norm() < 1e-6F);
  const Deformed twice = deformed(Rotation{.angle_rad = -4.0 * kPi}, Vec3d::Zero(), field, level);
  CHECK(test::same_sample(twice.position, level.position, 0));
  CHECK((twice.position[1] - Vec3f(1, 0, 0)).norm() < 1e-6F);
  CHECK((twice.position[2] - Vec3f(-1, 0, 0)).norm() < 1e-6F);
}

TEST_CASE("the Jacobian is that of finite differences of p -> F(p, t(p))") {
  const Vec3d gradient(0.7, -0.4, 1.1);
  const Vec3d p(0.3, -0.8, 0.5);
  const auto t_at = [&](const Vec3d& q) { return 0.4 + gradient.dot(q - p); };
  const std::vector<Deformation> deformations = {
      Translation{.vector = Vec3d(0.5, 2.0, -1.0)},
      Rotation{.point = Vec3d(0.1, 0.2, 0.3), .axis = Vec3d(1.0, 2.0, -3.0), .angle_rad = 7.5}};
  for (const Deformation& deformation : deformations) {
    Mat3d numeric;
    for (int c = 0; c < 3; ++c) {
      const Vec3d step = 1e-6 * Vec3d::Unit(c);
      numeric.col(c) = (deform_point(deformation, p + step, t_at(p + step)) -
                        deform_point(deformation, p - step, t_at(p - step))) /
                       2e-6;
    }
    CHECK((numeric - deformation_jacobian(deformation, p, 0.4, gradient)).norm() < 1e-8);
  }
}

TEST_CASE("normals are the cofactor of the double-precision Jacobian times the normal") {
  const std::vector<Deformation> deformations = {
      Translation{.vector = Vec3d(0.5, 1.0, -0.3)}, Translation{.vector = Vec3d(0.0, 0.0, 4.0)},
      Rotation{.point = Vec3d(0.1, 0.2, 0.3), .axis = Vec3d(1.0, 2.0, -3.0), .angle_rad = 1.5},
      Rotation{.axis = Vec3d(0.0, 1.0, 0.2), .angle_rad = -12.0},
      Rotation{.axis = Vec3d(1.0, 1.0, 1.0), .angle_rad = 600.0}};
  for (const Deformation& deformation : deformations) {
    const Samples samples = random_samples(2000, 91, 2.0F);
    const Deformed result = deformed(deformation, Vec3d::Zero(), samples.field, samples.level);
    double worst = 0.0;
    for (std::size_t i = 0; i < 2000; ++i) {
      const Vec3d gradient = samples.field.gradient[i].cast<double>();
      const Mat3d J = deformation_jacobian(deformation, samples.level.position[i].cast<double>(),
                                           double{samples.field.t[i]}, gradient);
      Mat3d cofactor;
      for (int c = 0; c < 3; ++c) cofactor.col(c) = J.col((c + 1) % 3).cross(J.col((c + 2) % 3));
      const Vec3d expected = cofactor * samples.level.normal[i].cast<double>();
      // How much of it survives cancellation decides how well float can know its direction.
      const double conditioning = expected.norm() / (1.0 + cofactor.norm());
      worst =
          std::max(worst, (expected.normalized() - result.normal[i].cast<double>()).norm() * conditioning);
      CHECK(result.normal[i].norm() == doctest::Approx(1.0).epsilon(1e-6));
    }
    CHECK(worst < 2e-6);
  }
}

TEST_CASE("where the map folds the surface the normal turns with dF/dp") {
  // v along g with u . g = -1 and the normal across: cofactor(J) n vanishes.
  const Level level{.position = test::points_of({{0, 0, 0}}), .normal = test::points_of({{0, 0, 1}})};
  ScaleField field = test::constant_field(1, 0.5F);
  field.gradient.set(0, {1, 0, 0});
  const Deformed result = deformed(Translation{.vector = Vec3d(-1.0, 0.0, 0.0)}, Vec3d::Zero(), field, level);
  CHECK(result.normal[0] == Vec3f(0, 0, 1));
}

TEST_CASE("samples with t = 0 and zero deformations keep every bit, signed zeros included") {
  Samples samples = random_samples(500, 101, 3.0F);
  samples.level.position.set(0, {-0.0F, 0.0F, -0.0F});
  for (std::size_t i = 0; i < 500; i += 3) samples.field.t[i] = 0.0F;
  for (const Deformation& deformation :
       {Deformation(Translation{.vector = Vec3d(1.0, 2.0, 3.0)}), Deformation(Rotation{.angle_rad = 3.0})}) {
    const Deformed result = deformed(deformation, Vec3d(1.0, 2.0, 3.0), samples.field, samples.level);
    for (std::size_t i = 0; i < 500; i += 3) {
      CHECK(test::same_sample(result.position, samples.level.position, i));
      CHECK(test::same_sample(result.normal, samples.level.normal, i));
    }
    CHECK_FALSE(test::same_sample(result.position, samples.level.position, 1));
  }
  samples.level.position.set(1, {-0.0F, -0.0F, -0.0F});
  for (const Deformation& nothing :
       {Deformation(Translation{}), Deformation(Rotation{.point = Vec3d(1.0, 2.0, 3.0), .angle_rad = 0.0})}) {
    const Deformed result = deformed(nothing, Vec3d(1.0, 2.0, 3.0), samples.field, samples.level);
    CHECK(test::same_bytes(result.position, samples.level.position));
    CHECK(test::same_bytes(result.normal, samples.level.normal));
  }
}

TEST_CASE("extreme but valid input never gives NaN") {
  Samples samples = random_samples(256, 111, 1e12F);
  samples.level.normal.set(3, Vec3f::Zero());  // a sample whose normal could not be estimated
  samples.field.gradient.set(4, {1e29F, -1e29F, 1e29F});
  samples.level.position.set(5, {1e9F, -1e9F, 1e9F});
  for (const Deformation& deformation :
       {Deformation(Translation{.vector = Vec3d(1e9, 0.0, 0.0)}),
        Deformation(
            Rotation{.point = Vec3d(0.0, 1e9, 0.0), .axis = Vec3d(1e-90, 0.0, 0.0), .angle_rad = 628.0}),
        Deformation(Rotation{.axis = Vec3d(1e300, 1e300, 0.0), .angle_rad = -628.0})}) {
    REQUIRE(validate(deformation).ok());
    const Deformed result = deformed(deformation, Vec3d::Zero(), samples.field, samples.level);
    CHECK(test::all_finite(result.position));
    CHECK(test::all_finite(result.normal));
  }
}

TEST_CASE("deformations outside their limits are refused by name") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  check_refused(Translation{.vector = Vec3d(nan, 0.0, 0.0)}, ErrorCode::kNonFinite, "deformation.vector");
  check_refused(Translation{.vector = Vec3d(1e9, 1e9, 0.0)}, ErrorCode::kInvalidArgument,
                "deformation.vector");
  check_refused(Translation{.vector = Vec3d(1e300, 0.0, 0.0)}, ErrorCode::kInvalidArgument,
                "deformation.vector");
  check_refused(Rotation{.axis = Vec3d::Zero()}, ErrorCode::kInvalidArgument, "deformation.axis");
  check_refused(Rotation{.axis = Vec3d(0.0, nan, 0.0)}, ErrorCode::kNonFinite, "deformation.axis");
  check_refused(Rotation{.point = Vec3d(2e9, 0.0, 0.0)}, ErrorCode::kInvalidArgument, "deformation.point");
  check_refused(Rotation{.angle_rad = nan}, ErrorCode::kNonFinite, "deformation.angle_rad");
  check_refused(Rotation{.angle_rad = 629.0}, ErrorCode::kInvalidArgument, "deformation.angle_rad");
  CHECK(validate(Rotation{.angle_rad = -200.0 * kPi}).ok());  // 100 turns
}

TEST_CASE("the same bytes for any thread count, instruction set and number of samples") {
  const Samples samples = random_samples(9001, 121, 1.0F);
  const Rotation rotation{.point = Vec3d(0.1, 0.0, 0.0), .axis = Vec3d(1.0, 2.0, 3.0), .angle_rad = 5.0};
  test::for_all_machines([&] { return deformed(rotation, Vec3d::Zero(), samples.field, samples.level); },
                         [](const Deformed& a, const Deformed& b) {
                           CHECK(test::same_bytes(a.position, b.position));
                           CHECK(test::same_bytes(a.normal, b.normal));
                         });
  const Deformed all = deformed(rotation, Vec3d::Zero(), samples.field, samples.level);
  for (const std::size_t n : {0, 1, 15, 16, 17}) {
    Samples some = samples;
    some.level.position.resize(n);
    some.level.normal.resize(n);
    some.field.t.resize(padded_to_block(n));
    some.field.gradient.resize(n);
    const Deformed result = deformed(rotation, Vec3d::Zero(), some.field, some.level);
    REQUIRE(result.position.size() == n);
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(test::same_sample(result.position, all.position, i));
      CHECK(test::same_sample(result.normal, all.normal, i));
    }
  }
}

}  // namespace
}  // namespace pointwright
