// Curved surfaces under large deformations, against what a dense sampling of the original becomes.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/resampling/resampling_support.h"

namespace pointwright {
namespace {

constexpr double kTau = 2.0 * std::numbers::pi;

// Samples with 0 < t < 1, children by where they stood at rest.
std::vector<std::uint8_t> between(const test::EditScene& scene, const Points& children) {
  std::vector<std::uint8_t> result;
  const ScaleField added = compute_scale_field(children, scene.regions, scene.params.blend);
  for (const ScaleField* field : {&scene.field, &added})
    for (std::size_t i = 0; i < field->size(); ++i)
      result.push_back(field->t[i] > 0.0F && field->t[i] < 1.0F ? 1 : 0);
  return result;
}

struct Stretched {
  ResampledEdit edit;
  Points children;  // at rest
  test::Spacing spacing;
  double most = 0.0;
  test::Holes holes;
};
// Checks what holds for all: sound columns, and children exactly on F of where they stood.
Stretched stretched(const test::EditScene& scene, const Level& dense, double unit) {
  Stretched result{.edit = test::resampled(scene), .children = test::children_at_rest(scene)};
  test::check_sound(result.edit);
  const std::size_t before = scene.sampling->size();
  const Points& p = result.edit.surface.levels[0].position;
  REQUIRE(p.size() == before + result.children.size());
  Level rest{.position = result.children, .normal = Points(result.children.size())};
  const test::DeformedLevel moved = test::deformed_by(scene, rest);
  std::size_t off = 0;
  for (std::size_t c = 0; c < rest.position.size(); ++c)
    off += p[before + c] == moved.level.position[c] ? 0U : 1U;
  CHECK(off == 0);
  const Points middle = test::selected(p, between(scene, result.children));
  result.spacing = test::spacing_of(middle, unit);
  result.most = test::nearest_distances(middle).back() / unit;
  result.holes = test::holes_of(test::evenly_on_deformed(scene, dense), p, unit);
  MESSAGE(before << " -> " << p.size() << " samples, nearest: min " << result.spacing.least << " mean "
                 << result.spacing.mean << " cv " << result.spacing.variation << " max/mean "
                 << result.most / result.spacing.mean << ", discs: " << result.holes.p999 << " / "
                 << result.holes.most);
  return result;
}

// A smooth function of the place at rest: waves of ten spacings.
double smooth(const Vec3f& p, double unit) {
  const double k = kTau / (10.0 * unit);
  return std::sin(k * static_cast<double>(p.x())) * std::cos(k * static_cast<double>(p.y())) +
         0.5 * std::sin(k * static_cast<double>(p.z()));
}
double error_of(const std::vector<float>& column, std::size_t before, const Points& children, double unit) {
  std::vector<double> error;
  for (std::size_t c = 0; c < children.size(); ++c)
    error.push_back(static_cast<double>(column[before + c]) / (0.1 * unit) - smooth(children[c], unit));
  return test::root_mean_square(error);
}

TEST_CASE("a sphere pulled into a long spike is covered, and keeps its detail") {
  const std::size_t n = 20'000;
  const double unit = std::sqrt(2.0 * kTau / static_cast<double>(n));
  const test::Surface sphere = test::sphere(n, 1.0, test::Sampling::kRegular);
  const Level base = test::level_of(sphere);
  const MultiresSurface surface = test::one_band(
      base, [&](std::size_t i) { return static_cast<float>(0.1 * unit * smooth(base.position[i], unit)); });
  const test::EditScene scene = test::scene_of(
      surface, [](const Vec3f& p) { return p.z() < -0.2F   ? 1
                                           : p.z() > 0.95F ? 2
                                                           : 0; },
      test::resampling_by(Translation{.vector = Vec3d(0.0, 0.0, 4.0)}));
  const Stretched spike =
      stretched(scene, test::level_of(test::sphere(400'000, 1.0, test::Sampling::kRandom)), unit);
  CHECK(spike.edit.inserted > n);
  CHECK(spike.spacing.least > 0.55);
  CHECK(spike.spacing.mean > 0.87);
  CHECK(spike.spacing.variation < 0.08);
  CHECK(spike.most < 1.3 * spike.spacing.mean);
  CHECK(spike.holes.p999 < 0.80);
  CHECK(spike.holes.most < 0.95);

  std::vector<double> off;
  for (std::size_t c = 0; c < spike.children.size(); ++c)
    off.push_back(std::abs(static_cast<double>(spike.children[c].norm()) - 1.0) / unit);
  std::sort(off.begin(), off.end());
  const double detail = error_of(spike.edit.surface.detail[0], n, spike.children, unit);
  MESSAGE("off the sphere at rest: p99 " << off[off.size() * 99 / 100] << ", most " << off.back()
                                         << " spacings; detail " << detail << " of 0.61");
  CHECK(off[off.size() * 99 / 100] < 1e-5);
  CHECK(off.back() < 2e-5);
  CHECK(detail < 0.01 * 0.61);

  std::vector<double> angle;
  const auto project = [](const Vec3d& p) { return Vec3d(p.normalized()); };
  for (std::size_t c = 0; c < spike.children.size(); c += 40) {
    const Vec3d p = spike.children[c].cast<double>().normalized();
    const Vec3d expected =
        test::reference_normal(scene.regions, scene.params.deformation, p, p, 1e-5, project);
    const Vec3d normal = spike.edit.surface.levels[0].normal[n + c].cast<double>();
    angle.push_back(std::acos(std::clamp(normal.dot(expected), -1.0, 1.0)));
  }
  std::sort(angle.begin(), angle.end());
  MESSAGE("normals off by: median " << angle[angle.size() / 2] << ", p95 " << angle[angle.size() * 95 / 100]
                                    << " rad");
  CHECK(angle[angle.size() / 2] < 2e-4);
  CHECK(angle[angle.size() * 95 / 100] < 1e-3);
}

TEST_CASE("half a torus turned once about an axis through it is covered") {
  const std::size_t n = 20'000;
  const double unit = std::sqrt(kTau * kTau * 0.35 / static_cast<double>(n));
  const test::EditScene scene = test::scene_of(
      {.levels = {test::level_of(test::torus(n, 1.0, 0.35, test::Sampling::kRegular))}, .detail = {}},
      [](const Vec3f& p) { return p.x() < -0.9F  ? 1
                                  : p.x() > 0.9F ? 2
                                                 : 0; },
      test::resampling_by(Rotation{.axis = Vec3d::UnitX(), .angle_rad = kTau}));
  const Stretched turned =
      stretched(scene, test::level_of(test::torus(400'000, 1.0, 0.35, test::Sampling::kRandom)), unit);
  CHECK(turned.edit.inserted > n);
  CHECK(turned.holes.p999 < 0.90);
  CHECK(turned.holes.most < 1.15);
  std::vector<double> off;
  for (std::size_t c = 0; c < turned.children.size(); ++c) {
    const Vec3d p = turned.children[c].cast<double>();
    off.push_back(std::abs(std::hypot(std::hypot(p.x(), p.y()) - 1.0, p.z()) - 0.35) / unit);
  }
  std::sort(off.begin(), off.end());
  MESSAGE("off the torus at rest: rms " << test::root_mean_square(off) << ", most " << off.back());
  CHECK(test::root_mean_square(off) < 3e-4);
  CHECK(off.back() < 3e-3);
}

// A tube of radius 0.3 around the z axis, z in [-1, 1]: a lattice, or so many samples anywhere.
Level tube(std::size_t around, std::size_t along, bool random) {
  const std::size_t n = around * along;
  test::Random any(5);
  test::Surface surface{.position = Points(n), .normal = Points(n)};
  for (std::size_t i = 0; i < n; ++i) {
    const auto column = static_cast<double>(i % around) + 0.5 * static_cast<double>(i / around % 2);
    const double turn = kTau * (random ? any.uniform() : column / static_cast<double>(around));
    const double z = random
                         ? any.uniform(-1.0, 1.0)
                         : -1.0 + 2.0 * (static_cast<double>(i / around) + 0.5) / static_cast<double>(along);
    const Vec3f normal = Vec3d(std::cos(turn), std::sin(turn), 0.0).cast<float>();
    surface.normal.set(i, normal);
    surface.position.set(i, 0.3F * normal + Vec3f(0.0F, 0.0F, static_cast<float>(z)));
  }
  return test::level_of(test::coherent(surface));
}

TEST_CASE("a tube twisted once is covered") {
  const std::size_t n = std::size_t{94} * 100;
  const double unit = std::sqrt(kTau * 0.3 * 2.0 / static_cast<double>(n));
  const test::EditScene scene = test::scene_of(
      {.levels = {tube(94, 100, false)}, .detail = {}},
      [](const Vec3f& p) { return p.z() < -0.7F  ? 1
                                  : p.z() > 0.7F ? 2
                                                 : 0; },
      test::resampling_by(
          Twist{.point = Vec3d(0.0, 0.0, -0.7), .axis = Vec3d::UnitZ(), .angle_rad = kTau, .length = 1.4}));
  const Stretched twisted = stretched(scene, tube(4'000, 100, true), unit);
  CHECK(twisted.edit.inserted > n / 2);
  CHECK(twisted.holes.p999 < 0.70);
  CHECK(twisted.holes.most < 0.80);
}

TEST_CASE("what a scaling makes wide without bending it splits too") {
  const double unit = 0.02;
  const test::EditScene scene = test::scene_of(
      {.levels = {test::level_of(test::plane(100, unit, test::Sampling::kJittered))}, .detail = {}},
      [](const Vec3f& p) { return p.norm() > 0.9F   ? 1
                                  : p.norm() < 0.3F ? 2
                                                    : 0; },
      test::resampling_by(Deformation(
          {Scaling{.factors = Vec3d::Constant(3.0)}, Translation{.vector = Vec3d(0.0, 0.0, 2.0)}})));
  const Stretched wide =
      stretched(scene, test::level_of(test::plane(600, unit / 6.0, test::Sampling::kRandom)), unit);
  CHECK(wide.holes.p999 < 0.90);
  CHECK(wide.holes.most < 1.15);
  std::size_t whole = 0;
  std::size_t wrong = 0;
  std::vector<std::size_t> children(scene.sampling->size(), 0);
  for (std::size_t c = scene.sampling->size(); c < wide.edit.sampling->size(); ++c)
    ++children[wide.edit.sampling->parent[c]];  // ids of a plane's samples are their numbers
  std::vector<std::uint8_t> rigid(wide.edit.sampling->size(), 0);
  for (std::size_t i = 0; i < scene.sampling->size(); ++i) {
    if (scene.field.t[i] != 1.0F) continue;
    ++whole;
    wrong += children[i] != 8 ? 1U : 0U;
    rigid[i] = 1;
  }
  CHECK(whole > 500);
  CHECK(wrong == 0);
  const ScaleField added = compute_scale_field(wide.children, scene.regions, Blend::kQuartic);
  for (std::size_t c = 0; c < added.size(); ++c)
    if (added.t[c] == 1.0F) rigid[scene.sampling->size() + c] = 1;
  const test::Spacing spacing =
      test::spacing_of(test::selected(wide.edit.surface.levels[0].position, rigid), unit);
  MESSAGE("scaled part: nearest min " << spacing.least << " mean " << spacing.mean << " cv "
                                      << spacing.variation);
  CHECK(spacing.mean > 0.82);
  CHECK(spacing.variation < 0.12);
}

}  // namespace
}  // namespace pointwright
