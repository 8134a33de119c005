#include "engine/editing/model_shape.h"

#include <doctest/doctest.h>

#include <limits>

#include "engine/editing/painting.h"
#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

using namespace pointwright::test;

std::shared_ptr<const Cloud> cloud_of(const Points& position, const Vec3d& origin = Vec3d::Zero()) {
  Cloud cloud;
  cloud.origin = origin;
  cloud.position = position;
  return std::make_shared<const Cloud>(std::move(cloud));
}

ShapeMatrix matrix_of(const Eigen::Matrix3d& linear, const Vec3d& translation) {
  ShapeMatrix matrix{};
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column)
      matrix[static_cast<std::size_t>(4 * row + column)] = linear(row, column);
    matrix[static_cast<std::size_t>(4 * row + 3)] = translation[row];
  }
  matrix[15] = 1.0;
  return matrix;
}

double least_distance(const ModelShape& shape, const Vec3d& point) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < shape.cloud->size(); ++i)
    best = std::min(best, (point - moved_sample(shape, i)).norm());
  return best;
}

// Painting agrees with the distance to every moved sample, but where that is the thickness to within float32.
void check_against_brute_force(const ModelShape& shape, const Points& position, const Vec3d& origin) {
  const PaintOperation operation{.shape = shape};
  REQUIRE(validate(operation).ok());
  Marks marks(position.size(), 0);
  const std::size_t changed = paint(operation, RegionKind::kZero,
                                    {.position = position, .normal = position, .origin = origin}, marks);
  CHECK(changed == count_marked(marks, RegionKind::kZero));
  std::size_t inside = 0;
  std::size_t undecided = 0;
  for (std::size_t i = 0; i < position.size(); ++i) {
    const Vec3d place = origin + position[i].cast<double>();
    const double distance = least_distance(shape, place);
    CHECK(contains(operation.shape, place) == (distance <= shape.thickness));
    if (std::abs(distance - shape.thickness) < 2e-6) {
      ++undecided;
      continue;
    }
    CHECK((marks[i] != 0) == (distance < shape.thickness));
    inside += marks[i];
  }
  CHECK(undecided < 5);
  CHECK(inside > 10);
  CHECK(inside < position.size());
}

