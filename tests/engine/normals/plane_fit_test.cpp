#include "engine/normals/plane_fit.h"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using test::Random;

Symmetric3d symmetric(const Mat3d& m) {
  return {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)};
}

void add(PlaneFit& fit, const Vec3d& p, double weight) {
  fit.add(p.x(), p.y(), p.z(), weight);
}

Mat3d random_rotation(Random& random) {
  const Vec3d x = random.direction();
  const Vec3d y = x.cross(random.direction()).normalized();
  Mat3d result;
  result << x, y, x.cross(y);
  return result;
}

TEST_CASE("the smallest eigenvector is the one that Eigen's solver finds") {
  Random random(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const Mat3d frame = random_rotation(random);
    const double size = std::exp(random.uniform(-40.0, 20.0));
    // The least eigenvalue is at most 0.7 of the next: after six squarings the rest is 0.7^64, 1e-10.
    const double second = random.uniform(0.01, 1.0);
    const Vec3d values = size * Vec3d(1.0, second, random.uniform(0.0, 0.7) * second);
    const Mat3d matrix = frame * values.asDiagonal() * frame.transpose();
    Vec3d found;
    REQUIRE(smallest_eigenvector(symmetric(matrix), found));
    const Eigen::SelfAdjointEigenSolver<Mat3d> solver(matrix);
    CHECK(found.norm() == doctest::Approx(1.0).epsilon(1e-12));
    CHECK(std::abs(found.dot(solver.eigenvectors().col(0))) > 1.0 - 1e-8);
  }
}

TEST_CASE("two equal smallest eigenvalues that do not vanish give some unit vector") {
  Vec3d found;
  CHECK(smallest_eigenvector({.xx = 1.0, .yy = 1.0, .zz = 1.0}, found));
  CHECK(found.norm() == doctest::Approx(1.0));
  CHECK(smallest_eigenvector({.xx = 1.0, .yy = 0.5, .zz = 0.5}, found));
  CHECK(found.norm() == doctest::Approx(1.0));
  CHECK(std::abs(found.x()) < 1e-6);
}

TEST_CASE("of a line's matrix, and of none, the vector is a unit one of the null space") {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3d along = random.direction();
    Vec3d found;
    CHECK_FALSE(smallest_eigenvector(symmetric(along * along.transpose()), found));
    CHECK(found.norm() == doctest::Approx(1.0));
    CHECK(std::abs(found.dot(along)) < 1e-6);
  }
  Vec3d found;
  CHECK_FALSE(smallest_eigenvector(Symmetric3d{}, found));
  CHECK(found.norm() == doctest::Approx(1.0));
}

TEST_CASE("a fit finds the plane that its points lie on, and their weighted centroid") {
  Random random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const Mat3d frame = random_rotation(random);
    const Vec3d center = 5.0 * random.direction();
    PlaneFit fit;
    Vec3d sum = Vec3d::Zero();
    double weights = 0.0;
    for (int i = 0; i < 12; ++i) {
      const Vec3d p = center + frame * Vec3d(random.normal(), random.normal(), 0.0);
      const double w = random.uniform(0.1, 2.0);
      add(fit, p, w);
      sum += w * p;
      weights += w;
    }
    Vec3d n;
    REQUIRE(fit.normal(n));
    CHECK(std::abs(n.dot(frame.col(2))) > 1.0 - 1e-10);
    CHECK(fit.weight() == doctest::Approx(weights));
    CHECK((fit.centroid() - sum / weights).norm() < 1e-12);
  }
}

TEST_CASE("the fit minimises the weighted squared distances") {
  Random random(4);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<std::pair<Vec3d, double>> points;
    PlaneFit fit;
    for (int i = 0; i < 15; ++i) {
      points.emplace_back(Vec3d(random.normal(), random.normal(), 0.3 * random.normal()), random.uniform());
      add(fit, points.back().first, points.back().second);
    }
    Vec3d n;
    REQUIRE(fit.normal(n));
    const auto cost = [&](const Vec3d& direction) {
      double result = 0.0;
      for (const auto& [p, w] : points) result += w * std::pow((p - fit.centroid()).dot(direction), 2);
      return result;
    };
    for (int other = 0; other < 100; ++other) {
      CHECK(cost((n + 0.1 * random.direction()).normalized()) >= cost(n) * (1.0 - 1e-9));
    }
  }
}

TEST_CASE("points on a line span no plane") {
  PlaneFit fit;
  for (int i = 0; i < 5; ++i) add(fit, static_cast<double>(i) * Vec3d(1, 2, 3), 1.0);
  Vec3d n;
  CHECK_FALSE(fit.normal(n));
  CHECK(std::abs(n.dot(Vec3d(1, 2, 3).normalized())) < 1e-6);
}

}  // namespace
}  // namespace pointwright
