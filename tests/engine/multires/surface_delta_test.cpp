#include "engine/multires/surface_delta.h"

#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/support/all_machines.h"
#include "tests/support/random_points.h"

namespace pointwright {
namespace {

using namespace test;

MultiresSurface random_surface(std::size_t samples, std::size_t bands, std::uint64_t seed) {
  MultiresSurface surface;
  for (std::size_t k = 0; k <= bands; ++k)
    surface.levels.push_back({.position = random_points(samples, seed + 2 * k),
                              .normal = random_points(samples, seed + 2 * k + 1)});
  Random random(seed + 100);
  for (std::size_t k = 0; k < bands; ++k) {
    surface.detail.emplace_back(samples);
    for (float& detail : surface.detail.back()) detail = static_cast<float>(random.normal());
  }
  return surface;
}

/// Every bit of a surface, padding included.
std::vector<std::uint32_t> bits_of(const MultiresSurface& surface) {
  std::vector<std::uint32_t> bits;
  const auto append = [&](const float* column, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) bits.push_back(std::bit_cast<std::uint32_t>(column[i]));
  };
  for (const Level& level : surface.levels)
    for (const Points* points : {&level.position, &level.normal})
      for (const float* column : {points->x(), points->y(), points->z()})
        append(column, padded_to_block(points->size()));
  for (const auto& detail : surface.detail) append(detail.data(), detail.size());
  return bits;
}

void check_both_ways(const MultiresSurface& a, const MultiresSurface& b) {
  const SurfaceDelta delta(a, b);
  MultiresSurface surface = a;
  delta.apply(surface);
  CHECK(bits_of(surface) == bits_of(b));
  delta.apply(surface);
  CHECK(bits_of(surface) == bits_of(a));
}

TEST_CASE("a delta leads from either surface to the other, for any number of samples") {
  for (const std::size_t samples : {0U, 1U, 2U, 15U, 16U, 17U, 1023U, 1024U, 1025U, 5000U})
    for (const std::size_t bands : {0U, 1U, 3U})
      check_both_ways(random_surface(samples, bands, 1), random_surface(samples, bands, 50));
}

/// The surface with the same columns for the first `samples` samples; what its padding holds is arbitrary.
MultiresSurface first_of(const MultiresSurface& surface, std::size_t samples) {
  MultiresSurface first = surface;
  for (Level& level : first.levels) {
    level.position.resize(samples);
    level.normal.resize(samples);
  }
  for (auto& detail : first.detail) detail.resize(samples);
  return first;
}

TEST_CASE("one of the two surfaces may have further samples") {
  for (const std::size_t samples : {0U, 1U, 15U, 16U, 17U, 1024U, 1025U}) {
    for (const std::size_t further : {1U, 15U, 16U, 33U, 3000U}) {
      CAPTURE(samples);
      CAPTURE(further);
      const MultiresSurface large = random_surface(samples + further, 2, 7);
      check_both_ways(random_surface(samples, 2, 60), large);
      check_both_ways(large, random_surface(samples, 2, 60));
      const SurfaceDelta delta(first_of(large, samples), large);
      CHECK(delta.blocks() == 0);
      CHECK_FALSE(delta.empty());
      CHECK(delta.further_samples() == further);
      CHECK(delta.memory() >= 20 * sizeof(float) * further);
    }
  }
}

TEST_CASE("a surface of other samples is noticed") {
  const MultiresSurface small = random_surface(20, 1, 3);
  const SurfaceDelta delta(small, random_surface(30, 1, 3));
  MultiresSurface other = random_surface(25, 1, 3);
  CHECK_THROWS_AS(delta.apply(other), LogicError);
  CHECK_THROWS_AS(SurfaceDelta(small, random_surface(30, 2, 3)), LogicError);
}

TEST_CASE("a delta holds the blocks that differ and nothing else") {
  const MultiresSurface a = random_surface(10'000, 2, 3);
  CHECK(SurfaceDelta(a, a).empty());
  CHECK(SurfaceDelta(a, a).memory() < 2000);
  MultiresSurface b = a;
  b.levels[1].position.set(33, Vec3f(7, 8, 9));  // three columns, block 2
  b.levels[2].normal.x()[9999] = 5.0F;           // the last block
  b.detail[0][9998] = 4.0F;                      // the last block, which is not whole
  b.detail[0][16] = 4.0F;                        // block 1
  const SurfaceDelta delta(a, b);
  CHECK(delta.blocks() == 6);
  CHECK_FALSE(delta.empty());
  CHECK(delta.memory() < 6 * 64 + 10 * 200 + 2000);
  check_both_ways(a, b);
}

TEST_CASE("bits count, not values") {
  const MultiresSurface a = random_surface(20, 1, 4);
  MultiresSurface b = a;
  MultiresSurface c = a;
  b.levels[0].position.x()[3] = 0.0F;
  c.levels[0].position.x()[3] = -0.0F;
  CHECK(SurfaceDelta(b, c).blocks() == 1);
  b.detail[0][3] = std::numeric_limits<float>::quiet_NaN();
  c.detail[0][3] = -std::numeric_limits<float>::quiet_NaN();
  b.levels[1].normal.z()[31] = 1.0F;  // of the padding
  check_both_ways(b, c);
  b = c;
  CHECK(SurfaceDelta(b, c).empty());  // a NaN is itself
}

TEST_CASE("a chain of deltas leads back to its start in any order of steps") {
  const MultiresSurface a = random_surface(3000, 1, 5);
  MultiresSurface b = a;
  MultiresSurface c = a;
  for (std::size_t i = 0; i < 500; ++i) b.levels[1].position.x()[i] += 1.0F;
  c = b;
  for (std::size_t i = 400; i < 900; ++i) c.levels[1].position.x()[i] *= 0.5F;
  const SurfaceDelta ab(a, b);
  const SurfaceDelta bc(b, c);
  MultiresSurface surface = c;
  bc.apply(surface);
  CHECK(bits_of(surface) == bits_of(b));
  ab.apply(surface);
  CHECK(bits_of(surface) == bits_of(a));
}

TEST_CASE("a surface that is neither is noticed") {
  const MultiresSurface a = random_surface(3000, 1, 6);
  const MultiresSurface b = random_surface(3000, 1, 60);
  const SurfaceDelta delta(a, b);
  MultiresSurface other = a;
  other.levels[0].position.y()[2000] = std::nextafter(other.levels[0].position.y()[2000], 9.0F);
  CHECK_THROWS_AS(delta.apply(other), LogicError);
  MultiresSurface exchanged = a;
  std::swap(exchanged.levels[0], exchanged.levels[1]);
  CHECK_THROWS_AS(delta.apply(exchanged), LogicError);
  MultiresSurface fewer = random_surface(100, 1, 6);
  CHECK_THROWS_AS(delta.apply(fewer), LogicError);
  MultiresSurface banded = random_surface(3000, 2, 6);
  CHECK_THROWS_AS(delta.apply(banded), LogicError);
  CHECK_THROWS_AS(SurfaceDelta(a, banded), LogicError);
}

TEST_CASE("the same delta for any number of threads") {
  const MultiresSurface a = random_surface(30'000, 1, 7);
  MultiresSurface b = a;
  for (std::size_t i = 3; i < 30'000; i += 97) b.levels[1].normal.y()[i] += 1.0F;
  for_all_machines([&] { return SurfaceDelta(a, b); },
                   [](const SurfaceDelta& first, const SurfaceDelta& other) { CHECK(first == other); });
}

}  // namespace
}  // namespace pointwright
