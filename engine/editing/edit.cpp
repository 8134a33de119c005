#include "engine/editing/edit.h"

#include <algorithm>
#include <array>
#include <string>

#include "engine/core/check.h"
#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"
#include "engine/editing/edit_plan.h"
#include "engine/multires/reconstruction.h"

namespace pointwright {
namespace {

// A range of a plan's list of blocks is as many samples as other ranges are.
constexpr std::size_t kBlocksOfRange = kParallelBlock / kSimdBlock;

void check_shapes(const MultiresSurface& surface, const EditPlan& plan, const EditParams& params,
                  const ScaleField& field, const MultiresSurface& edited) {
  const std::size_t n = surface.sample_count();
  POINTWRIGHT_CHECK(&surface != &edited, "the result is another surface");
  POINTWRIGHT_CHECK(plan.serves(params), "a plan for such parameters");
  POINTWRIGHT_CHECK(surface.levels.size() == surface.band_count() + 1, "one level more than bands");
  POINTWRIGHT_CHECK(field.size() == n && field.t.size() >= padded_to_block(n), "a field of the same samples");
  POINTWRIGHT_CHECK(
      edited.levels.size() == surface.levels.size() && edited.band_count() == surface.band_count(),
      "a copy of the surface");
  for (std::size_t k = 0; k < surface.levels.size(); ++k) {
    for (const Level* level : {&surface.levels[k], &edited.levels[k]})
      POINTWRIGHT_CHECK(level->position.size() == n && level->normal.size() == n,
                        "levels of the same samples");
  }
  for (std::size_t k = 0; k < surface.band_count(); ++k)
    POINTWRIGHT_CHECK(surface.detail[k].size() == n && edited.detail[k].size() == n, "one detail per sample");
}

// The entries of a detail column that do not fill a block, padded.
struct LastBlock {
  std::size_t first = 0;
  std::array<float, kSimdBlock> rest{};
  std::array<float, kSimdBlock> now{};

