#pragma once
// Figure 7: a plane pulled up at its middle, such that resampling gives the paper's numbers of samples.

#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "engine/editing/edit.h"
#include "engine/editing/region.h"
#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"
#include "engine/spatial/coherent_order.h"
#include "tests/support/surfaces.h"

namespace pointwright::test {

/// The unit square in z = 0 with side x side jittered samples, in coherent order: the one-region within 0.05
/// of the middle, the zero-region beyond 0.45 of it, the middle pulled up by `height`.
/// A deformation that reproduces the counts of Figure 7, which does not say what its own was.
struct PulledPlane {
  static constexpr double kHeight = 3.935;
  static constexpr double kMinSpacing = 0.00703;  ///< what both counts of the figure need

  MultiresSurface surface;
  std::shared_ptr<const pointwright::Sampling> sampling;
  RegionPair regions;
  EditParams params;
  ScaleField field;
  double spacing = 0.0;
};

/// `detail(x, y)` is a band over the plane; none: the plane is the only level.
inline PulledPlane pulled_plane(std::size_t side, const std::function<double(double, double)>& detail = {}) {
  PulledPlane scene;
  scene.spacing = 1.0 / static_cast<double>(side);
  const double h = scene.spacing;
  Random random(7);
  Points points(side * side);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = (static_cast<double>(i % side) + 0.5 + random.uniform(-0.25, 0.25)) * h;
    const double y = (static_cast<double>(i / side) + 0.5 + random.uniform(-0.25, 0.25)) * h;
    points.set(i, Vec3d(x, y, 0.0).cast<float>());
  }
  Cloud cloud = to_cloud(coherent(points));
  const std::size_t n = cloud.size();
  Level level{.position = cloud.position, .normal = Points(n)};
  for (std::size_t i = 0; i < n; ++i) {
    level.normal.set(i, Vec3f::UnitZ());
    const Vec3f p = cloud.position[i];
    cloud.texcoord.push_back({p.x(), p.y()});
  }
  scene.surface.levels.push_back(level);
  if (detail) {
    scene.surface.levels.push_back(level);
    scene.surface.detail.emplace_back();
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3d p = level.position[i].cast<double>();
      const auto d = static_cast<float>(detail(p.x(), p.y()));
      scene.surface.detail[0].push_back(d);
      scene.surface.levels[1].position.set(i, level.position[i] + d * level.normal[i]);
    }
  }
  NeighborGraph graph = build_neighbor_graph(level.position, 10);
  Points zero(0);
  Points one(0);
  for (std::size_t i = 0; i < n; ++i) {
    const double r = std::hypot(static_cast<double>(level.position[i].x()) - 0.5,
                                static_cast<double>(level.position[i].y()) - 0.5);
    Points* region = r <= 0.05 ? &one : r >= 0.45 ? &zero : nullptr;
    if (region == nullptr) continue;
    region->resize(region->size() + 1);
    region->set(region->size() - 1, level.position[i]);
  }
  const auto radius = static_cast<float>(0.5 * h);
  scene.regions = {.zero = Region(zero, std::vector<float>(zero.size(), radius)),
                   .one = Region(one, std::vector<float>(one.size(), radius))};
  scene.params = {.level = 0,
                  .blend = Blend::kQuartic,
                  .deformation = Translation{.vector = Vec3d(0.0, 0.0, PulledPlane::kHeight)},
                  .gains = {},
                  .resampling = ResamplingParams{.min_spacing = PulledPlane::kMinSpacing}};
  scene.field = compute_scale_field(level.position, scene.regions, scene.params.blend);
  scene.sampling = std::make_shared<const pointwright::Sampling>(rest_sampling(
      std::make_shared<const Cloud>(std::move(cloud)),
      std::make_shared<const NeighborGraph>(std::move(graph)), std::vector<float>(n, static_cast<float>(h))));
  return scene;
}

}  // namespace pointwright::test
