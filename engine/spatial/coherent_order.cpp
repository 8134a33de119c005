// Morton order: G. M. Morton, "A computer oriented geodetic data base and a new technique in file
// sequencing", 1966.
#include "engine/spatial/coherent_order.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Spreads the low 21 bits so that two zero bits follow each.
std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | (v << 32)) & 0x1f00000000ffffULL;
  v = (v | (v << 16)) & 0x1f0000ff0000ffULL;
  v = (v | (v << 8)) & 0x100f00f00f00f00fULL;
  v = (v | (v << 4)) & 0x10c30c30c30c30c3ULL;
  v = (v | (v << 2)) & 0x1249249249249249ULL;
  return v;
}

}  // namespace

std::vector<std::uint32_t> coherent_order(const Points& points) {
  const std::size_t n = points.size();
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0U);
  if (n < 2) return order;
  const Box3f box = bounds_of(points);
  const double extent = static_cast<double>((box.max - box.min).maxCoeff());
  const double scale = extent > 0.0 ? 2097151.0 / extent : 0.0;  // 2^21 - 1 cells an axis
  std::vector<std::uint64_t> keys(n);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d cell = (points[i] - box.min).cast<double>() * scale;
      keys[i] = spread_bits(static_cast<std::uint64_t>(cell.x())) |
                (spread_bits(static_cast<std::uint64_t>(cell.y())) << 1) |
                (spread_bits(static_cast<std::uint64_t>(cell.z())) << 2);
    }
  });
  sort_by_key(keys, order);
  const auto by_position = [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple(points.x()[a], points.y()[a], points.z()[a], a) <
           std::tuple(points.x()[b], points.y()[b], points.z()[b], b);
  };
  for (std::size_t begin = 0; begin < n;) {
    std::size_t end = begin + 1;
    while (end < n && keys[end] == keys[begin]) ++end;
    if (end - begin > 1) {
      std::sort(order.begin() + static_cast<std::ptrdiff_t>(begin),
                order.begin() + static_cast<std::ptrdiff_t>(end), by_position);
    }
    begin = end;
  }
  return order;
}

}  // namespace pointwright
