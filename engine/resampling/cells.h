#pragma once
// The tangent vectors u and v of §5.1 on every sample, and how far a deformation stretches them.

#include <cstdint>
#include <vector>

#include "engine/core/points.h"
#include "engine/editing/deformation_kernels.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/sampling.h"
#include "engine/multires/shape_operator.h"

namespace pointwright {

/// The sides of each sample's cell, in units of its spacing: N vectors each.
struct Cells {
  Points u, v;
};

/// A side without its part along the unit normal, as long as it was; nothing where it stands upright.
Vec3f turned_into_plane(const Vec3f& side, const Vec3f& normal);

/// The cells that the sampling carries, each side turned into the tangent plane of the level's normal with
/// its length kept, where samples are in `blocks`; unit squares in the tangent frames where it carries none.
/// Cost: O(N), parallel
Cells cells_on_level(const Sampling& sampling, const Points& normal,
                     const std::vector<std::uint32_t>& blocks);

/// What a deformation makes of the samples of some blocks.
struct MappedCells {
  Points position;  ///< F(p, t)
  Cells cells;      ///< J u, J v
};
/// Samples of other blocks stay as they are.
/// Paper:       Eq. (13)
/// Pre:         as deform()
/// Cost:        O(N), vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
MappedCells map_cells(const DeformMap& map, const std::vector<std::uint32_t>& blocks, const ScaleField& field,
                      const Level& level, const Cells& cells, const ShapeOperators* shape);

/// The first fundamental form of a cell, diagonalised (§5.1): (u, v) (cosine, sine) is its longest diameter's
/// half, orthogonal to (u, v) (-sine, cosine).
struct PrincipalStretch {
  float major = 1.0F;  ///< the square roots of the eigenvalues, in units of the spacing
  float minor = 1.0F;
  float cosine = 1.0F;  ///< of the major axis, in the basis of the sides
  float sine = 0.0F;
};
PrincipalStretch principal_stretch(const Vec3f& u, const Vec3f& v);

/// What viewers show of the cells, by sample; all of them 1 where the sampling carries no cells.
struct StretchColumns {
  std::vector<float> major;       ///< larger principal stretch
  std::vector<float> minor;       ///< smaller one
  std::vector<float> anisotropy;  ///< major / minor, at most 1e6
  std::vector<float> area;        ///< major * minor, finite: times the area has grown
};
/// Cost: O(N), parallel.
StretchColumns stretch_columns(const Sampling& sampling);
/// The direction of the larger principal stretch, by sample: unit vectors whose longest component is
/// positive; zero where neither axis is longer by a thousandth, and where the sampling carries no cells.
/// Cost: O(N), parallel.
Points stretch_directions(const Sampling& sampling);

}  // namespace pointwright
