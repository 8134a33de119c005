#include "tests/bench/synthetic_scan.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
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

// Even by area.
Vec3f next_sample(Random& random) {
  constexpr double kTwoPi = 2.0 * std::numbers::pi;
  while (true) {
    const double u = kTwoPi * random.uniform();
    const double v = kTwoPi * random.uniform();
    if (random.uniform() * (1.0 + kMinor) <= 1.0 + kMinor * std::cos(v))
      return scan_surface(u, v).cast<float>();
  }
}

}  // namespace

Vec3d scan_surface(double u, double v) {
  const double bump = 0.01 * std::sin(9 * u) * std::sin(7 * v) + 0.003 * std::sin(41 * u + 3 * v) +
                      0.001 * std::sin(150 * u) * std::cos(90 * v);
  const double minor = kMinor + bump;
  const double ring = 1.0 + minor * std::cos(v);
  return {ring * std::cos(u), ring * std::sin(u), minor * std::sin(v)};
}

Cloud synthetic_scan(std::size_t n, std::uint64_t seed) {
  Cloud cloud;
  cloud.position.resize(n);
  cloud.id.resize(n);
  std::iota(cloud.id.begin(), cloud.id.end(), 0U);
  Random random(seed);
  for (std::size_t i = 0; i < n; ++i) cloud.position.set(i, next_sample(random));
  return cloud;
}

bool write_synthetic_scan(const std::string& path, std::uint64_t n, std::uint64_t seed) {
  static_assert(std::endian::native == std::endian::little);
  constexpr std::uint64_t kPiece = 1U << 16U;
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << n
      << "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  Random random(seed);
  std::vector<float> piece;
  for (std::uint64_t done = 0; done < n; done += kPiece) {
    piece.clear();
    for (std::uint64_t i = done; i < std::min(n, done + kPiece); ++i) {
      const Vec3f p = next_sample(random);
      piece.insert(piece.end(), {p.x(), p.y(), p.z()});
    }
    out.write(reinterpret_cast<const char*>(piece.data()),
              static_cast<std::streamsize>(piece.size() * sizeof(float)));
  }
  return static_cast<bool>(out.flush());
}

Cloud ordered_scan(std::size_t n) {
  const Cloud scan = synthetic_scan(n);
  return permuted(scan, coherent_order(scan.position));
}

}  // namespace pointwright::bench