  LastBlock() = default;
  explicit LastBlock(const std::vector<float>& detail) : first(detail.size() / kSimdBlock * kSimdBlock) {
    std::copy(detail.begin() + static_cast<std::ptrdiff_t>(first), detail.end(), rest.begin());
    now = rest;  // where the block does not move
  }
  void copy_to(std::vector<float>& detail) const {
    std::copy_n(now.begin(), detail.size() - first, detail.begin() + static_cast<std::ptrdiff_t>(first));
  }
};

// Positions and detail of level k + 1 from how level k stands.
RaiseArgs raise_args(const MultiresSurface& rest, std::size_t k, const std::vector<std::uint32_t>& blocks,
                     const EditParams& params, const ScaleField& field, MultiresSurface& edited,
                     LastBlock& last) {
  const Level& rest_base = rest.levels[k];
  const Level& base = edited.levels[k];
  const Points& above = rest.levels[k + 1].position;
  Points& raised = edited.levels[k + 1].position;
  return {.blocks = blocks.data(),
          .t = field.t.data(),
          .gain = params.gains.empty() ? 1.0F : params.gains[k],
          .rest_base_position = {rest_base.position.x(), rest_base.position.y(), rest_base.position.z()},
          .rest_base_normal = {rest_base.normal.x(), rest_base.normal.y(), rest_base.normal.z()},
          .base_position = {base.position.x(), base.position.y(), base.position.z()},
          .base_normal = {base.normal.x(), base.normal.y(), base.normal.z()},
          .rest_position = {above.x(), above.y(), above.z()},
          .rest_detail = rest.detail[k].data(),
          .position = {raised.x(), raised.y(), raised.z()},
          .detail = edited.detail[k].data(),
          .last_block = static_cast<std::uint32_t>(last.first / kSimdBlock),
          .last_rest_detail = last.rest.data(),
          .last_detail = last.now.data()};
}

TurnArgs turn_args(const Points& rest, const EditPlan& plan, bool bends, const Mat3d& rotation,
                   const ScaleField& field, Points& normal) {
  TurnArgs args{.blocks = (bends ? plan.bending() : plan.rigid()).data(),
                .any_whole = bends ? plan.any_whole().data() : nullptr,
                .t = field.t.data(),
                .gradient = {field.gradient.x(), field.gradient.y(), field.gradient.z()},
                .is_identity = rotation == Mat3d::Identity(),
                .rest_normal = {rest.x(), rest.y(), rest.z()},
                .normal = {normal.x(), normal.y(), normal.z()}};
  for (int i = 0; i < 9; ++i) args.rotation[i] = static_cast<float>(rotation(i / 3, i % 3));
  return args;
}

NormalStencil::Moved moved_level(const MultiresSurface& rest, std::size_t k, const EditParams& params,
                                 const ScaleField& field, MultiresSurface& edited) {
  return {.rest = &rest.levels[k],
          .rest_base = &rest.levels[k - 1],
          .base_normal = &edited.levels[k - 1].normal,
          .position = &edited.levels[k].position,
          .normal = &edited.levels[k].normal,
          .gains = !params.gains.empty() && params.gains[k - 1] != 1.0F,
          .t = field.t.data()};
}

}  // namespace

Result<void> validate(const EditParams& params, const MultiresSurface& surface) {
  if (params.level > surface.band_count()) {
    return out_of_range("level " + std::to_string(params.level) + " is beyond the surface's finest level, " +
                            std::to_string(surface.band_count()),
                        "level", static_cast<double>(surface.band_count()),
                        static_cast<double>(params.level));
  }
  if (auto gains = validate(ReconstructParams{.level = params.level, .gains = params.gains}, surface); !gains)
    return gains;
  if (params.resampling) {
    if (auto valid = validate(*params.resampling); !valid) return valid;
  }
  return validate(params.deformation);
}

void apply_edit(const MultiresSurface& surface, const EditPlan& plan, const EditParams& params,
                const ScaleField& field, const Vec3d& origin, MultiresSurface& edited) {
  check_shapes(surface, plan, params, field, edited);
  const DeformMap map = to_deform_map(params.deformation, origin);
  const auto deform_kernel = POINTWRIGHT_KERNEL(deform_samples);
  const auto raise_kernel = POINTWRIGHT_KERNEL(raise_level);
  const auto turn_kernel = POINTWRIGHT_KERNEL(turn_normals);
  const Mat3d rotation = plan.rigid_only() ? whole_rotation(params.deformation) : Mat3d::Identity();
  const DeformArgs deform = deform_args(map, plan.moving(), field, surface.levels[plan.level()],
                                        edited.levels[plan.level()], plan.shape());
  parallel_for(
      plan.moving().size(), [&](std::size_t begin, std::size_t end) { deform_kernel(deform, begin, end); },
      kBlocksOfRange);

  // A level's normals need its neighbours' positions; the next level's positions need its own normals only:
  // both in one pass over the samples.
  for (std::size_t k = plan.level(); k < surface.levels.size(); ++k) {
    const bool finest = k == surface.band_count();
    const bool carries = k > plan.level();
    LastBlock last = finest ? LastBlock() : LastBlock(surface.detail[k]);
    for (const bool bends : {true, false}) {
      const std::vector<std::uint32_t>& blocks = bends ? plan.bending() : plan.rigid();
      const RaiseArgs raise =
          finest ? RaiseArgs{} : raise_args(surface, k, blocks, params, field, edited, last);
      const TurnArgs turn = carries && plan.rigid_only() ? turn_args(surface.levels[k].normal, plan, bends,
                                                                     rotation, field, edited.levels[k].normal)
                                                         : TurnArgs{};
      const NormalStencil::Moved moved =
          carries ? moved_level(surface, k, params, field, edited) : NormalStencil::Moved{};
      parallel_for(
          blocks.size(),
          [&](std::size_t begin, std::size_t end) {
            if (carries && bends) plan.stencil(k).carry(moved, begin, end);
            if (carries && plan.rigid_only()) turn_kernel(turn, begin, end);
            if (!finest) raise_kernel(raise, begin, end);
          },
          kBlocksOfRange);
    }
    if (!finest) last.copy_to(edited.detail[k]);
  }
}

MultiresSurface apply_edit(const MultiresSurface& surface, const NeighborGraph& graph,
                           const EditParams& params, const ScaleField& field, const Vec3d& origin) {
  MultiresSurface edited = surface;
  apply_edit(surface, EditPlan(surface, graph, params, field), params, field, origin, edited);
  return edited;
}

}  // namespace pointwright
