#pragma once
// A history of edits on a preview, played as a session does, and the script that it leaves.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "engine/core/median.h"
#include "engine/multires/hierarchy.h"
#include "engine/resampling/resampled_edit.h"
#include "engine/simplification/subsample.h"
#include "engine/transfer/transferred_edits.h"
#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright::test {

/// Which region a place at rest is painted into; 0: none.
using Paint = std::function<std::uint8_t(const Vec3f&)>;

inline Paint beside(float border, const Vec3f& axis = Vec3f::UnitX()) {
  return [border, axis](const Vec3f& p) {
    const float along = p.dot(axis);
    if (along < -border) return static_cast<std::uint8_t>(RegionKind::kZero);
    return along > border ? static_cast<std::uint8_t>(RegionKind::kOne) : std::uint8_t{0};
  };
}

struct PlayedPreview {
  EditScript script;
  MultiresSurface rest;
  MultiresSurface surface;  ///< after the last edit
  std::shared_ptr<const pointwright::Sampling> sampling;
};

inline LevelBases bases_of(const Hierarchy& hierarchy) {
  return {.bands = hierarchy.bases, .spacing = median(hierarchy.spacing)};
}

/// Builds the preview's hierarchy and makes the edits, all with the same painting of the rest positions, or
/// with the regions given. An edit of a level that an earlier one left behind is made on levels derived anew.
inline PlayedPreview played(const Cloud& cloud, const HierarchyParams& params,
                            const std::vector<EditParams>& edits, const Paint& paint,
                            const RegionPair* regions_of_all = nullptr) {
  auto built = build_hierarchy(cloud, params, {});
  REQUIRE(built.ok());
  Hierarchy& hierarchy = built.value();
  PlayedPreview preview;
  preview.rest = preview.surface = hierarchy.surface;
  preview.script = {.origin = cloud.origin,
                    .rest = hierarchy.surface.finest(),
                    .bases = bases_of(hierarchy),
                    .edits = {},
                    .neighbors = params.neighbors,
                    .spacing_ratio = 1.0F};
  preview.sampling = std::make_shared<const pointwright::Sampling>(
      rest_sampling(std::make_shared<const Cloud>(cloud),
                    std::make_shared<const NeighborGraph>(hierarchy.graph), hierarchy.spacing));
  std::uint32_t valid = 0;
  for (const EditParams& edit : edits) {
    TransferredEdit transferred{.params = edit, .regions = {}, .derived = {}};
    if (edit.level < valid) {
      Cloud current = cloud;
      current.position = preview.surface.levels[valid].position;
      current.normal = preview.surface.levels[valid].normal;
      HierarchyParams coarser = params;
      coarser.scales.resize(valid);
      auto derived = build_hierarchy(current, coarser, {});
      REQUIRE(derived.ok());
      for (std::uint32_t k = 0; k < valid; ++k) {
        preview.surface.levels[k] = derived.value().surface.levels[k];
        preview.surface.detail[k] = derived.value().surface.detail[k];
      }
      transferred.derived = std::make_shared<const LevelBases>(bases_of(derived.value()));
      valid = 0;
    }
    const Points& position = preview.surface.levels[edit.level].position;
    Marks marks(position.size());
    // Inserted samples come after those that were painted; their parents' marks would be theirs.
    for (std::size_t i = 0; i < marks.size(); ++i)
      marks[i] = i < cloud.size() ? paint(cloud.position[i]) : std::uint8_t{0};
    auto regions = regions_of_all != nullptr
                       ? Result<RegionPair>(*regions_of_all)
                       : regions_from_marks(position, preview.sampling->spacing, marks, cloud.origin);
    REQUIRE(regions.ok());
    const ScaleField field = compute_scale_field(position, regions.value(), edit.blend);
    if (edit.resampling) {
      auto made = apply_resampled_edit(preview.surface, preview.sampling, edit, field, regions.value(),
                                       ResamplingEffort::kExact);
      REQUIRE(made.ok());
      preview.surface = std::move(made.value().surface);
      preview.sampling = std::move(made.value().sampling);
    } else {
      preview.surface = apply_edit(preview.surface, *preview.sampling->graph, edit, field, cloud.origin);
    }
    transferred.regions = std::make_shared<const RegionPair>(std::move(regions).value());
    preview.script.edits.push_back(std::move(transferred));
    valid = std::max(valid, edit.level);
  }
  return preview;
}

struct Transferred : TransferredSamples {
  MultiresSurface rest;  ///< before the first edit
};
inline Transferred transferred(const EditScript& script, const Cloud& cloud) {
  const AnchorIndex anchors(script.rest);
  Transferred result;
  auto made = transfer_edits(script, anchors, std::make_shared<const Cloud>(cloud), {}, &result.rest);
  REQUIRE(made.ok());
  static_cast<TransferredSamples&>(result) = std::move(made).value();
  return result;
}

/// `count` evenly spaced samples of the cloud.
inline Cloud preview_of(const Cloud& cloud, std::uint64_t count) {
  auto chosen = subsample(cloud.position, cloud.normal, {.target = KeepCount{count}});
  REQUIRE(chosen.ok());
  return permuted(cloud, chosen.value());
}

inline EditParams edit_by(ElementaryDeformation step, std::uint32_t level = 0) {
  EditParams edit{.level = level};
  edit.deformation.steps = {std::move(step)};
  return edit;
}

/// Root of the mean square of the distances between the samples of two columns.
inline double rms_distance(const Points& a, const Points& b) {
  REQUIRE(a.size() == b.size());
  double squares = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]).cast<double>().squaredNorm();
  return std::sqrt(squares / static_cast<double>(a.size()));
}

}  // namespace pointwright::test
