#pragma once
// Points that fill a volume.

#include <cstddef>
#include <cstdint>

#include "tests/support/surfaces.h"

namespace pointwright::test {

/// Uniform in [-1, 1]^3, in the order of the generator.
inline Points random_points(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Points points(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d p{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)};
    points.set(i, p.cast<float>());
  }
  return points;
}

/// The same in coherent order.
inline Points coherent_random_points(std::size_t count, std::uint64_t seed) {
  return coherent(random_points(count, seed));
}

}  // namespace pointwright::test
