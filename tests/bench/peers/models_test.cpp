#include "tests/bench/peers/models.h"

#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <utility>

#include "tests/support/surfaces.h"

namespace pointwright::peers {
namespace {

// Every edge belongs to two triangles that run along it in opposite directions.
bool is_closed(const TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& [a, b, c] : mesh.triangle) {
    for (const auto& edge : {std::pair{a, b}, {b, c}, {c, a}}) ++edges[edge];
  }
  for (const auto& [edge, times] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (times != 1 || back == edges.end()) return false;
  }
  return true;
}

double volume(const TriangleMesh& mesh) {
  double six = 0.0;
  for (const auto& [a, b, c] : mesh.triangle) {
    six += mesh.vertex[a].dot(mesh.vertex[b].cross(mesh.vertex[c]));
  }
  return six / 6.0;
}

double farthest(const Points& points, const test::SurfaceDistance& distance) {
  return test::summarized(test::distances_to(points, distance)).max;
}

Points floats_of(const std::vector<Vec3d>& vertices) {
  Points result(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) result.set(i, vertices[i].cast<float>());
  return result;
}

TEST_CASE("samples and vertices stand on the surface that distances are measured to") {
  for (const Model& model : {scan_model(20'000, 0.0), steps_model(20'000)}) {
    CAPTURE(model.name);
    CHECK(model.samples.size() == 20'000);
    CHECK(farthest(model.samples, model.distance) < 2e-7);
    CHECK(farthest(floats_of(model.mesh.vertex), model.distance) < 2e-7);
    CHECK(std::abs(static_cast<double>(model.mesh.vertex.size()) - 20'000.0) < 400.0);
    CHECK(is_closed(model.mesh));
  }
}

TEST_CASE("noise moves samples and vertices by its standard deviation") {
  const double noise = 0.001;
  const Model model = scan_model(20'000, noise);
  // Across the surface it is one of three independent coordinates; the surface itself bends a little.
  CHECK(test::summarized(test::distances_to(model.samples, model.distance)).rms ==
        doctest::Approx(noise).epsilon(0.05));
  CHECK(test::summarized(test::distances_to(floats_of(model.mesh.vertex), model.distance)).rms ==
        doctest::Approx(noise).epsilon(0.05));
}

TEST_CASE("meshes enclose their solids, outward") {
  // A torus of radii 1 and 0.4 without its bumps has 2 pi^2 0.16.
  CHECK(std::abs(volume(scan_model(20'000, 0.0).mesh)) == doctest::Approx(3.158).epsilon(0.01));
  CHECK(volume(steps_model(20'000).mesh) ==
        doctest::Approx(4.0 * 0.5 + 1.44 * 0.4 + 0.25 * 0.3).epsilon(0.01));
}

TEST_CASE("distances to the scan are those along its normals") {
  const Model model = scan_model(2'000, 0.0);
  for (std::size_t i = 0; i < model.samples.size(); ++i) {
    const Vec3d p = model.samples[i].cast<double>();
    const double u = std::atan2(p.y(), p.x());
    const Vec3d to_core = p - Vec3d(std::cos(u), std::sin(u), 0.0);
    // The distance grows by one with every unit along its gradient, which it has just off the surface.
    const Vec3d off = p + 0.002 * to_core.normalized();
    const double here = distance_to_scan(off);
    Vec3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d step = 1e-5 * Vec3d::Unit(axis);
      gradient[axis] = (distance_to_scan(off + step) - distance_to_scan(off - step)) / 2e-5;
    }
    REQUIRE(here <= 0.002 + 1e-6);
    REQUIRE(here > 0.0016);
    REQUIRE(gradient.norm() == doctest::Approx(1.0).epsilon(1e-3));
    REQUIRE(distance_to_scan(off - here * gradient) < 1e-6);
  }
}

TEST_CASE("distances to the steps are those to their rectangles") {
  CHECK(distance_to_steps({0.0, 0.0, 0.25}) == doctest::Approx(0.25));   // inside, above the bottom
  CHECK(distance_to_steps({0.0, 0.0, 0.9}) == doctest::Approx(0.25));    // no face between slabs: its walls
  CHECK(distance_to_steps({1.3, 1.4, 0.2}) == doctest::Approx(0.5));     // off a vertical edge
  CHECK(distance_to_steps({0.8, 0.0, 0.6}) == doctest::Approx(0.1));     // over the lowest step
  CHECK(distance_to_steps({0.0, 0.0, 1.5}) == doctest::Approx(0.3));     // over the top
  CHECK(distance_to_steps({0.65, 0.1, 0.55}) == doctest::Approx(0.05));  // in a corner that turns inward
}

}  // namespace
}  // namespace pointwright::peers
