#pragma once
// One edit: deform level k, put the detail back (§4, Eq. 5).

#include <cstdint>

#include "engine/core/result.h"
#include "engine/editing/deformation.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/surface.h"

namespace pointwright {

/// What a drag changes from frame to frame; the regions stand still meanwhile.
struct EditParams {
  std::uint32_t level = 0;  ///< the level k that F moves; band_count() means single-resolution editing
  Blend blend = Blend::kQuartic;
  Deformation deformation;

  friend bool operator==(const EditParams&, const EditParams&) = default;
};

/// Errors: those of the deformation; kInvalidArgument for a level beyond the surface's.
Result<void> validate(const EditParams& params, const MultiresSurface& surface);

/// Deforms level k with the field (computed on that level) and rebuilds the finer ones from their detail
/// coefficients: p' = p + (r' - r) + d (n' - n), which is Eq. (5) written so that an unmoved sample keeps its
/// bits. Levels coarser than k are returned as they were; the session re-derives them when next needed.
/// Normals:     on level k those of the deformed surface, cofactor(J) n, exactly. On finer levels, by the
///              one-band rule, the sample's own normal is carried by the same Jacobian, that of level k's map
///              at the sample. It is exact for the identity and for rigid motions, and neglects how the bend
///              varies along the detail.
/// Promises:    t = 0 samples bit-identical on every level; a zero deformation is the identity, to the bit;
///              a rigid motion of everything is reproduced to 1e-6 of the diagonal
/// Pre:         valid parameters, finite input. Never gives NaN
/// Cost:        O(N) per level in one parallel, vectorised pass; samples with t = 0 are only copied
/// Determinism: bitwise equal for any thread count and instruction set
MultiresSurface apply_edit(const MultiresSurface& surface, const EditParams& params, const ScaleField& field,
                           const Vec3d& origin);

/// The same into a surface whose memory is reused, whatever it held: what a drag calls on every frame. The
/// result may not be `surface` itself.
void apply_edit(const MultiresSurface& surface, const EditParams& params, const ScaleField& field,
                const Vec3d& origin, MultiresSurface& edited);

}  // namespace pointwright
