#pragma once
// The surface at rest with the inserted samples in it, on all levels: what an edit then deforms.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/editing/region.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"
#include "engine/resampling/cells.h"
#include "engine/resampling/interpolation.h"
#include "engine/resampling/splitting.h"

namespace pointwright {

/// Children at rest, and what they take from whom.
struct Inserted {
  const Splits& splits;
  const RestPatches& patches;
  const Births& births;
  const std::vector<ZombieWeights>& weights;

  [[nodiscard]] std::size_t count() const { return births.x.size(); }
  [[nodiscard]] const Split& split(std::size_t child) const { return splits.splits[births.split[child]]; }
};

/// Appends the children to every level: on the edited one where they stand on their patches, on the others by
/// their interpolated detail over their interpolated normals, so that Eq. (5) holds for them too.
/// Cost: O(N + C) a level, parallel
void append_children(const Inserted& inserted, std::uint32_t level, MultiresSurface& surface);

/// Appends t and its gradient at the children: those of the regions, exactly.
void append_children(const Points& position, const RegionPair& regions, Blend blend, ScaleField& field);

/// Appends rows of the children: the nearest of the samples that there were before, at rest.
void append_children(const Inserted& inserted, NeighborGraph& graph);

/// Divides the mapped cells of the samples that split along their principal axes, and appends those of the
/// children: their parents' parts at rest, turned into their own tangent planes and mapped where they are.
/// Shapes: `rest` and `cells` (mapped) of the samples before; `field`, `level` and `shape`, which may be null
///         as in deform(), of all
/// Cost:   O(C), parallel
void divide_cells(const Inserted& inserted, const Cells& rest, const DeformMap& map, const ScaleField& field,
                  const Level& level, const ShapeOperators* shape, Cells& cells);

/// The cloud with the children's attributes, ids from `next_id` on, and their places as `surface` has them.
/// Cost: a copy of the cloud
Cloud with_children(const Inserted& inserted, const Cloud& cloud, const Level& finest, std::uint32_t next_id);

}  // namespace pointwright
