#include "engine/multires/normal_stencil.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/multires/normal_stencil_kernels.h"

namespace pointwright {
namespace {

void columns_of(const Points& points, const float* (&to)[3]) {
  to[0] = points.x();
  to[1] = points.y();
  to[2] = points.z();
}

}  // namespace

std::vector<std::uint32_t> NormalStencil::all_blocks(std::size_t count) {
  std::vector<std::uint32_t> blocks(padded_to_block(count) / kSimdBlock);
  std::iota(blocks.begin(), blocks.end(), 0U);
  return blocks;
}

NormalStencil::NormalStencil(const Level& rest, const NeighborGraph& graph, std::vector<std::uint32_t> blocks,
                             const ExecutionContext* context)
    : graph_(&graph), k_(std::min(kNeighbors, graph.k)), blocks_(std::move(blocks)) {
  const std::size_t lanes = blocks_.size() * kSimdBlock;
  for (auto* weights : {&weight_u_, &weight_v_}) weights->resize(lanes * k_);
  for (auto* column : {&unit_u_, &unit_v_, &tilt_u_, &tilt_v_}) column->resize(lanes);
  BuildStencilArgs args{.neighbors = graph.lanes.data(),
                        .graph_k = graph.k,
                        .k = k_,
                        .blocks = blocks_.data(),
                        .stencil = {.weight_u = weight_u_.data(),
                                    .weight_v = weight_v_.data(),
                                    .unit_u = unit_u_.data(),
                                    .unit_v = unit_v_.data(),
                                    .tilt_u = tilt_u_.data(),
                                    .tilt_v = tilt_v_.data()}};
  columns_of(rest.position, args.position);
  columns_of(rest.normal, args.normal);
  const auto kernel = POINTWRIGHT_KERNEL(build_stencil);
  parallel_for(
      blocks_.size(), [&](std::size_t begin, std::size_t end) { kernel(args, begin, end); },
      kParallelBlock / kSimdBlock, context);
}

std::size_t NormalStencil::memory() const {
  return (weight_u_.size() + weight_v_.size()) * sizeof(std::int16_t) +
         (blocks_.size() + unit_u_.size() + unit_v_.size() + tilt_u_.size() + tilt_v_.size()) * sizeof(float);
}

StencilColumns NormalStencil::columns() const {
  return {.weight_u = weight_u_.data(),
          .weight_v = weight_v_.data(),
          .unit_u = unit_u_.data(),
          .unit_v = unit_v_.data(),
          .tilt_u = tilt_u_.data(),
          .tilt_v = tilt_v_.data()};
}

void NormalStencil::carry(const Moved& moved, std::size_t begin, std::size_t end) const {
  CarryNormalsArgs args{.gains = moved.gains,
                        .t = moved.t,
                        .neighbors = graph_->lanes.data(),
                        .graph_k = graph_->k,
                        .k = k_,
                        .blocks = blocks_.data(),
                        .stencil = columns()};
  columns_of(moved.rest->position, args.rest_position);
  columns_of(moved.rest->normal, args.rest_normal);
  columns_of(*moved.position, args.position);
  columns_of(moved.rest_base->normal, args.rest_base_normal);
  columns_of(*moved.base_normal, args.base_normal);
  args.normal[0] = moved.normal->x();
  args.normal[1] = moved.normal->y();
  args.normal[2] = moved.normal->z();
  POINTWRIGHT_KERNEL(carry_normals)(args, begin, end);
}

void NormalStencil::shape_operators(const Points& normal, float* uu, float* uv, float* vv, std::size_t begin,
                                    std::size_t end) const {
  ShapeOperatorArgs args{.neighbors = graph_->lanes.data(),
                         .graph_k = graph_->k,
                         .k = k_,
                         .blocks = blocks_.data(),
                         .stencil = columns(),
                         .shape = {uu, uv, vv}};
  columns_of(normal, args.normal);
  POINTWRIGHT_KERNEL(shape_operators)(args, begin, end);
}

}  // namespace pointwright
