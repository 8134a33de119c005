// A frame of a drag in three bands: deform, rebuild, encode.
#include <algorithm>
#include <cstdlib>
#include <numbers>

#include "engine/editing/edit_plan.h"
#include "engine/multires/hierarchy.h"
#include "protocol/frames/frame.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

constexpr std::uint16_t kAttributes = protocol::kFrameNormal | protocol::kFrameT;

// A one-region at one side of the torus, a zero-region at the other: every sample between moves.
Marks painted_sides(const Points& position) {
  Marks marks(position.size(), 0);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const float x = position[i].x();
    marks[i] = x > 1.3F     ? static_cast<std::uint8_t>(RegionKind::kOne)
               : x < -1.39F ? static_cast<std::uint8_t>(RegionKind::kZero)
                            : std::uint8_t{0};
  }
  return marks;
}

void bench_drag(BenchReport& report, const std::string& label, std::size_t n) {
  const std::string frame = "frame." + label;
  const std::string encode = "frame.encode." + label;
  const std::string plan_name = "edit.plan." + label;
  if (!report.wants(frame) && !report.wants(encode) && !report.wants(plan_name)) return;
  const Cloud scan = ordered_scan(n);
  auto built = build_hierarchy(scan, HierarchyParams{.scales = kThreeScales}, ExecutionContext{});
  if (!built) std::abort();
  const Hierarchy& hierarchy = built.value();
  const Points& base = hierarchy.surface.levels[0].position;
  auto regions = regions_from_marks(base, hierarchy.spacing, painted_sides(scan.position), scan.origin);
  if (!regions) std::abort();
  const ScaleField field = compute_scale_field(base, regions.value(), Blend::kQuartic);
  const protocol::FrameLayout layout(static_cast<std::uint32_t>(n));
  const EditParams edit{.deformation = Rotation{.axis = Vec3d::UnitY(), .angle_rad = 0.5 * std::numbers::pi}};
  protocol::FrameBytes bytes;
  const auto encode_surface = [&](const MultiresSurface& surface) {
    const protocol::FrameColumns columns{
        .position = &surface.finest().position, .normal = &surface.finest().normal, .t = field.t};
    encode_key_frame(layout, columns, protocol::FrameState{.origin = scan.origin}, kAttributes, bytes);
  };
  // The plan is made once a painting; a drag's frames write over each other.
  const EditPlan plan(hierarchy.surface, hierarchy.graph, edit, field);
  MultiresSurface edited = hierarchy.surface;
  report.time(frame, "ms", static_cast<double>(n), [&] {
    apply_edit(hierarchy.surface, plan, edit, field, scan.origin, edited);
    encode_surface(edited);
  });
  report.time(plan_name, "ms", static_cast<double>(n),
              [&] { const EditPlan made(hierarchy.surface, hierarchy.graph, edit, field); });
  report.time(encode, "ms", static_cast<double>(n), [&] { encode_surface(hierarchy.surface); });
}

}  // namespace

void bench_frames(BenchReport& report) {
  bench_drag(report, "148k", 148'138);
  bench_drag(report, "2m", 2'000'000);
}

}  // namespace pointwright::bench
