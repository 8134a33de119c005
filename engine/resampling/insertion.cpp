#include "engine/resampling/insertion.h"

#include <algorithm>

#include "engine/core/parallel.h"
#include "engine/multires/normal_stencil.h"

namespace pointwright {
namespace {

constexpr std::size_t kChildrenOfRange = 512;

template <typename Body>
void for_children(std::size_t count, const Body& body) {
  parallel_for(
      count,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t child = begin; child < end; ++child) body(child);
      },
      kChildrenOfRange);
}

Vec3f interpolated_normal(const ZombieWeights& weights, const Points& normal) {
  Vec3f sum = Vec3f::Zero();
  for (std::uint32_t j = 0; j < weights.count; ++j) sum += weights.weight[j] * normal[weights.sample[j]];
  const float length = sum.norm();
  return length > 0.0F ? Vec3f(sum / length) : normal[weights.sample[0]];
}

float interpolated(const ZombieWeights& weights, const std::vector<float>& column) {
  float sum = 0.0F;
  for (std::uint32_t j = 0; j < weights.count; ++j) sum += weights.weight[j] * column[weights.sample[j]];
  return sum;
}

// `side` without its part along the normal, as long as it was.
Vec3f in_plane(const Vec3f& side, const Vec3f& normal) {
  const Vec3f along = side - side.dot(normal) * normal;
  const float length = along.norm();
  return length > 0.0F ? Vec3f(side.norm() / length * along) : Vec3f::Zero();
}

}  // namespace

void append_children(const Inserted& inserted, std::uint32_t level, MultiresSurface& surface) {
  const std::size_t before = surface.sample_count();
  const std::size_t count = inserted.count();
  for (Level& each : surface.levels) {
    each.position.resize(before + count);
    each.normal.resize(before + count);
  }
  for (std::vector<float>& detail : surface.detail) detail.resize(before + count);
  for_children(count, [&](std::size_t child) {
    const std::size_t i = before + child;
    const ZombieWeights& weights = inserted.weights[child];
    for (Level& each : surface.levels) each.normal.set(i, interpolated_normal(weights, each.normal));
    for (std::vector<float>& detail : surface.detail) detail[i] = interpolated(weights, detail);
    const RestPatch& patch = inserted.patches.of(inserted.split(child).sample);
    Vec3f p = patch.point(inserted.births.x[child], inserted.births.y[child]);
    surface.levels[level].position.set(i, p);
    for (std::size_t k = level; k + 1 < surface.levels.size(); ++k) {
      p += surface.detail[k][i] * surface.levels[k].normal[i];
      surface.levels[k + 1].position.set(i, p);
    }
    p = surface.levels[level].position[i];
    for (std::size_t k = level; k-- > 0;) {
      p -= surface.detail[k][i] * surface.levels[k].normal[i];
      surface.levels[k].position.set(i, p);
    }
  });
}

void append_children(const Points& position, const RegionPair& regions, Blend blend, ScaleField& field) {
  const std::size_t before = field.size();
  const std::size_t count = position.size() - before;
  Points children(count);
  for_children(count, [&](std::size_t child) { children.set(child, position[before + child]); });
  const ScaleField added = compute_scale_field(children, regions, blend);
  field.t.resize(padded_to_block(before + count), 0.0F);
  field.gradient.resize(before + count);
  for_children(count, [&](std::size_t child) {
    field.t[before + child] = added.t[child];
    field.gradient.set(before + child, added.gradient[child]);
  });
}

void append_children(const Inserted& inserted, NeighborGraph& graph) {
  const std::size_t before = graph.count;
  graph.count += inserted.count();
  graph.lanes.resize(padded_to_block(graph.count) * graph.k, 0);
  // Rows end within blocks that other threads write to, never at the same entries.
  for_children(inserted.count(), [&](std::size_t child) {
    const ZombieWeights& weights = inserted.weights[child];
    for (std::uint32_t j = 0; j < graph.k; ++j)
      graph.index(before + child, j) = weights.sample[std::min(j, weights.count - 1)];
  });
}

void divide_cells(const Inserted& inserted, const Cells& rest, const DeformMap& map, const ScaleField& field,
                  const Level& level, const ShapeOperators* shape, Cells& cells) {
  const std::size_t before = rest.u.size();
  const std::size_t count = inserted.count();
  if (count == 0) return;
  // The children alone, as columns of their own.
  Level children{.position = Points(count), .normal = Points(count)};
  Cells parts{.u = Points(count), .v = Points(count)};
  ScaleField part{.t = std::vector<float>(padded_to_block(count), 0.0F), .gradient = Points(count)};
  ShapeOperators bent;
  if (shape != nullptr)
    for (auto* column : {&bent.uu, &bent.uv, &bent.vv}) column->resize(padded_to_block(count));
  const auto& splits = inserted.splits.splits;
  parallel_for(
      splits.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
          const Split& split = splits[s];
          const std::uint32_t i = split.sample;
          const auto major = static_cast<float>(split.major);
          const auto minor = static_cast<float>(split.minor);
          const Vec3f u = cells.u[i];
          const Vec3f v = cells.v[i];
          const PrincipalStretch stretch = principal_stretch(u, v);
          cells.u.set(i, (stretch.cosine * u + stretch.sine * v) / major);
          cells.v.set(i, (stretch.cosine * v - stretch.sine * u) / minor);
          const Vec3f along = (stretch.cosine * rest.u[i] + stretch.sine * rest.v[i]) / major;
          const Vec3f across = (stretch.cosine * rest.v[i] - stretch.sine * rest.u[i]) / minor;
          for (std::uint32_t c = split.first_child; c < split.first_child + split.children(); ++c) {
            const Vec3f normal = level.normal[before + c];
            children.position.set(c, level.position[before + c]);
            children.normal.set(c, normal);
            parts.u.set(c, in_plane(along, normal));
            parts.v.set(c, in_plane(across, normal));
            part.t[c] = field.t[before + c];
            part.gradient.set(c, field.gradient[before + c]);
            if (shape == nullptr) continue;
            bent.uu[c] = shape->uu[before + c];
            bent.uv[c] = shape->uv[before + c];
            bent.vv[c] = shape->vv[before + c];
          }
        }
      },
      kChildrenOfRange);
  const MappedCells mapped = map_cells(map, NormalStencil::all_blocks(count), part, children, parts,
                                       shape != nullptr ? &bent : nullptr);
  cells.u.resize(before + count);
  cells.v.resize(before + count);
  for_children(count, [&](std::size_t child) {
    cells.u.set(before + child, mapped.cells.u[child]);
    cells.v.set(before + child, mapped.cells.v[child]);
  });
}

Cloud with_children(const Inserted& inserted, const Cloud& cloud, const Level& finest,
                    std::uint32_t next_id) {
  const std::size_t before = cloud.size();
  const std::size_t count = inserted.count();
  Cloud all = cloud;
  append_attributes(inserted.weights, all);
  all.position.resize(before + count);
  if (cloud.has_normals()) all.normal.resize(before + count);
  all.id.resize(before + count);
  if (!all.exact_position.empty()) all.exact_position.resize(before + count);
  for_children(count, [&](std::size_t child) {
    const std::size_t i = before + child;
    all.id[i] = next_id + static_cast<std::uint32_t>(child);
    all.position.set(i, finest.position[i]);
    if (cloud.has_normals()) all.normal.set(i, finest.normal[i]);
    if (!all.exact_position.empty()) {
      const Vec3d place = cloud.origin + finest.position[i].cast<double>();
      all.exact_position[i] = {place.x(), place.y(), place.z()};
    }
  });
  return all;
}

}  // namespace pointwright
