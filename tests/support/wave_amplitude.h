#pragma once
// How much of a wave is left.

#include <cmath>
#include <cstddef>

#include "engine/core/points.h"

namespace pointwright::test {

/// Amplitude of sin(2 pi x / wavelength) in the heights z, by least squares, over the samples of the square
/// [-half, half]^2 without a margin along its border.
inline double wave_amplitude(const Points& points, double wavelength, double half, double margin) {
  constexpr double kTau = 6.283185307179586;
  double product = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i].cast<double>();
    if (std::abs(p.x()) > half - margin || std::abs(p.y()) > half - margin) continue;
    const double here = std::sin(kTau * p.x() / wavelength);
    product += here * p.z();
    square += here * here;
  }
  return product / square;
}

}  // namespace pointwright::test
