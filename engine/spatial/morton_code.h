#pragma once
// Morton order: G. M. Morton, "A computer oriented geodetic data base and a new technique in file
// sequencing", 1966.

#include <cstdint>

#include "engine/core/vector.h"

namespace pointwright {

/// Keys of cells, 2^21 along the longest side of a box: 63 bits, of z, y and x in turns. Its leading b bits
/// are the key of a coarser cell: the box, halved b times.
class MortonCode {
 public:
  static constexpr std::uint32_t kBits = 63;

  explicit MortonCode(const Box3f& box) : min_(box.min) {
    const double extent = static_cast<double>((box.max - box.min).maxCoeff());
    scale_ = extent > 0.0 ? 2097151.0 / extent : 0.0;  // 2^21 - 1 cells an axis
  }
  /// Pre: p lies in the box
  [[nodiscard]] std::uint64_t of(const Vec3f& p) const {
    const Vec3d cell = (p - min_).cast<double>() * scale_;
    return spread_bits(static_cast<std::uint64_t>(cell.x())) |
           (spread_bits(static_cast<std::uint64_t>(cell.y())) << 1) |
           (spread_bits(static_cast<std::uint64_t>(cell.z())) << 2);
  }

 private:
  // The low 21 bits, two zero bits behind each.
  static std::uint64_t spread_bits(std::uint64_t v) {
    v &= 0x1fffff;
    v = (v | (v << 32)) & 0x1f00000000ffffULL;
    v = (v | (v << 16)) & 0x1f0000ff0000ffULL;
    v = (v | (v << 8)) & 0x100f00f00f00f00fULL;
    v = (v | (v << 4)) & 0x10c30c30c30c30c3ULL;
    v = (v | (v << 2)) & 0x1249249249249249ULL;
    return v;
  }

  Vec3f min_;
  double scale_ = 0.0;
};

}  // namespace pointwright
