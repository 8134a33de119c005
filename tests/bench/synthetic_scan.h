#pragma once
// Synthetic scans of any size: deterministic, with detail at several scales, in random order like a scanner's
// merge.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/cloud.h"

namespace pointwright::bench {

/// The surface of the synthetic scan over the torus' two angles, u around its axis.
Vec3d scan_surface(double u, double v);

/// N samples of a torus (radii 1 and 0.4) with bumps of three wavelengths, sampled evenly by area with random
/// positions, in random order. The same bytes on every machine.
/// Pre:  n <= 2^32 - 1
/// Cost: O(N)
Cloud synthetic_scan(std::size_t n, std::uint64_t seed = 1);

/// The same samples, bit for bit, as a binary PLY of positions, piece by piece, however many. Returns whether
/// it could be written.
[[nodiscard]] bool write_synthetic_scan(const std::string& path, std::uint64_t n, std::uint64_t seed = 1);

/// Scales of the three bands that sessions and frames are measured with.
inline const std::vector<float> kThreeScales{0.04F, 0.02F, 0.01F};

/// The scan as an importer leaves it: in coherent order.
Cloud ordered_scan(std::size_t n);

}  // namespace pointwright::bench
