#include "engine/editing/deformation.h"

#include <doctest/doctest.h>

#include <limits>

#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

constexpr double kPi = std::numbers::pi;

Level deformed(const Deformation& deformation, const Vec3d& origin, const ScaleField& field,
               const Level& level, const ShapeOperators* shape = nullptr) {
  Level result;
  deform(deformation, origin, field, level, result, shape);
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

// Every elementary deformation, and compositions of several.
std::vector<Deformation> all_kinds() {
  const Rotation turn{.point = Vec3d(0.1, 0.2, 0.3), .axis = Vec3d(1.0, 2.0, -3.0), .angle_rad = 1.5};
  const Scaling scale{.center = Vec3d(0.2, -0.1, 0.4), .factors = Vec3d(0.5, 2.0, 1.25)};
  const Twist twist{
      .point = Vec3d(0.1, 0.0, -0.2), .axis = Vec3d(0.3, 1.0, 0.2), .angle_rad = 2.0, .length = 0.7};
  const TowardPoint toward{.target = Vec3d(0.3, 0.4, -0.5), .amount = 0.6};
  const Translation shift{.vector = Vec3d(0.5, 1.0, -0.3)};
  return {shift,
          toward,
          TowardPoint{.target = Vec3d(0.3, 0.4, -0.5), .amount = -1.5},
          turn,
          scale,
          twist,
          NormalOffset{.distance = 0.2},
          Deformation({shift, turn}),
          Deformation({turn, scale, twist, toward, shift}),
          Deformation({NormalOffset{.distance = -0.15}, twist, turn})};
}

// Shape operators with the given columns everywhere.
ShapeOperators constant_shape(std::size_t n, float uu, float uv, float vv) {
  const std::size_t padded = padded_to_block(n);
  return {.uu = std::vector<float>(padded, uu),
          .uv = std::vector<float>(padded, uv),
          .vv = std::vector<float>(padded, vv)};
}

// The same shape operator at one sample, in model space.
LocalSurface local_surface(const Vec3f& normal, const ShapeOperators& shape, std::size_t i) {
  const Vec3d n = normal.cast<double>().normalized();
  const TangentFrame frame = tangent_frame(n);
  const Mat3d S = double{shape.uu[i]} * frame.u * frame.u.transpose() +
                  double{shape.uv[i]} * (frame.u * frame.v.transpose() + frame.v * frame.u.transpose()) +
                  double{shape.vv[i]} * frame.v * frame.v.transpose();
  return {.normal = n, .shape_operator = S};
}

// Scalings away from far off, then twists: what overflows in a Jacobian must not reach the normals.
std::vector<ElementaryDeformation> far_and_twisted(std::size_t scalings, std::size_t twists) {
  std::vector<ElementaryDeformation> steps(
      scalings, Scaling{.center = Vec3d(1e9, 0.0, 0.0), .factors = Vec3d(1e3, 1e3, 1e3)});
  steps.insert(steps.end(), twists, Twist{.angle_rad = 628.0, .length = 1e-9});
  return steps;
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
  const Level result = deformed(translation, Vec3d(7.0, 8.0, 9.0), samples.field, samples.level);
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
  const Level result = deformed(turn, origin, test::constant_field(1, 1.0F), level);
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
      const Level result = deformed(rotation, Vec3d::Zero(), field, samples.level);
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
  const Level once = deformed(Rotation{.angle_rad = 2.0 * kPi}, Vec3d::Zero(), field, level);
  CHECK(test::same_sample(once.position, level.position, 0));
  CHECK(test::same_sample(once.normal, level.normal, 0));
  CHECK((once.position[1] - Vec3f(-1, 0, 0)).norm() < 1e-6F);
  CHECK((once.position[2] - Vec3f(0, 1, 0)).norm() < 1e-6F);
  const Level twice = deformed(Rotation{.angle_rad = -4.0 * kPi}, Vec3d::Zero(), field, level);
  CHECK(test::same_sample(twice.position, level.position, 0));
  CHECK((twice.position[1] - Vec3f(1, 0, 0)).norm() < 1e-6F);
  CHECK((twice.position[2] - Vec3f(-1, 0, 0)).norm() < 1e-6F);
}

TEST_CASE("positions of every kind and composition agree with double precision") {
  for (const Deformation& deformation : all_kinds()) {
    const Samples samples = random_samples(512, 301, 1.0F);
    const ShapeOperators shape = constant_shape(512, 0.4F, -0.3F, 0.7F);
    const Vec3d origin(20.0, -30.0, 10.0);
    Deformation there = deformation;  // the same in model space, around the cloud's origin
    for (ElementaryDeformation& one : there.steps) {
      if (auto* rotation = std::get_if<Rotation>(&one)) rotation->point += origin;
      if (auto* scaling = std::get_if<Scaling>(&one)) scaling->center += origin;
      if (auto* twist = std::get_if<Twist>(&one)) twist->point += origin;
      if (auto* toward = std::get_if<TowardPoint>(&one)) toward->target += origin;
    }
    const Level result = deformed(there, origin, samples.field, samples.level, &shape);
    double worst = 0.0;
    for (std::size_t i = 0; i < 512; ++i) {
      const LocalSurface surface = local_surface(samples.level.normal[i], shape, i);
      const Vec3d expected = deform_point(deformation, samples.level.position[i].cast<double>(),
                                          double{samples.field.t[i]}, surface);
      worst = std::max(worst, (result.position[i].cast<double>() - expected).norm());
    }
    CHECK(worst < 4e-6);  // of places within 5 of the origin
  }
}

TEST_CASE("the Jacobian is that of finite differences of p -> F(p, t(p))") {
  // Along the normal of a quadric: its normal and shape operator are known at every point of space.
  const Mat3d H = Vec3d(0.8, -0.5, 0.3).asDiagonal();
  const auto surface_at = [&](const Vec3d& q) -> LocalSurface {
    const Vec3d g = H * q + Vec3d(0.1, 0.2, 1.0);
    const Vec3d n = g.normalized();
    return {.normal = n, .shape_operator = (Mat3d::Identity() - n * n.transpose()) * H / g.norm()};
  };
  const Vec3d gradient(0.7, -0.4, 1.1);
  const Vec3d p(0.3, -0.8, 0.5);
  const auto t_at = [&](const Vec3d& q) { return 0.4 + gradient.dot(q - p); };
  for (const Deformation& deformation : all_kinds()) {
    Mat3d numeric;
    for (int c = 0; c < 3; ++c) {
      const Vec3d step = 1e-6 * Vec3d::Unit(c);
      const auto f = [&](const Vec3d& q) { return deform_point(deformation, q, t_at(q), surface_at(q)); };
      numeric.col(c) = (f(p + step) - f(p - step)) / 2e-6;
    }
    CHECK((numeric - deformation_jacobian(deformation, p, 0.4, gradient, surface_at(p))).norm() < 1e-8);
  }
}

TEST_CASE("normals are the cofactor of the double-precision Jacobian times the normal") {
  std::vector<Deformation> deformations = all_kinds();
  deformations.push_back(Translation{.vector = Vec3d(0.0, 0.0, 4.0)});
  deformations.push_back(Rotation{.axis = Vec3d(0.0, 1.0, 0.2), .angle_rad = -12.0});
  deformations.push_back(Rotation{.axis = Vec3d(1.0, 1.0, 1.0), .angle_rad = 600.0});
  const ShapeOperators shape = constant_shape(2000, 0.4F, -0.3F, 0.7F);
  for (const Deformation& deformation : deformations) {
    const Samples samples = random_samples(2000, 91, 2.0F);
    const Level result = deformed(deformation, Vec3d::Zero(), samples.field, samples.level, &shape);
    double worst = 0.0;
    for (std::size_t i = 0; i < 2000; ++i) {
      const Vec3d gradient = samples.field.gradient[i].cast<double>();
      const Mat3d J = deformation_jacobian(deformation, samples.level.position[i].cast<double>(),
                                           double{samples.field.t[i]}, gradient,
                                           local_surface(samples.level.normal[i], shape, i));
      Mat3d cofactor;
      for (int c = 0; c < 3; ++c) cofactor.col(c) = J.col((c + 1) % 3).cross(J.col((c + 2) % 3));
      const Vec3d expected = cofactor * samples.level.normal[i].cast<double>();
      // How much of it survives cancellation decides how well float can know its direction.
      const double conditioning = expected.norm() / (1.0 + cofactor.norm());
      worst =
          std::max(worst, (expected.normalized() - result.normal[i].cast<double>()).norm() * conditioning);
      CHECK(result.normal[i].norm() == doctest::Approx(1.0).epsilon(1e-6));
    }
    CHECK(worst < 4e-6);
  }
}

TEST_CASE("each kind has the closed form that its name says") {
  const Level level{.position = test::points_of({{1, 0, 0}, {0, 0, 2}}),
                    .normal = test::points_of({{1, 0, 0}, {0, 0, 1}})};
  const ScaleField half = test::constant_field(2, 0.5F);
  const ShapeOperators flat = constant_shape(2, 0.0F, 0.0F, 0.0F);
  const auto at = [&](const Deformation& deformation, std::size_t i) {
    return deformed(deformation, Vec3d::Zero(), half, level, &flat).position[i];
  };
  CHECK((at(NormalOffset{.distance = 0.4}, 0) - Vec3f(1.2F, 0, 0)).norm() < 1e-6F);
  CHECK((at(TowardPoint{.target = Vec3d(1, 2, 0), .amount = 0.5}, 0) - Vec3f(1, 0.5F, 0)).norm() < 1e-6F);
  CHECK((at(Scaling{.center = Vec3d(0, 0, 1), .factors = Vec3d(3, 1, 0.5)}, 0) - Vec3f(2, 0, 0.25F)).norm() <
        1e-6F);
  // Two units up turn by the whole angle, halved by t.
  const Twist twist{.axis = Vec3d(0, 0, 3), .angle_rad = kPi, .length = 2.0};
  const Level above{.position = test::points_of({{1, 0, 2}, {1, 0, 0}}), .normal = level.normal};
  const Level twisted = deformed(twist, Vec3d::Zero(), half, above);
  CHECK((twisted.position[0] - Vec3f(0, 1, 2)).norm() < 1e-6F);
  CHECK(test::same_sample(twisted.position, above.position, 1));
  // One after the other: first up, then about the x axis.
  const Deformation both(
      {Translation{.vector = Vec3d(0, 0, 2)}, Rotation{.axis = Vec3d::UnitX(), .angle_rad = -kPi}});
  CHECK((at(both, 0) - Vec3f(1, 1, 0)).norm() < 1e-6F);
}

TEST_CASE("an offset beyond the focal points keeps a normal") {
  const Level level{.position = test::points_of({{1, 0, 0}}), .normal = test::points_of({{1, 0, 0}})};
  const ShapeOperators sphere = constant_shape(1, 1.0F, 0.0F, 1.0F);
  for (const double distance : {-1.0, -2.0, -1e9}) {
    const Level result = deformed(NormalOffset{.distance = distance}, Vec3d::Zero(),
                                  test::constant_field(1, 1.0F), level, &sphere);
    CHECK(result.normal[0] == Vec3f(1, 0, 0));
    CHECK(test::all_finite(result.position));
  }
}

TEST_CASE("where the map folds the surface the normal turns with dF/dp") {
  // v along g with u . g = -1 and the normal across: cofactor(J) n vanishes.
  const Level level{.position = test::points_of({{0, 0, 0}}), .normal = test::points_of({{0, 0, 1}})};
  ScaleField field = test::constant_field(1, 0.5F);
  field.gradient.set(0, {1, 0, 0});
  const Level result = deformed(Translation{.vector = Vec3d(-1.0, 0.0, 0.0)}, Vec3d::Zero(), field, level);
  CHECK(result.normal[0] == Vec3f(0, 0, 1));
}

TEST_CASE("samples with t = 0 and zero deformations keep every bit, signed zeros included") {
  Samples samples = random_samples(500, 101, 3.0F);
  samples.level.position.set(0, {-0.0F, 0.0F, -0.0F});
  for (std::size_t i = 0; i < 500; i += 3) samples.field.t[i] = 0.0F;
  const ShapeOperators shape = constant_shape(500, 0.4F, -0.3F, 0.7F);
  for (const Deformation& deformation : all_kinds()) {
    const Level result = deformed(deformation, Vec3d(1.0, 2.0, 3.0), samples.field, samples.level, &shape);
    for (std::size_t i = 0; i < 500; i += 3) {
      CHECK(test::same_sample(result.position, samples.level.position, i));
      CHECK(test::same_sample(result.normal, samples.level.normal, i));
    }
    CHECK_FALSE(test::same_sample(result.position, samples.level.position, 1));
  }
  samples.level.position.set(1, {-0.0F, -0.0F, -0.0F});
  const std::vector<Deformation> nothings = {
      Translation{},
      Rotation{.point = Vec3d(1.0, 2.0, 3.0), .angle_rad = 0.0},
      Scaling{.center = Vec3d(1.0, 2.0, 3.0)},
      Twist{},
      TowardPoint{.target = Vec3d(3.0, 2.0, 1.0)},
      NormalOffset{},
      Deformation({NormalOffset{}, Translation{}, Rotation{}, Scaling{}, Twist{}})};
  for (const Deformation& nothing : nothings) {
    const Level result = deformed(nothing, Vec3d(1.0, 2.0, 3.0), samples.field, samples.level, &shape);
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
        Deformation(Rotation{.axis = Vec3d(1e300, 1e300, 0.0), .angle_rad = -628.0}),
        Deformation(Scaling{.center = Vec3d(-1e9, 0.0, 0.0), .factors = Vec3d(1e3, 1e-3, 1.0)}),
        Deformation(TowardPoint{.target = Vec3d(1e9, 0.0, 0.0), .amount = 1.0}),
        Deformation(TowardPoint{.amount = -1e3}), Deformation(NormalOffset{.distance = -1e9}),
        Deformation(Twist{.axis = Vec3d(1.0, 0.0, 0.0), .angle_rad = 628.0, .length = 1e-9}),
        Deformation(far_and_twisted(7, 1)), Deformation(far_and_twisted(6, 2))}) {
    REQUIRE(validate(deformation).ok());
    const ShapeOperators shape = constant_shape(256, 1e30F, 1e30F, -1e30F);
    const Level result = deformed(deformation, Vec3d::Zero(), samples.field, samples.level, &shape);
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
  check_refused(NormalOffset{.distance = nan}, ErrorCode::kNonFinite, "deformation.distance");
  check_refused(NormalOffset{.distance = 2e9}, ErrorCode::kInvalidArgument, "deformation.distance");
  check_refused(TowardPoint{.amount = 1.5}, ErrorCode::kInvalidArgument, "deformation.amount");
  check_refused(TowardPoint{.target = Vec3d(nan, 0.0, 0.0)}, ErrorCode::kNonFinite, "deformation.target");
  check_refused(Scaling{.factors = Vec3d(1.0, 0.0, 1.0)}, ErrorCode::kInvalidArgument, "deformation.factors");
  check_refused(Scaling{.factors = Vec3d(1.0, 1e4, 1.0)}, ErrorCode::kInvalidArgument, "deformation.factors");
  check_refused(Twist{.length = 0.0}, ErrorCode::kInvalidArgument, "deformation.length");
  check_refused(Twist{.axis = Vec3d::Zero()}, ErrorCode::kInvalidArgument, "deformation.axis");
  check_refused(Deformation(std::vector<ElementaryDeformation>{}), ErrorCode::kInvalidArgument,
                "deformation.steps");
  check_refused(Deformation(std::vector<ElementaryDeformation>(9)), ErrorCode::kInvalidArgument,
                "deformation.steps");
  check_refused(Deformation({Translation{}, Rotation{.axis = Vec3d::Zero()}}), ErrorCode::kInvalidArgument,
                "deformation.steps[1].axis");
  check_refused(Deformation({Translation{}, NormalOffset{}}), ErrorCode::kInvalidArgument,
                "deformation.steps[1].type");
  CHECK(validate(Deformation({NormalOffset{}, Translation{}})).ok());
}

TEST_CASE("the same bytes for any thread count, instruction set and number of samples") {
  const Samples samples = random_samples(9001, 121, 1.0F);
  const Rotation rotation{.point = Vec3d(0.1, 0.0, 0.0), .axis = Vec3d(1.0, 2.0, 3.0), .angle_rad = 5.0};
  const ShapeOperators shape = constant_shape(9001, 0.4F, -0.3F, 0.7F);
  for (const Deformation& deformation : all_kinds()) {
    test::for_all_machines(
        [&] { return deformed(deformation, Vec3d::Zero(), samples.field, samples.level, &shape); },
        [](const Level& a, const Level& b) {
          CHECK(test::same_bytes(a.position, b.position));
          CHECK(test::same_bytes(a.normal, b.normal));
        });
  }
  const Level all = deformed(rotation, Vec3d::Zero(), samples.field, samples.level);
  for (const std::size_t n : {0, 1, 15, 16, 17}) {
    Samples some = samples;
    some.level.position.resize(n);
    some.level.normal.resize(n);
    some.field.t.resize(padded_to_block(n));
    some.field.gradient.resize(n);
    const Level result = deformed(rotation, Vec3d::Zero(), some.field, some.level);
    REQUIRE(result.position.size() == n);
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(test::same_sample(result.position, all.position, i));
      CHECK(test::same_sample(result.normal, all.normal, i));
    }
  }
}

}  // namespace
}  // namespace pointwright