TEST_CASE("a model moved in any way paints what is near its samples") {
  const Points surface = random_points(1500, 1);
  const Points model = random_points(300, 2);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vec3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix();
  const Eigen::Matrix3d stretched =
      turn * Vec3d(2.0, 0.3, -0.7).asDiagonal() * Eigen::AngleAxisd(0.4, Vec3d::UnitX()).toRotationMatrix();
  for (const double thickness : {0.05, 0.2}) {
    check_against_brute_force({.source = {}, .cloud = cloud_of(model), .thickness = thickness}, surface,
                              Vec3d::Zero());
    check_against_brute_force(
        {.source = {},
         .cloud = cloud_of(model, Vec3d(3.0, -1.0, 2.0)),
         .matrix = matrix_of(turn, Vec3d(0.1, 0.2, -0.3) - turn * Vec3d(3.0, -1.0, 2.0)),
         .thickness = thickness},
        surface, Vec3d::Zero());
    // From a scanner's own frame into national coordinates.
    const Vec3d far(500'000.0, 5'400'000.0, 120.0);
    check_against_brute_force(
        {.source = {}, .cloud = cloud_of(model), .matrix = matrix_of(stretched, far), .thickness = thickness},
        surface, far);
  }
}

TEST_CASE("samples of a model far from the surface do not disturb, nor does a model without samples") {
  Points model(3);
  model.set(0, Vec3f(0.5F, 0.0F, 0.0F));
  model.set(1, Vec3f(1e9F, 0.0F, 0.0F));
  model.set(2, Vec3f(0.5F, 0.0F, 0.0F));  // twice
  ModelShape shape{.source = {}, .cloud = cloud_of(model), .thickness = 0.125};
  shape.matrix[0] = 1e12;
  shape.matrix[3] = -0.5e12;
  const Points surface = points_of({Vec3f(0.125F, 0.0F, 0.0F), Vec3f(0.126F, 0.0F, 0.0F), Vec3f::Zero()});
  const auto painted = [&](const ModelShape& each) {
    Marks marks(surface.size(), 0);
    paint({.shape = each}, RegionKind::kOne,
          {.position = surface, .normal = surface, .origin = Vec3d::Zero()}, marks);
    return marks;
  };
  REQUIRE(validate(Shape(shape)).ok());
  CHECK(painted(shape) == Marks{2, 0, 2});  // the border belongs to it
  shape.cloud = cloud_of(Points());
  CHECK(painted(shape) == Marks{0, 0, 0});
  shape.cloud = cloud_of(model);
  shape.thickness = 1e12;
  CHECK(painted(shape) == Marks{2, 2, 2});
  Marks none;
  const Points no_samples;
  CHECK(paint({.shape = shape}, RegionKind::kOne,
              {.position = no_samples, .normal = no_samples, .origin = Vec3d::Zero()}, none) == 0);
}

TEST_CASE("model regions are the same with any number of threads, face the viewer and can be cancelled") {
  const Points surface = random_points(30'000, 4);
  const ModelShape shape{.source = {}, .cloud = cloud_of(random_points(5000, 5)), .thickness = 0.03};
  PaintOperation operation{.shape = shape};
  const PaintSurface painted_on{.position = surface, .normal = surface, .origin = Vec3d::Zero()};
  Marks first;
  for (const int threads : {1, 2, 3}) {
    Marks marks(surface.size(), 0);
    with_threads(threads, [&] { paint(operation, RegionKind::kZero, painted_on, marks); });
    if (first.empty()) first = marks;
    CHECK(marks == first);
  }
  operation.facing = Vec3d::UnitZ();
  Marks facing(surface.size(), 0);
  paint(operation, RegionKind::kZero, painted_on, facing);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    CHECK((facing[i] != 0) == (first[i] != 0 && surface[i].z() > 0.0F));
    kept += facing[i];
  }
  CHECK(kept > 0);
  const ExecutionContext context;
  context.cancel();
  Marks untouched(surface.size(), 0);
  CHECK(paint(operation, RegionKind::kZero, painted_on, untouched, &context) == 0);
}

TEST_CASE("models are refused with the member that is wrong") {
  const auto refused = [](const ModelShape& shape, ErrorCode code, const char* field) {
    const Result<void> result = validate(Shape(shape));
    REQUIRE(!result.ok());
    CHECK(result.error().code == code);
    CHECK(result.error().field == field);
  };
  const ModelShape good{.source = {}, .cloud = cloud_of(random_points(3, 1)), .thickness = 0.5};
  CHECK(validate(Shape(good)).ok());
  CHECK(has_its_data(good));
  CHECK_FALSE(has_its_data(without_data(good)));
  for (const double thickness : {0.0, -1.0}) {
    ModelShape thin = good;
    thin.thickness = thickness;
    refused(thin, ErrorCode::kInvalidArgument, "shape.thickness");
  }
  for (const std::size_t member : {12, 13, 14, 15}) {
    ModelShape projective = good;
    projective.matrix[member] += 0.5;
    refused(projective, ErrorCode::kInvalidArgument, "shape.matrix");
  }
  ModelShape flat = good;
  flat.matrix = matrix_of(Vec3d(1.0, 1.0, 0.0).asDiagonal(), Vec3d(5e5, 5e6, 0.0));
  refused(flat, ErrorCode::kInvalidArgument, "shape.matrix");
  ModelShape tiny = good;
  tiny.matrix = matrix_of(Vec3d(1e-6, 1e-3, 1e3).asDiagonal(), Vec3d(5e5, 5e6, 0.0));
  CHECK(validate(Shape(tiny)).ok());
  ModelShape open = good;
  open.matrix[3] = std::numeric_limits<double>::infinity();
  refused(open, ErrorCode::kNonFinite, "shape.matrix");
  open.matrix[3] = 2e12;
  refused(open, ErrorCode::kOutOfRange, "shape.matrix");
}

}  // namespace
}  // namespace pointwright
