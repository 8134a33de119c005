#include "engine/core/simd.h"

#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "engine/core/simd_dispatch.h"
#include "tests/editing/simd_test_kernels.h"

namespace pointwright {
namespace {

constexpr std::size_t kCount = 1 << 16;

struct ProbeData {
  std::vector<float> a, b, out;
  std::vector<std::uint32_t> index;

  ProbeData() : a(kCount), b(kCount), out(kCount * kSimdProbeColumns), index(kCount) {
    std::mt19937 random(17);
    std::uniform_real_distribution<float> angle(-628.5F, 628.5F);
    std::uniform_real_distribution<float> exponent(-90.0F, 90.0F);
    for (std::size_t i = 0; i < kCount; ++i) {
      a[i] = angle(random);
      b[i] = exponent(random);
      index[i] = random() % kCount;
    }
    for (int q = -400; q <= 400; ++q) {  // around the quarter turns
      const auto i = static_cast<std::size_t>(q + 400) * 3;
      const float x = static_cast<float>(q * 1.5707963267948966);
      a[i] = x;
      a[i + 1] = std::nextafter(x, 1e9F);
      a[i + 2] = std::nextafter(x, -1e9F);
    }
    a[3000] = 0.0F;
    a[3001] = -0.0F;
    b[3002] = 0.0F;
    b[3003] = 1e30F;
    b[3004] = -1e30F;
    b[3005] = std::numeric_limits<float>::infinity();
    b[3006] = std::numeric_limits<float>::quiet_NaN();
  }
  void run() {
    probe_simd_of_level()(
        SimdProbe{.a = a.data(), .b = b.data(), .index = index.data(), .out = out.data(), .count = kCount});
  }
  static void (*probe_simd_of_level())(const SimdProbe&) { return POINTWRIGHT_KERNEL(probe_simd); }
  float column(std::size_t c, std::size_t i) const { return out[c * kCount + i]; }
};

TEST_CASE("vector operations agree with scalar arithmetic") {
  ProbeData data;
  data.run();
  double sin_error = 0.0;
  double cos_error = 0.0;
  double exp_error = 0.0;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const float a = data.a[i];
    const float b = data.b[i];
    if (std::isnan(b)) continue;
    wrong += data.column(0, i) != a + b;
    wrong += data.column(1, i) != a * b;
    wrong += b != 0.0F && data.column(2, i) != a / b;
    wrong += data.column(3, i) != std::sqrt(std::abs(a));
    wrong += data.column(4, i) != std::min(a, b);
    wrong += data.column(5, i) != std::max(a, b);
    wrong += data.column(6, i) != (a < b ? a : b);
    wrong += data.column(7, i) != data.a[data.index[i]];
    wrong += data.column(8, i) != std::nearbyint(a);
    wrong += data.column(9, i) != std::floor(a);
    wrong += data.column(10, i) != std::copysign(a, b);
    wrong += data.column(15, i) != 1.0F;
    wrong += std::bit_cast<std::uint32_t>(data.column(16, i)) != data.index[data.index[i]];
    sin_error = std::max(sin_error, std::abs(data.column(11, i) - std::sin(double{a})));
    cos_error = std::max(cos_error, std::abs(data.column(12, i) - std::cos(double{a})));
    if (std::abs(b) < 87.0F) {
      const double truth = std::exp(double{b});
      exp_error = std::max(exp_error, std::abs(data.column(13, i) - truth) / truth);
    }
  }
  CHECK(wrong == 0);
  CHECK(sin_error < 2e-7);
  CHECK(cos_error < 2e-7);
  CHECK(exp_error < 2e-7);
  CHECK(data.column(11, 3000) == 0.0F);
  CHECK(data.column(12, 3000) == 1.0F);
  CHECK(data.column(13, 3002) == 1.0F);
  CHECK(data.column(13, 3003) == std::numeric_limits<float>::infinity());
  CHECK(data.column(13, 3004) == 0.0F);
  CHECK(data.column(13, 3005) == std::numeric_limits<float>::infinity());
  CHECK(std::isnan(data.column(13, 3006)));
}

TEST_CASE("every instruction set computes the same bytes") {
  const SimdLevel before = simd_level();
  set_simd_level(SimdLevel::kBase);
  ProbeData reference;
  reference.run();
  for (const SimdLevel level : {SimdLevel::kV3, SimdLevel::kV4}) {
    set_simd_level(level);
    if (simd_level() != level) continue;  // beyond this machine
    ProbeData data;
    data.run();
    // All but the iota column, which counts lanes; that one agrees modulo the narrowest width only.
    for (std::size_t c = 0; c < kSimdProbeColumns; ++c) {
      if (c == 14) continue;
      CAPTURE(c);
      CHECK(std::memcmp(&data.out[c * kCount], &reference.out[c * kCount], kCount * sizeof(float)) == 0);
    }
  }
  set_simd_level(before);
}

TEST_CASE("a level beyond the machine's becomes the machine's best") {
  const SimdLevel before = simd_level();
  CHECK(before == best_simd_level());
  set_simd_level(SimdLevel::kV4);
  CHECK(simd_level() <= best_simd_level());
  set_simd_level(SimdLevel::kBase);
  CHECK(simd_level() == SimdLevel::kBase);
  set_simd_level(before);
}

}  // namespace
}  // namespace pointwright
