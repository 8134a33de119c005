#include "engine/editing/edit.h"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"

namespace pointwright {
namespace {

void copy_columns(const Points& from, Points& to, std::size_t begin, std::size_t padded_end) {
  std::copy(from.x() + begin, from.x() + padded_end, to.x() + begin);
  std::copy(from.y() + begin, from.y() + padded_end, to.y() + begin);
  std::copy(from.z() + begin, from.z() + padded_end, to.z() + begin);
}

void check_shapes(const MultiresSurface& surface, const EditParams& params, const ScaleField& field) {
  const std::size_t n = surface.sample_count();
  POINTWRIGHT_CHECK(surface.levels.size() == surface.band_count() + 1, "one level more than bands");
  POINTWRIGHT_CHECK(params.level < surface.levels.size(), "a level of the surface");
  POINTWRIGHT_CHECK(field.size() == n && field.t.size() >= padded_to_block(n), "a field of the same samples");
  for (const Level& level : surface.levels) {
    POINTWRIGHT_CHECK(level.position.size() == n && level.normal.size() == n, "levels of the same samples");
  }
  for (const auto& column : surface.detail) POINTWRIGHT_CHECK(column.size() >= n, "one detail per sample");
}

// The columns of level k from sample `begin` on, moved from `rest` to `edited`.
LevelColumns columns_at(const Level& rest, Level& edited, std::size_t begin) {
  const Points& p = rest.position;
  const Points& n = rest.normal;
  Points& q = edited.position;
  Points& m = edited.normal;
  return {.position = {p.x() + begin, p.y() + begin, p.z() + begin},
          .normal = {n.x() + begin, n.y() + begin, n.z() + begin},
          .detail = nullptr,
          .deformed_position = {q.x() + begin, q.y() + begin, q.z() + begin},
          .deformed_normal = {m.x() + begin, m.y() + begin, m.z() + begin}};
}

// The detail columns from `begin` on; those that end within the last SIMD block are padded into `padding`.
const float* detail_at(const std::vector<float>& column, std::size_t begin, std::size_t end,
                       std::vector<float>& padding) {
  const std::size_t padded_end = begin + padded_to_block(end - begin);
  if (column.size() >= padded_end) return column.data() + begin;
  padding.assign(padded_end - begin, 0.0F);
  std::copy(column.begin() + static_cast<std::ptrdiff_t>(begin),
            column.begin() + static_cast<std::ptrdiff_t>(end), padding.begin());
  return padding.data();
}

void resize_like(const MultiresSurface& surface, MultiresSurface& edited) {
  edited.levels.resize(surface.levels.size());
  edited.detail.resize(surface.detail.size());
  for (std::size_t k = 0; k < surface.levels.size(); ++k) {
    edited.levels[k].position.resize(surface.sample_count());
    edited.levels[k].normal.resize(surface.sample_count());
  }
  for (std::size_t k = 0; k < surface.detail.size(); ++k) edited.detail[k].resize(surface.detail[k].size());
}

// What an edit leaves alone: detail coefficients and the coarser levels.
void copy_block(const MultiresSurface& surface, std::size_t edited_level, std::size_t begin, std::size_t end,
                MultiresSurface& edited) {
  const std::size_t padded_end = begin + padded_to_block(end - begin);
  for (std::size_t k = 0; k < edited_level; ++k) {
    copy_columns(surface.levels[k].position, edited.levels[k].position, begin, padded_end);
    copy_columns(surface.levels[k].normal, edited.levels[k].normal, begin, padded_end);
  }
  for (std::size_t k = 0; k < surface.detail.size(); ++k) {
    const std::vector<float>& from = surface.detail[k];
    const std::size_t last = end == surface.sample_count() ? from.size() : end;
    std::copy(from.begin() + static_cast<std::ptrdiff_t>(begin),
              from.begin() + static_cast<std::ptrdiff_t>(last),
              edited.detail[k].begin() + static_cast<std::ptrdiff_t>(begin));
  }
}

}  // namespace

Result<void> validate(const EditParams& params, const MultiresSurface& surface) {
  if (params.level > surface.band_count()) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "level " + std::to_string(params.level) +
                            " is beyond the surface's finest level, " + std::to_string(surface.band_count()),
                 .field = "level",
                 .limit = static_cast<double>(surface.band_count()),
                 .actual = static_cast<double>(params.level)};
  }
  return validate(params.deformation);
}

void apply_edit(const MultiresSurface& surface, const EditParams& params, const ScaleField& field,
                const Vec3d& origin, MultiresSurface& edited) {
  POINTWRIGHT_CHECK(&surface != &edited, "the result is another surface");
  check_shapes(surface, params, field);
  resize_like(surface, edited);
  const DeformMap map = to_deform_map(params.deformation, origin);
  const auto kernel = POINTWRIGHT_KERNEL(deform_levels);
  const std::size_t level_count = surface.levels.size() - params.level;
  parallel_for(surface.sample_count(), [&](std::size_t begin, std::size_t end) {
    copy_block(surface, params.level, begin, end, edited);
    std::vector<LevelColumns> columns(level_count);
    std::vector<std::vector<float>> padding(level_count);
    for (std::size_t j = 0; j < level_count; ++j) {
      const std::size_t k = params.level + j;
      columns[j] = columns_at(surface.levels[k], edited.levels[k], begin);
      if (j > 0) columns[j].detail = detail_at(surface.detail[k - 1], begin, end, padding[j]);
    }
    kernel(DeformJob{.map = &map,
                     .t = field.t.data() + begin,
                     .gradient = {field.gradient.x() + begin, field.gradient.y() + begin,
                                  field.gradient.z() + begin},
                     .level = columns.data(),
                     .level_count = level_count},
           padded_to_block(end - begin));
  });
}

MultiresSurface apply_edit(const MultiresSurface& surface, const EditParams& params, const ScaleField& field,
                           const Vec3d& origin) {
  MultiresSurface edited;
  apply_edit(surface, params, field, origin, edited);
  return edited;
}

}  // namespace pointwright
