#include "engine/resampling/cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"

namespace pointwright {
namespace {

constexpr std::size_t kBlocksOfRange = kParallelBlock / kSimdBlock;
constexpr float kGreatestAnisotropy = 1e6F;
// Sides beyond these have fourth powers that overflow or vanish.
constexpr float kLongSide = 0x1p24F;
constexpr float kShortSide = 0x1p-24F;

PrincipalStretch stretch_of_sides(const Vec3f& u, const Vec3f& v) {
  const float uu = u.squaredNorm();
  const float uv = u.dot(v);
  const float vv = v.squaredNorm();
  const float mean = 0.5F * (uu + vv);
  const float half = 0.5F * (uu - vv);
  const float radius = std::sqrt(half * half + uv * uv);
  PrincipalStretch stretch;
  stretch.major = std::sqrt(mean + radius);
  // |u x v| = major * minor: the difference of two close eigenvalues would lose it.
  stretch.minor = stretch.major > 0.0F ? u.cross(v).norm() / stretch.major : 0.0F;
  const float c = half >= 0.0F ? half + radius : std::abs(uv);
  const float s = half >= 0.0F ? uv : std::copysign(radius - half, uv);
  const float length = std::sqrt(c * c + s * s);
  if (length > 0.0F) {
    stretch.cosine = c / length;
    stretch.sine = s / length;
  }
  return stretch;
}

}  // namespace

Vec3f turned_into_plane(const Vec3f& side, const Vec3f& normal) {
  const Vec3f along = side - side.dot(normal) * normal;
  const float length = along.stableNorm();
  return length > 0.0F ? Vec3f(side.stableNorm() / length * along) : Vec3f::Zero();
}

Cells cells_on_level(const Sampling& sampling, const Points& normal,
                     const std::vector<std::uint32_t>& blocks) {
  const std::size_t n = normal.size();
  POINTWRIGHT_CHECK(sampling.size() == n, "normals of the sampling's samples");
  Cells cells{.u = sampling.cell_u, .v = sampling.cell_v};
  if (cells.u.empty()) {
    cells = {.u = Points(n), .v = Points(n)};
    parallel_for(n, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const TangentFrame frame = tangent_frame(normal[i].cast<double>());
        cells.u.set(i, frame.u.cast<float>());
        cells.v.set(i, frame.v.cast<float>());
      }
    });
    return cells;
  }
  parallel_for(
      blocks.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t entry = begin; entry < end; ++entry) {
          const std::size_t first = std::size_t{blocks[entry]} * kSimdBlock;
          for (std::size_t i = first; i < std::min(first + kSimdBlock, n); ++i) {
            cells.u.set(i, turned_into_plane(cells.u[i], normal[i]));
            cells.v.set(i, turned_into_plane(cells.v[i], normal[i]));
          }
        }
      },
      kBlocksOfRange);
  return cells;
}

MappedCells map_cells(const DeformMap& map, const std::vector<std::uint32_t>& blocks, const ScaleField& field,
                      const Level& level, const Cells& cells, const ShapeOperators* shape) {
  MappedCells mapped{.position = level.position, .cells = cells};
  Level deformed{.position = std::move(mapped.position), .normal = Points(level.normal.size())};
  CellArgs args{.deform = deform_args(map, blocks, field, level, deformed, shape),
                .cell_u = {cells.u.x(), cells.u.y(), cells.u.z()},
                .cell_v = {cells.v.x(), cells.v.y(), cells.v.z()},
                .mapped_u = {mapped.cells.u.x(), mapped.cells.u.y(), mapped.cells.u.z()},
                .mapped_v = {mapped.cells.v.x(), mapped.cells.v.y(), mapped.cells.v.z()}};
  const auto kernel = POINTWRIGHT_KERNEL(deform_cells);
  parallel_for(
      blocks.size(), [&](std::size_t begin, std::size_t end) { kernel(args, begin, end); }, kBlocksOfRange);
  mapped.position = std::move(deformed.position);
  return mapped;
}

PrincipalStretch principal_stretch(const Vec3f& u, const Vec3f& v) {
  const float longest = std::max(u.cwiseAbs().maxCoeff(), v.cwiseAbs().maxCoeff());
  const bool extreme = longest > kLongSide || (longest > 0.0F && longest < kShortSide);
  if (!extreme || !std::isfinite(longest)) return stretch_of_sides(u, v);
  int exponent = 0;
  (void)std::frexp(longest, &exponent);
  exponent = std::max(exponent, -120);              // its opposite is one of floats, too
  const float scale = std::ldexp(1.0F, -exponent);  // a power of two rounds nothing
  PrincipalStretch stretch = stretch_of_sides(scale * u, scale * v);
  stretch.major = std::ldexp(stretch.major, exponent);
  stretch.minor = std::ldexp(stretch.minor, exponent);
  return stretch;
}

StretchColumns stretch_columns(const Sampling& sampling) {
  const std::size_t n = sampling.size();
  StretchColumns columns{.major = std::vector<float>(n, 1.0F),
                         .minor = std::vector<float>(n, 1.0F),
                         .anisotropy = std::vector<float>(n, 1.0F),
                         .area = std::vector<float>(n, 1.0F)};
  if (sampling.cell_u.empty()) return columns;
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const PrincipalStretch stretch = principal_stretch(sampling.cell_u[i], sampling.cell_v[i]);
      columns.major[i] = stretch.major;
      columns.minor[i] = stretch.minor;
      columns.area[i] = std::min(stretch.major * stretch.minor, std::numeric_limits<float>::max());
      columns.anisotropy[i] = stretch.minor * kGreatestAnisotropy > stretch.major
                                  ? stretch.major / stretch.minor
                                  : kGreatestAnisotropy;
    }
  });
  return columns;
}

Points stretch_directions(const Sampling& sampling) {
  constexpr float kRound = 1.001F;  // a rounder cell has no direction
  Points directions(sampling.size());
  for (float* column : {directions.x(), directions.y(), directions.z()})
    std::fill_n(column, directions.size(), 0.0F);
  if (sampling.cell_u.empty()) return directions;
  parallel_for(sampling.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f u = sampling.cell_u[i];
      const Vec3f v = sampling.cell_v[i];
      const PrincipalStretch stretch = principal_stretch(u, v);
      if (!(stretch.major > kRound * stretch.minor)) continue;
      Vec3f axis = (stretch.cosine * u + stretch.sine * v).stableNormalized();
      Eigen::Index longest = 0;
      axis.cwiseAbs().maxCoeff(&longest);
      if (axis[longest] < 0.0F) axis = -axis;
      directions.set(i, axis);
    }
  });
  return directions;
}

}  // namespace pointwright
