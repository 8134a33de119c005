#include "engine/resampling/carried_sampling.h"

#include <algorithm>

#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"
#include "engine/multires/normal_stencil.h"
#include "engine/resampling/cells.h"

namespace pointwright {

std::vector<std::uint32_t> moving_blocks(const ScaleField& field) {
  std::vector<std::uint8_t> moves(padded_to_block(field.size()) / kSimdBlock);
  parallel_for(
      moves.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
          const auto first = field.t.begin() + static_cast<std::ptrdiff_t>(b * kSimdBlock);
          moves[b] = std::any_of(first, first + kSimdBlock, [](float t) { return t > 0.0F; }) ? 1 : 0;
        }
      },
      kParallelBlock / kSimdBlock);
  std::vector<std::uint32_t> blocks;
  for (std::size_t b = 0; b < moves.size(); ++b)
    if (moves[b] != 0) blocks.push_back(static_cast<std::uint32_t>(b));
  return blocks;
}

std::shared_ptr<const Sampling> carried_sampling(const std::shared_ptr<const Sampling>& sampling,
                                                 const MultiresSurface& surface, const EditParams& params,
                                                 const ScaleField& field) {
  if (sampling->cell_u.empty()) return sampling;
  const Level& level = surface.levels[params.level];
  const std::vector<std::uint32_t> blocks = moving_blocks(field);
  ShapeOperators shape;
  if (needs_shape_operators(params.deformation))
    shape = shape_operators(level, NormalStencil(level, *sampling->graph, blocks));
  const Cells rest = cells_on_level(*sampling, level.normal, blocks);
  MappedCells mapped = map_cells(to_deform_map(params.deformation, sampling->cloud->origin), blocks, field,
                                 level, rest, shape.size() > 0 ? &shape : nullptr);
  auto carried = std::make_shared<Sampling>(*sampling);
  carried->cell_u = std::move(mapped.cells.u);
  carried->cell_v = std::move(mapped.cells.v);
  return carried;
}

}  // namespace pointwright
