#include "tests/bench/synthetic_scan.h"

#include <cmath>
#include <numbers>
#include <numeric>

#include "engine/spatial/coherent_order.h"

namespace pointwright::bench {
namespace {

// SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  double uniform() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1.0p-53;
  }

 private:
  std::uint64_t state_;
};

constexpr double kMinor = 0.4;

}  // namespace

Vec3d scan_surface(double u, double v) {
  const double bump = 0.01 * std::sin(9 * u) * std::sin(7 * v) + 0.003 * std::sin(41 * u + 3 * v) +
                      0.001 * std::sin(150 * u) * std::cos(90 * v);
  const double minor = kMinor + bump;
  const double ring = 1.0 + minor * std::cos(v);
  return {ring * std::cos(u), ring * std::sin(u), minor * std::sin(v)};
}

Cloud synthetic_scan(std::size_t n, std::uint64_t seed) {
  constexpr double kTwoPi = 2.0 * std::numbers::pi;
  Cloud cloud;
  cloud.position.resize(n);
  cloud.id.resize(n);
  std::iota(cloud.id.begin(), cloud.id.end(), 0U);
  Random random(seed);
  for (std::size_t i = 0; i < n;) {
    const double u = kTwoPi * random.uniform();
    const double v = kTwoPi * random.uniform();
    if (random.uniform() * (1.0 + kMinor) > 1.0 + kMinor * std::cos(v)) continue;  // even by area
    cloud.position.set(i++, scan_surface(u, v).cast<float>());
  }
  return cloud;
}

Cloud ordered_scan(std::size_t n) {
  const Cloud scan = synthetic_scan(n);
  return permuted(scan, coherent_order(scan.position));
}

}  // namespace pointwright::bench
