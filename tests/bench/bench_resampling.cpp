// Dynamic resampling: Figure 7, and a frame of a drag with it.
#include <cstdlib>
#include <string>

#include "engine/multires/hierarchy.h"
#include "engine/resampling/resampled_drag.h"
#include "protocol/frames/frame.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"
#include "tests/support/pulled_plane.h"

namespace pointwright::bench {
namespace {

void bench_figure(BenchReport& report, const std::string& name, std::size_t side) {
  if (!report.wants(name)) return;
  const test::PulledPlane scene = test::pulled_plane(side);
  report.time(name, "ms", static_cast<double>(side * side), [&] {
    const auto result = apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field,
                                             scene.regions, ResamplingEffort::kExact);
    if (!result) std::abort();
  });
}

// A tenth of the torus lies between the regions, and is drawn to about twice its length.
void bench_preview(BenchReport& report, const std::string& name, std::size_t n) {
  if (!report.wants(name)) return;
  const Cloud scan = ordered_scan(n);
  auto built = build_hierarchy(scan, HierarchyParams{.scales = kThreeScales}, ExecutionContext{});
  if (!built) std::abort();
  Hierarchy hierarchy = std::move(built).value();
  const Points& base = hierarchy.surface.levels[0].position;
  Marks marks(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    const float x = scan.position[i].x();
    if (x > 1.3F) marks[i] = static_cast<std::uint8_t>(RegionKind::kOne);
    if (x < 1.08F) marks[i] = static_cast<std::uint8_t>(RegionKind::kZero);
  }
  const auto regions = regions_from_marks(base, hierarchy.spacing, marks, scan.origin);
  if (!regions) std::abort();
  const EditParams params{.deformation = Translation{.vector = Vec3d(0.35, 0.0, 0.0)},
                          .gains = {},
                          .resampling = ResamplingParams{}};
  const ScaleField field = compute_scale_field(base, regions.value(), params.blend);
  const auto sampling = std::make_shared<const Sampling>(
      rest_sampling(std::make_shared<const Cloud>(scan),
                    std::make_shared<const NeighborGraph>(std::move(hierarchy.graph)), hierarchy.spacing));
  ResampledDrag drag(std::make_shared<const MultiresSurface>(std::move(hierarchy.surface)), sampling, params,
                     std::make_shared<const ScaleField>(field), regions.value());
  protocol::FrameBytes bytes;
  MultiresSurface room;
  std::size_t inserted = 0;
  report.time(name, "ms", static_cast<double>(n), [&] {
    auto frame = drag.frame(params, ResamplingEffort::kPreview, std::move(room));
    if (!frame) std::abort();
    room = std::move(frame.value().surface);
    inserted = frame.value().inserted;
    const Level& shown = room.finest();
    encode_key_frame(protocol::FrameLayout(static_cast<std::uint32_t>(shown.position.size())),
                     {.position = &shown.position, .normal = &shown.normal},
                     protocol::FrameState{.origin = scan.origin}, protocol::kFrameNormal, bytes);
  });
  report.add(name + ".inserted", "samples", static_cast<double>(n), static_cast<double>(inserted));
}

}  // namespace

void bench_resampling(BenchReport& report) {
  bench_figure(report, "resample.fig7.10k", 100);
  bench_figure(report, "resample.fig7.160k", 400);
  bench_preview(report, "resample.preview.150k", 150'000);
}

}  // namespace pointwright::bench
