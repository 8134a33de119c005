#include "engine/normals/estimation.h"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "tests/support/all_machines.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kDegree = 3.14159265358979 / 180.0;

Points estimated(const Points& points, std::uint32_t k = 10, NormalParams params = {},
                 std::size_t* degenerate = nullptr) {
  Points normal;
  const std::size_t count = estimate_normals(points, build_neighbor_graph(points, k), params, normal);
  if (degenerate != nullptr) *degenerate = count;
  return normal;
}

bool all_unit(const Points& normal) {
  for (std::size_t i = 0; i < normal.size(); ++i) {
    if (!(std::abs(normal[i].norm() - 1.0F) < 1e-5F)) return false;
  }
  return true;
}

double worst_line_angle(const Points& a, const Points& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, line_angle(a[i], b[i]));
  return worst;
}

TEST_CASE("the normals of a plane are exact") {
  // Rounding alone: offsets within a plane through tilted axes carry 1e-7 of the coordinates, here 40
  // spacings.
  for (const Sampling sampling : {Sampling::kRegular, Sampling::kJittered, Sampling::kRandom}) {
    for (const double spacing : {1e-4, 1.0, 1e4}) {
      const Surface flat = plane(40, spacing, sampling);
      std::size_t degenerate = 1;
      CHECK(worst_line_angle(estimated(flat.position, 10, {}, &degenerate), flat.normal) < 1e-6);
      CHECK(degenerate == 0);
    }
  }
  const Surface flat = plane(40, 1.0, Sampling::kJittered);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()));
  Surface tilted = flat;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    tilted.position.set(i, (turn * flat.position[i].cast<double>()).cast<float>());
    tilted.normal.set(i, (turn * flat.normal[i].cast<double>()).cast<float>());
  }
  tilted = coherent(tilted);
  CHECK(worst_line_angle(estimated(tilted.position), tilted.normal) < 1e-4);
}

TEST_CASE("the error on curved surfaces falls with the spacing") {
  // A one-sided neighbourhood of size h on a surface of curvature c tilts the plane by about c h: halving h
  // (four times the samples) halves the error. The rate is read over 16 times the samples: 4, or more where
  // an even sampling cancels the first order.
  struct Case {
    std::string name;
    std::function<Surface(std::size_t)> make;  // of the count
    double finest;                             // degrees at the finest, about 1.5 times what is measured
  };
  const std::array<std::size_t, 3> counts{2'500, 10'000, 40'000};
  const std::vector<Case> cases{
      {"even sphere", [](std::size_t n) { return sphere(n, 1.0, Sampling::kRegular); }, 0.15},
      {"random sphere", [](std::size_t n) { return sphere(n, 1.0, Sampling::kRandom); }, 0.6},
      {"even torus", [](std::size_t n) { return torus(n, 1.0, 0.4, Sampling::kRegular); }, 1.0},
      {"random torus", [](std::size_t n) { return torus(n, 1.0, 0.4, Sampling::kRandom); }, 1.5},
      {"jittered wave",
       [](std::size_t n) {
         const auto side = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(n))));
         return wave(side, 4.0 / static_cast<double>(side), Sampling::kJittered, 0.1, 1.0);
       },
       2.0},
  };
  for (const Case& c : cases) {
    CAPTURE(c.name);
    std::array<double, 3> error{};
    for (std::size_t level = 0; level < counts.size(); ++level) {
      const Surface surface = c.make(counts[level]);
      const Points normal = estimated(surface.position);
      CHECK(all_unit(normal));
      error[level] = mean_line_angle(normal, surface.normal);
    }
    MESSAGE(c.name << ": mean error in degrees " << error[0] / kDegree << " " << error[1] / kDegree << " "
                   << error[2] / kDegree);
    CHECK(error[2] < c.finest * kDegree);
    CHECK(error[1] < error[0]);
    CHECK(error[2] < error[1]);
    CHECK(error[0] / error[2] > 3.4);
  }
}

// The mean angle over the samples that `inner` accepts.
double mean_error(const Points& normal, const Surface& surface,
                  const std::function<bool(const Vec3f&)>& inner) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if (!inner(surface.position[i])) continue;
    sum += line_angle(normal[i], surface.normal[i]);
    ++count;
  }
  return sum / static_cast<double>(count);
}

// A lattice of longitudes and latitudes: around every sample symmetric up to terms of the next order.
Surface lattice(std::size_t rows, std::size_t columns,
                const std::function<std::pair<Vec3d, Vec3d>(double, double)>& at) {
  Surface surface{Points(rows * columns), Points(rows * columns)};
  for (std::size_t i = 0; i < rows * columns; ++i) {
    const auto [p, n] = at(static_cast<double>(i / columns) / static_cast<double>(rows),
                           static_cast<double>(i % columns) / static_cast<double>(columns));
    surface.position.set(i, p.cast<float>());
    surface.normal.set(i, n.cast<float>());
  }
  return coherent(surface);
}

