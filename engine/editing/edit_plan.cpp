#include "engine/editing/edit_plan.h"

#include <algorithm>

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

bool has_gains(const EditParams& params) {
  return std::any_of(params.gains.begin(), params.gains.end(), [](float gain) { return gain != 1.0F; });
}

bool is_rigid(const EditParams& params) {
  return is_rigid(params.deformation) && !has_gains(params);
}

// What becomes of a block's samples.
enum class Fate : std::uint8_t { kStays, kBends, kBendsInPart, kRigid };

Fate fate_of(std::size_t block, const ScaleField& field) {
  const std::size_t begin = block * kSimdBlock;
  const std::size_t end = std::min(begin + kSimdBlock, field.size());
  bool moves = false;
  std::size_t whole = 0;
  for (std::size_t i = begin; i < end; ++i) {
    moves = moves || field.t[i] > 0.0F;
    whole += field.t[i] == 1.0F && field.gradient[i] == Vec3f::Zero() ? 1U : 0U;
  }
  if (!moves) return Fate::kStays;
  if (whole == 0) return Fate::kBends;
  return whole == end - begin ? Fate::kRigid : Fate::kBendsInPart;
}

}  // namespace

EditPlan::EditPlan(const MultiresSurface& surface, const NeighborGraph& graph, const EditParams& params,
                   const ScaleField& field, const ExecutionContext* context, BlockRange range)
    : level_(params.level),
      rigid_only_(is_rigid(params)),
      offsets_(needs_shape_operators(params.deformation)) {
  const std::size_t n = surface.sample_count();
  POINTWRIGHT_CHECK(graph.count == n && field.size() == n, "a graph and a field of the same samples");
  POINTWRIGHT_CHECK(level_ <= surface.band_count(), "a level of the surface");
  const std::size_t last = std::min<std::size_t>(range.end, padded_to_block(n) / kSimdBlock);
  const std::size_t first = std::min<std::size_t>(range.begin, last);
  std::vector<Fate> fates(last - first);
  parallel_for(
      fates.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) fates[b] = fate_of(first + b, field);
      },
      kParallelBlock / kSimdBlock, context);
  for (std::size_t b = 0; b < fates.size(); ++b) {
    if (fates[b] == Fate::kStays) continue;
    const auto block = static_cast<std::uint32_t>(first + b);
    moving_.push_back(block);
    if (rigid_only_ && fates[b] == Fate::kRigid) {
      rigid_.push_back(block);
    } else {
      bending_.push_back(block);
      any_whole_.push_back(fates[b] == Fate::kBends ? 0 : 1);
    }
  }
  for (std::size_t k = level_ + 1; k < surface.levels.size(); ++k) {
    stencils_.emplace_back(surface.levels[k], graph, bending_, context);
  }
  if (offsets_) {
    const Level& edited = surface.levels[level_];
    shape_ = shape_operators(edited, NormalStencil(edited, graph, moving_, context), context);
  }
}

bool EditPlan::serves(const EditParams& params) const {
  return params.level == level_ && rigid_only_ == is_rigid(params) &&
         (offsets_ || !needs_shape_operators(params.deformation));
}

std::size_t EditPlan::memory() const {
  std::size_t bytes = (moving_.size() + bending_.size() + rigid_.size()) * sizeof(std::uint32_t) +
                      any_whole_.size() + 3 * shape_.size() * sizeof(float);
  for (const NormalStencil& stencil : stencils_) bytes += stencil.memory();
  return bytes;
}

}  // namespace pointwright
