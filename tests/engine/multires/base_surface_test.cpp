#include "engine/multires/base_surface.h"

#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/multires/decomposition.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

constexpr double kTau = 6.283185307179586;

BaseSurface base_of(const Surface& surface, double scale, const Vec3d& origin = Vec3d::Zero()) {
  auto result = build_base_surface(surface.position, surface.normal, origin, static_cast<float>(scale), {});
  REQUIRE(result.ok());
  return std::move(result).value();
}

Decomposition decomposed(const Surface& surface, const BaseSurface& base, double spacing) {
  auto result = decompose(surface.position, surface.normal, base, static_cast<float>(spacing), {}, {});
  REQUIRE(result.ok());
  return std::move(result).value();
}

TEST_CASE("clusters that the grid cuts become one sample each, and are smoothed as such") {
  // Eight samples around every second corner of the grid, one in each of its cells, almost in a plane; next
  // clusters face opposite ways.
  constexpr double kCell = 0.7;
  const Vec3d half(0.003, 0.003, 0.00003);
  Surface surface{.position = Points(8000), .normal = Points(8000)};
  for (std::size_t i = 0; i < 8000; ++i) {
    const std::size_t cluster = i / 8;
    const std::size_t octant = i % 8;
    const std::size_t x = cluster % 10;
    const std::size_t y = cluster / 10 % 10;
    const std::size_t z = cluster / 100;
    const Vec3d corner =
        2.0 * kCell * Vec3d(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z));
    const Vec3d side((octant & 1) != 0 ? 1.0 : -1.0, (octant & 2) != 0 ? 1.0 : -1.0,
                     (octant & 4) != 0 ? 1.0 : -1.0);
    surface.position.set(i, (corner + half.cwiseProduct(side)).cast<float>());
    surface.normal.set(i, {0.0F, 0.0F, (x + y + z) % 2 == 0 ? 1.0F : -1.0F});
  }
  const BaseSurface base = base_of(coherent(surface), 1.0);
  CHECK(base.position.size() == 1000);
  CHECK(base.iterations < 10);
  CHECK(relative_error(static_cast<double>(base.scale), 1.0) < 0.1);
  // On an even sampling few iterations do.
  CHECK(base_of(sphere(10'000, 1.0, Sampling::kRandom), 0.15).iterations <= 20);
}

TEST_CASE("every sample has a counterpart nearby, on its own side") {
  for (const Surface& surface :
       {sphere(10'000, 1.0, Sampling::kRandom), torus(10'000, 1.0, 0.4, Sampling::kRandom),
        parallel_sheets(50, 0.05, 0.1, Sampling::kJittered)}) {
    constexpr double kScale = 0.15;
    const BaseSurface base = base_of(surface, kScale);
    CHECK(base.position.size() < surface.size());
    CHECK(base.normal.size() == base.position.size());
    CHECK(base.graph.count == base.position.size());
    // Measured 0.149 to 0.150: the planes smooth a little less once the smoothing has drawn Q together.
    CHECK(relative_error(static_cast<double>(base.scale), kScale) < 0.01);
    REQUIRE(base.counterpart.size() == surface.size());
    std::size_t opposed = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
      const std::uint32_t q = base.counterpart[i];
      REQUIRE(q < base.position.size());
      opposed += base.normal[q].dot(surface.normal[i]) <= 0.0F ? 1U : 0U;
      // Half a cell's diagonal, 0.61 scales, and what the smoothing moved.
      CHECK((base.position[q] - surface.position[i]).norm() < 1.5F * static_cast<float>(kScale));
    }
    CHECK(opposed == 0);
    for (std::size_t q = 0; q < base.position.size(); ++q) {
      CHECK(base.normal[q].norm() == doctest::Approx(1.0).epsilon(1e-5));
      for (std::uint32_t j = 0; j < base.graph.k; ++j) {
        CHECK(base.normal[base.graph.index(q, j)].dot(base.normal[q]) > 0.0F);
      }
    }
  }
}

TEST_CASE("a wave in the base is attenuated as by a Gaussian of the scale") {
  // On the heights of the base points: grid, umbrella and least squares together. The sheet lies in the
  // middle of a layer of cells: their boundary along the nodes of the wave would cut the cells there, and
  // only there.
  constexpr double kScale = 4.0;  // spacings
  constexpr std::size_t kSide = 160;
  const Vec3d middle(0.0, 0.0, 0.35 * kScale);
  for (const Sampling sampling : {Sampling::kJittered, Sampling::kRandom}) {
    for (const double periods : {4.0, 5.0, 6.0, 8.0, 12.0}) {
      const double wavelength = periods * kScale;
      const double height = 0.005 * wavelength;
      const Surface surface = wave(kSide, 1.0, sampling, height, wavelength);
      const Decomposition parts = decomposed(surface, base_of(surface, kScale, middle), 1.0);
      double product = 0.0;
      double square = 0.0;
      for (std::size_t i = 0; i < surface.size(); ++i) {
        const Vec3d r = parts.base[i].cast<double>();
        if (r.head<2>().cwiseAbs().maxCoeff() > 0.5 * kSide - 4.0 * kScale) continue;
        const double here = std::sin(kTau * r.x() / wavelength);
        product += here * r.z();
        square += here * here;
      }
      const double attenuation = product / square / height;
      const double expected = std::exp(-0.5 * kTau * kTau / (periods * periods));
      const double effective = wavelength / kTau * std::sqrt(-2.0 * std::log(std::max(attenuation, 1e-9)));
      MESSAGE(std::string(sampling == Sampling::kRandom ? "random" : "jittered")
              << ", wavelength " << periods << " scales: " << attenuation << ", expected " << expected
              << ", effective scale " << effective / kScale);
      CHECK(relative_error(effective, kScale) < 0.02);
      CHECK(parts.fallback == 0);
    }
  }
}

TEST_CASE("the base says what scale it has reached") {
  // More than was asked for where samples are sparse: nothing but the planes over 17 samples smooths there,
  // and they do so by r^2 / 12, r^2 = 17 h^2 / pi, the same for every lesser scale.
  const Surface sparse = sphere(2'000, 1.0, Sampling::kRegular);
  const double spacing = std::sqrt(2.0 * kTau / 2'000.0);
  for (const double scale : {0.1, 0.5}) {  // in spacings
    const double reached = static_cast<double>(base_of(sparse, scale * spacing).scale);
    CHECK(relative_error(reached, spacing * std::sqrt(17.0 / (12.0 * 0.5 * kTau))) < 0.05);
  }
  // Less where a few cells hold the whole object: no Gaussian of 50 fits onto a sheet of 10 by 10, whose
  // samples have a variance of 100 / 12 along each side.
  const BaseSurface small = base_of(plane(40, 0.25, Sampling::kRegular), 50.0);
  CHECK(small.position.size() <= 8);
  CHECK(small.scale > 2.0F);
  CHECK(small.scale < 3.0F);
}

TEST_CASE("the base of a sphere is the sphere that a Gaussian makes of it") {
  // Coordinates are harmonics of degree 1 on the sphere: the heat of time s^2 / 2 takes them to exp(-s^2 /
  // R^2).
  for (const double scale : {0.1, 0.2, 0.3}) {
    const Surface surface = sphere(20'000, 1.0, Sampling::kRegular);
    const Decomposition parts = decomposed(surface, base_of(surface, scale), 0.025);
    double mean = 0.0;
    for (std::size_t i = 0; i < surface.size(); ++i) mean += static_cast<double>(parts.base[i].norm());
    mean /= static_cast<double>(surface.size());
    double square = 0.0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
      square += std::pow(static_cast<double>(parts.base[i].norm()) - mean, 2);
    }
    const double shrink = 1.0 - mean;
    const double expected = 1.0 - std::exp(-scale * scale);
    MESSAGE("scale " << scale << ": shrinks by " << shrink << ", expected " << expected << ", rms unevenness "
                     << std::sqrt(square / static_cast<double>(surface.size())));
    CHECK(relative_error(shrink, expected) < 0.03);
    CHECK(std::sqrt(square / static_cast<double>(surface.size())) < 0.07 * expected);
  }
}

TEST_CASE("sheets closer than the scale do not mix") {
  for (const double gap : {0.3, 0.6, 1.5}) {  // in scales
    CAPTURE(gap);
    constexpr double kScale = 4.0;
    const Surface sheets = parallel_sheets(80, 1.0, gap * kScale, Sampling::kJittered);
    const Decomposition parts = decomposed(sheets, base_of(sheets, kScale), 1.0);
    std::size_t wrong_side = 0;
    double farthest = 0.0;
    for (std::size_t i = 0; i < sheets.size(); ++i) {
      wrong_side += parts.base[i].z() * sheets.position[i].z() <= 0.0F ? 1U : 0U;
      farthest = std::max(farthest, static_cast<double>(std::abs(parts.detail[i])));
    }
    CHECK(wrong_side == 0);
    CHECK(farthest < 1e-3 * kScale);  // both sheets are planes: they are their own bases
    CHECK(parts.flipped == 0);
    CHECK(parts.fallback == 0);
  }
}

TEST_CASE("a plane is its own base, at every scale and up to its border") {
  for (const double scale : {2.0, 8.0}) {
    const Surface flat = plane(80, 1.0, Sampling::kRandom);
    const Decomposition parts = decomposed(flat, base_of(flat, scale), 1.0);
    for (std::size_t i = 0; i < flat.size(); ++i) {
      CHECK(std::abs(parts.detail[i]) < 1e-4F);
      CHECK(parts.normal[i].z() > 1.0F - 1e-6F);
    }
    CHECK(parts.at_limit == 0);
    CHECK(parts.fallback == 0);
  }
}

TEST_CASE("the base means the same at two densities") {
  // Bumps of 0.25 across at a scale of 0.15: the same surface sampled with 8,000 and with 40,000 samples.
  const Bumps bumps{.count = 200, .height = 0.02, .width = 0.08};
  std::vector<Decomposition> parts;
  std::vector<Surface> surfaces{bumpy_sphere(8'000, bumps), bumpy_sphere(40'000, bumps)};
  for (int density = 0; density < 2; ++density) {
    const Surface& surface = surfaces[static_cast<std::size_t>(density)];
    parts.push_back(decomposed(surface, base_of(surface, 0.15), density == 0 ? 0.04 : 0.018));
  }
  // Compare over the nearest sample of the dense cloud.
  const KdTree tree(surfaces[1].position);
  std::vector<Neighbor> found;
  double square = 0.0;
  double detail_square = 0.0;
  for (std::size_t i = 0; i < surfaces[0].size(); ++i) {
    tree.nearest(surfaces[0].position[i], 1, found);
    const double a = static_cast<double>(parts[0].base[i].norm());
    const double b = static_cast<double>(parts[1].base[found[0].index].norm());
    square += (a - b) * (a - b);
    detail_square += static_cast<double>(parts[0].detail[i]) * static_cast<double>(parts[0].detail[i]);
  }
  MESSAGE("bases differ by " << std::sqrt(square / detail_square) << " of the rms detail");
  CHECK(std::sqrt(square / detail_square) < 0.1);
}

TEST_CASE("the grid is fixed in model space") {
  const Surface surface = torus(8'000, 1.0, 0.4, Sampling::kRandom);
  const double scale = 0.125;
  const double cell = 0.7 * static_cast<double>(static_cast<float>(scale));
  const BaseSurface here = base_of(surface, scale);
  const BaseSurface there = base_of(surface, scale, cell * Vec3d(1000.0, -7.0, 3.0));
  CHECK(there.position == here.position);
  CHECK(there.normal == here.normal);
  CHECK(there.counterpart == here.counterpart);
  const BaseSurface between = base_of(surface, scale, cell * Vec3d(0.5, 0.0, 0.0));
  CHECK_FALSE(between.position == here.position);
}

TEST_CASE("a scale below the spacing keeps every sample") {
  const Surface surface = sphere(2'000, 1.0, Sampling::kRegular);  // spacing 0.08
  const BaseSurface base = base_of(surface, 0.002);
  CHECK(base.position.size() == surface.size());
}

TEST_CASE("the base does not depend on the threads") {
  const Surface surface = torus(30'000, 1.0, 0.4, Sampling::kRandom);
  BaseSurface one;
  with_threads(1, [&] { one = base_of(surface, 0.1); });
  for (const int threads : {2, 8}) {
    with_threads(threads, [&] {
      const BaseSurface base = base_of(surface, 0.1);
      CHECK(base.position == one.position);
      CHECK(base.normal == one.normal);
      CHECK(base.graph.lanes == one.graph.lanes);
      CHECK(base.counterpart == one.counterpart);
    });
  }
}

TEST_CASE("a cancelled base says so, and one without a scale is a logic error") {
  const Surface surface = sphere(2'000, 1.0, Sampling::kRegular);
  const ExecutionContext context;
  context.cancel();
  const auto result = build_base_surface(surface.position, surface.normal, Vec3d::Zero(), 0.1F, context);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kCancelled);
  CHECK_THROWS_AS((void)build_base_surface(surface.position, surface.normal, Vec3d::Zero(), 0.0F, {}),
                  LogicError);
}

}  // namespace
}  // namespace pointwright