constexpr double kTwoPi = 6.28318530717959;

// Equal steps along both circles where the longitude's radius is 1; between the latitudes of 60 degrees.
Surface sphere_lattice(std::size_t side) {
  return lattice(side / 3, side, [](double v, double u) {
    const double latitude = (v - 0.5) * kTwoPi / 3.0;
    const Vec3d n(std::cos(latitude) * std::cos(kTwoPi * u), std::cos(latitude) * std::sin(kTwoPi * u),
                  std::sin(latitude));
    return std::pair{n, n};
  });
}
Surface torus_lattice(std::size_t side) {
  return lattice(side * 2 / 5, side, [](double v, double u) {
    const Vec3d out(std::cos(kTwoPi * u), std::sin(kTwoPi * u), 0.0);
    const Vec3d n = std::cos(kTwoPi * v) * out + std::sin(kTwoPi * v) * Vec3d::UnitZ();
    return std::pair{Vec3d(out + 0.4 * n), n};
  });
}

TEST_CASE("on an even sampling the error is of second order in the spacing") {
  // In the tangent frame z = c x^2 / 2 + c' x^3 / 6 + ...; the fitted plane tilts by sum w x z / sum w x^2.
  // The quadratic term gives c sum w x^3 / (2 sum w x^2), of first order, but nothing where the neighbourhood
  // is symmetric; the cubic one c' sum w x^4 / (6 sum w x^2), about c' r^2 / 12 at most. These lattices are
  // symmetric up to terms of the next order, and all neighbours within a radius keep that symmetry (the k
  // nearest cut a shell in two): halving the spacing leaves a quarter, a sixteenth in two steps. A shell that
  // crosses the sphere on one side only tilts by a first-order step, but at a share of the samples that falls
  // with the spacing, too; the tolerance of a fourth is for the chance in it.
  struct Case {
    std::string name;
    std::function<Surface(std::size_t)> make;  // of the samples along a side
    double side_length;
    std::function<bool(const Vec3f&)> inner;  // away from rims, where neighbourhoods are one-sided
    double finest;                            // degrees, about 1.5 times what is measured
  };
  const std::vector<Case> cases{
      {"sphere", sphere_lattice, kTwoPi, [](const Vec3f& p) { return std::abs(p.z()) < 0.5F; }, 0.0015},
      {"torus", torus_lattice, kTwoPi, [](const Vec3f&) { return true; }, 0.012},
      {"wave",
       [](std::size_t side) {
         return wave(side, kTwoPi / static_cast<double>(side), Sampling::kRegular, 0.1, kTwoPi / 3.0);
       },
       kTwoPi, [](const Vec3f& p) { return p.head<2>().cwiseAbs().maxCoeff() < 2.4F; }, 0.02},
  };
  for (const Case& c : cases) {
    CAPTURE(c.name);
    std::array<double, 3> error{};
    std::size_t side = 90;
    for (double& e : error) {
      const Surface surface = c.make(side);
      const double radius = 2.6 * c.side_length / static_cast<double>(side);
      const auto graph =
          build_radius_graph(surface.position, {.radius = static_cast<float>(radius), .limit = 128});
      REQUIRE(graph.ok());
      CHECK(graph.value().cut_count == 0);
      Points normal;
      CHECK(estimate_normals(surface.position, graph.value(), {}, normal) == 0);
      CHECK(all_unit(normal));
      e = mean_error(normal, surface, c.inner);
      side *= 2;
    }
    MESSAGE(c.name << ": mean error in degrees " << error[0] / kDegree << " " << error[1] / kDegree << " "
                   << error[2] / kDegree);
    CHECK(error[2] < c.finest * kDegree);
    CHECK(error[0] / error[2] > 12.0);
  }
}

