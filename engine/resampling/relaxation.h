#pragma once
// Linear repulsion of inserted samples in the deformed tangent plane (§5.2), with the state at rest.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/deformation_kernels.h"
#include "engine/editing/region.h"
#include "engine/editing/scale_field.h"
#include "engine/resampling/splitting.h"

namespace pointwright {

/// What children move over and among.
struct RelaxationScene {
  const DeformMap& map;
  const RegionPair& regions;
  Blend blend;
  const Splits& splits;
  const RestPatches& patches;
  const Sampling& sampling;
  const Cells& rest;                         ///< cells of the samples that were there before
  const Points& rest_position;               ///< of these, on the edited level
  const Points& deformed;                    ///< F of them: they stay
  const std::vector<std::uint32_t>& blocks;  ///< those of kSimdBlock samples that F may have moved
  const ResamplingParams& params;
  float coarser;  ///< of wanted_spacing()
};

/// Memory that the frames of a drag hand on. Of one surface and its blocks.
struct RelaxationMemory {
  Points places;                        ///< of the samples that were there before, then of children
  std::vector<std::uint32_t> split_of;  ///< by sample: its split, or none
};

/// Moves children apart: Jacobi sweeps of repulsion among the families of each child's parent and of its
/// neighbours at rest, so neighbourhoods are never searched for in space and sheets that touch never mix. A
/// displacement is taken back to rest space by (U^T U)^-1 U^T, U = J E; F and U are evaluated anew every four
/// sweeps. Nobody goes farther than two thirds of a cell from where it was born, or over the border of the
/// surface.
/// Paper:       §5.2; in rest space (engine/README.md says why)
/// Cost:        O(C) a sweep, vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between sweeps; positions are then valid but not relaxed
void relax(const RelaxationScene& scene, std::uint32_t sweeps, Births& births, RelaxationMemory& memory,
           const ExecutionContext* context = nullptr);

}  // namespace pointwright