TEST_CASE("a radius graph that lists the k nearest gives the normals of the k nearest") {
  // Every list of the radius graph cut at ten: the very same neighbours, through rows of the same kernel.
  const Points points = with_noise(torus(5'001, 1.0, 0.4, Sampling::kRandom), 0.003).position;
  const auto ball = build_radius_graph(points, {.radius = 0.5F, .limit = 10});
  REQUIRE(ball.ok());
  REQUIRE(ball.value().cut_count == points.size());
  for (const float sigma : {0.3F, 0.7F}) {
    Points of_ball;
    estimate_normals(points, ball.value(), {.sigma = sigma}, of_ball);
    CHECK(of_ball == estimated(points, 10, {.sigma = sigma}));
  }
}

TEST_CASE("normals of a radius are those of the covariance over each ball") {
  const Surface surface = with_noise(sphere(4'000, 1.0, Sampling::kRandom), 0.004);
  const Points& points = surface.position;
  for (const std::uint32_t limit : {20U, 200U}) {  // more than 32 neighbours are gathered twice
    const auto graph = build_radius_graph(points, {.radius = 0.25F, .limit = limit});
    REQUIRE(graph.ok());
    Points normal;
    CHECK(estimate_normals(points, graph.value(), {}, normal) == 0);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto list = graph.value().of(i);
      const Vec3d p = points[i].cast<double>();
      const double r_sq = (points[list.back()].cast<double>() - p).squaredNorm();
      double total = 1.0;
      Vec3d first = Vec3d::Zero();
      Mat3d second = Mat3d::Zero();
      for (const std::uint32_t q : list) {
        const Vec3d e = points[q].cast<double>() - p;
        const double w = std::exp(-e.squaredNorm() / (0.49 * r_sq));
        total += w;
        first += w * e;
        second += w * e * e.transpose();
      }
      const Eigen::SelfAdjointEigenSolver<Mat3d> solver(second / total -
                                                        first * first.transpose() / (total * total));
      wrong += line_angle(normal[i], solver.eigenvectors().col(0).cast<float>()) > 1e-3 ? 1U : 0U;
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("samples alone in their balls are degenerate") {
  const Points points = plane(10, 1.0, Sampling::kRegular).position;
  const auto graph = build_radius_graph(points, {.radius = 0.5F});
  REQUIRE(graph.ok());
  Points normal;
  CHECK(estimate_normals(points, graph.value(), {}, normal) == 100);
  CHECK(all_unit(normal));
  Points none;
  const auto empty = build_radius_graph(Points{}, {.radius = 0.5F});
  REQUIRE(empty.ok());
  CHECK(estimate_normals(Points{}, empty.value(), {}, none) == 0);
  CHECK_THROWS_AS(estimate_normals(points, empty.value(), {}, none), LogicError);
}

TEST_CASE("noise tilts the normals in proportion, and wider neighbourhoods less") {
  // Least squares over k + 1 samples whose mean squared extent along an axis is r^2 / 4, r^2 = k h^2 / pi:
  // the slope's standard deviation is sigma / (0.9 h sqrt 11), a third of sigma / h an axis, 0.42 sigma / h
  // in angle; the Gaussian weights, which trust the near ones more, cost up to half as much again.
  const Surface flat = plane(120, 1.0, Sampling::kJittered);
  for (const double sigma : {0.02, 0.1}) {
    const Surface noisy = with_noise(flat, sigma, 5);
    const double ten = mean_line_angle(estimated(noisy.position, 10), noisy.normal);
    const double twenty = mean_line_angle(estimated(noisy.position, 20), noisy.normal);
    MESSAGE("angle over sigma / h: " << ten / sigma << " (k = 10) " << twenty / sigma << " (k = 20)");
    CHECK(ten < 0.65 * sigma);
    CHECK(ten > 0.25 * sigma);
    CHECK(twenty < 0.7 * ten);
  }
}

TEST_CASE("the normals are those of the weighted covariance of equations 2 to 4") {
  const Surface surface = with_noise(torus(3000, 1.0, 0.4, Sampling::kRandom), 0.005);
  const Points& points = surface.position;
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  for (const float sigma : {0.3F, 0.7F, 100.0F}) {
    CAPTURE(sigma);
    Points normal;
    estimate_normals(points, graph, NormalParams{.sigma = sigma}, normal);
    std::size_t compared = 0;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3d p = points[i].cast<double>();
      const double r_sq = (points[graph.index(i, 9)].cast<double>() - p).squaredNorm();
      double total = 1.0;
      Vec3d first = Vec3d::Zero();
      Mat3d second = Mat3d::Zero();
      for (std::uint32_t j = 0; j < 10; ++j) {
        const Vec3d e = points[graph.index(i, j)].cast<double>() - p;
        const double w = std::exp(-e.squaredNorm() / (double{sigma} * double{sigma} * r_sq));
        total += w;
        first += w * e;
        second += w * e * e.transpose();
      }
      const Eigen::SelfAdjointEigenSolver<Mat3d> solver(second / total -
                                                        first * first.transpose() / (total * total));
      // Where the two smallest eigenvalues are close, no direction is the right one.
      if (solver.eigenvalues()[0] > 0.3 * solver.eigenvalues()[1]) continue;
      ++compared;
      if (line_angle(normal[i], solver.eigenvectors().col(0).cast<float>()) > 1e-3) ++wrong;
    }
    CHECK(compared > 2000);
    CHECK(wrong == 0);
  }
}

TEST_CASE("degenerate neighbourhoods are counted and get a unit vector across their direction") {
  std::size_t degenerate = 0;
  SUBCASE("collinear samples") {
    for (const Vec3f& to : {Vec3f(1, 0, 0), Vec3f(0, 0, 1), Vec3f(1, 1, 1), Vec3f(-3, 2, 0.1F)}) {
      const Points line = collinear(100, {0, 0, 0}, to);
      const Points normal = estimated(line, 10, {}, &degenerate);
      CHECK(degenerate == 100);
      CHECK(all_unit(normal));
      for (std::size_t i = 0; i < 100; ++i) CHECK(std::abs(normal[i].dot(to.normalized())) < 1e-3F);
    }
  }
  SUBCASE("samples that coincide") {
    CHECK(all_unit(estimated(identical(40, {5, 5, 5}), 10, {}, &degenerate)));
    CHECK(degenerate == 40);
  }
  SUBCASE("one sample") {
    CHECK(all_unit(estimated(identical(1, {5, 5, 5}), 10, {}, &degenerate)));
    CHECK(degenerate == 1);
  }
  SUBCASE("two samples") {
    const Points normal = estimated(from_list({{0, 0, 0}, {1, 2, 0}}), 10, {}, &degenerate);
    CHECK(degenerate == 2);
    CHECK(all_unit(normal));
    CHECK(std::abs(normal[0].dot(Vec3f(1, 2, 0))) < 1e-4F);
  }
  SUBCASE("no sample") {
    CHECK(estimated(Points{}, 10, {}, &degenerate).empty());
    CHECK(degenerate == 0);
  }
}

TEST_CASE("three samples have the normal of their triangle") {
  std::size_t degenerate = 1;
  const Points normal = estimated(from_list({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}), 10, {}, &degenerate);
  CHECK(degenerate == 0);
  for (std::size_t i = 0; i < 3; ++i) CHECK(std::abs(normal[i].z()) > 1.0F - 1e-6F);
}

TEST_CASE("duplicates share one normal") {
  const Surface ball = sphere(2000, 1.0, Sampling::kRandom);
  const Points points = joined({ball, ball}).position;
  const Points normal = estimated(points);
  for (std::size_t i = 0; i < points.size(); i += 2) CHECK(normal[i] == normal[i + 1]);
}

TEST_CASE("every instruction set and thread count gives the same bytes") {
  const Points points = with_noise(torus(20'003, 1.0, 0.4, Sampling::kRandom), 0.003).position;
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  const auto ball = build_radius_graph(points, {.radius = 0.05F});
  REQUIRE(ball.ok());
  struct Estimated {
    Points normal, ball_normal;
    std::size_t degenerate = 0;
  };
  for_all_machines(
      [&] {
        Estimated made;
        made.degenerate = estimate_normals(points, graph, {}, made.normal);
        estimate_normals(points, ball.value(), {}, made.ball_normal);
        return made;
      },
      [](const Estimated& one, const Estimated& other) {
        CHECK(other.degenerate == one.degenerate);
        CHECK(other.normal == one.normal);
        CHECK(other.ball_normal == one.ball_normal);
      });
}

TEST_CASE("a sigma out of range or a graph of other points is a logic error") {
  const Points points = plane(10, 1.0, Sampling::kRegular).position;
  const NeighborGraph graph = build_neighbor_graph(points, 10);
  Points normal;
  for (const float sigma : {0.0F, -1.0F, 101.0F, std::nanf("")}) {
    CHECK_THROWS_AS(estimate_normals(points, graph, NormalParams{.sigma = sigma}, normal), LogicError);
  }
  CHECK_THROWS_AS(estimate_normals(identical(3, {0, 0, 0}), graph, {}, normal), LogicError);
}

TEST_CASE("the scale of the model does not matter") {
  // Powers of two change no mantissa: the same bits, from a millionth of a unit to a million units.
  const Points points = with_noise(sphere(3000, 1.0, Sampling::kRandom), 0.002).position;
  const Points reference = estimated(points);
  for (const float factor : {0x1.0p-20F, 0x1.0p20F}) {
    Points scaled(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) scaled.set(i, factor * points[i]);
    CHECK(estimated(scaled) == reference);
  }
}

TEST_CASE("an estimation that is cancelled before it starts fits no plane") {
  const Surface surface = plane(100, 1.0, Sampling::kJittered);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  const ExecutionContext context;
  context.cancel();
  Points normal;
  CHECK(estimate_normals(surface.position, graph, {}, normal, &context) == 0);
  REQUIRE(normal.size() == surface.size());
  for (std::size_t i = 0; i < normal.size(); ++i) CHECK(normal[i].isZero());
}

}  // namespace
}  // namespace pointwright
