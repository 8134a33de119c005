// Painting, the scale field, and the edit of a drag's frame (DESIGN: paint.*; the parts of frame.*).
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "engine/editing/ball_cover.h"
#include "engine/editing/edit_plan.h"
#include "engine/editing/painted_field.h"
#include "engine/editing/painting.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

// A torus as base, the scan's bumps as the one band over it.
MultiresSurface one_band_surface(const Cloud& scan) {
  const std::size_t n = scan.size();
  MultiresSurface surface;
  surface.levels.assign(2, Level{.position = Points(n), .normal = Points(n)});
  surface.detail.assign(1, std::vector<float>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3f p = scan.position[i];
    const Vec3f ring = Vec3f(p.x(), p.y(), 0.0F).normalized();
    const Vec3f normal = (p - ring).normalized();
    const float d = (p - ring).norm() - 0.4F;
    surface.levels[0].position.set(i, p - d * normal);
    surface.levels[0].normal.set(i, normal);
    surface.levels[1].position.set(i, p);
    surface.levels[1].normal.set(i, normal);
    surface.detail[0][i] = d;
  }
  return surface;
}

PaintOperation half(double side) {
  return {.shape = HalfSpace{.point = Vec3d(side * 0.8, 0.0, 0.0), .normal = Vec3d(side, 0.0, 0.0)}};
}

Stroke brush_stroke() {
  Stroke stroke{.vertices = {}, .radius = 0.08};
  for (int i = 0; i < 40; ++i) stroke.vertices.emplace_back(-1.2 + 0.02 * i, 0.3 * std::sin(0.2 * i), 0.4);
  return stroke;
}

struct Size {
  const char* name;
  std::size_t samples;
};

void bench_size(BenchReport& report, const Size& size) {
  const auto name = [&](const char* what) { return std::string(what) + "." + size.name; };
  if (!report.wants(name("paint")) && !report.wants(name("scale_field")) &&
      !report.wants(name("edit.level0"))) {
    return;
  }
  const std::size_t n = size.samples;
  const auto items = static_cast<double>(n);
  const MultiresSurface surface = one_band_surface(ordered_scan(n));
  const Level& base = surface.levels[0];
  const Level& finest = surface.finest();
  const double area = 4.0 * std::numbers::pi * std::numbers::pi * 0.4;
  const std::vector<float> spacing(n, static_cast<float>(std::sqrt(area / items)));
  const Vec3d origin = Vec3d::Zero();

  Marks marks(n, 0);
  const PaintSurface painted_on{.position = finest.position, .normal = finest.normal, .origin = origin};
  paint(half(1.0), RegionKind::kZero, painted_on, marks);
  paint(half(-1.0), RegionKind::kOne, painted_on, marks);
  const PaintOperation brush{.shape = brush_stroke(), .steal = true};
  const PaintedField before =
      PaintedField::make(base.position, spacing, marks, origin, Blend::kQuartic).value();
  report.time(name("paint"), "ms", items, [&] {
    Marks painted = marks;
    paint(brush, RegionKind::kOne, painted_on, painted);
    if (!before.repainted(base.position, spacing, painted, origin)) std::abort();
  });

  const RegionPair regions = regions_from_marks(base.position, spacing, marks, origin).value();
  report.time(name("scale_field"), "ms", items,
              [&] { compute_scale_field(base.position, regions, Blend::kQuartic); });

  // Every sample moves: the field of a drag that holds next to nothing.
  ScaleField field = compute_scale_field(base.position, regions, Blend::kQuartic);
  for (std::size_t i = 0; i < n; ++i) field.t[i] = 0.5F + 0.5F * field.t[i];
  const EditParams params{.deformation = Rotation{.axis = Vec3d(1.0, 2.0, 3.0), .angle_rad = 1.0}};
  const NeighborGraph graph = build_neighbor_graph(finest.position, 10);
  const EditPlan plan(surface, graph, params, field);
  MultiresSurface edited = surface;
  report.time(name("edit.level0"), "ms", items,
              [&] { apply_edit(surface, plan, params, field, origin, edited); });
}

void bench_region_query(BenchReport& report) {
  if (!report.wants("region.query.50k")) return;
  const Cloud cloud = ordered_scan(437'645);
  Points centers(50'000);
  for (std::size_t i = 0; i < centers.size(); ++i) centers.set(i, cloud.position[i * 8]);
  const Region region(centers, std::vector<float>(centers.size(), 0.004F));
  const auto queries = static_cast<double>(cloud.size());
  // Coherent points a little way off the balls, so that no query ends early inside one.
  Points queried(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) queried.set(i, 1.05F * cloud.position[i]);
  report.time("region.query.50k", "us/point", queries, [&] {
    std::uint32_t hint = 0;
    for (std::size_t i = 0; i < queried.size(); ++i) static_cast<void>(region.distance(queried[i], hint));
  });
  report.time("region.query_many.50k", "us/point", queries, [&] {
    RegionDistances distances;
    region.distances(queried, 0, queried.size(), distances);
  });
}

// Half of the samples, with a ragged border.
void bench_cover(BenchReport& report, const Size& size) {
  const std::string name = std::string("cover.") + size.name;
  if (!report.wants(name)) return;
  const Cloud cloud = ordered_scan(size.samples);
  SampleMask members(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3f p = cloud.position[i];
    const float border = 0.02F * std::sin(90.0F * p.y()) + 0.02F * std::sin(170.0F * p.z() + 30.0F * p.y());
    members[i] = p.x() > border ? 1 : 0;
  }
  report.time(name, "ms", static_cast<double>(cloud.size()),
              [&] { ball_cover(cloud.position, members, cloud.origin); });
}

// An outline around the front of half of the torus.
void bench_visible(BenchReport& report, const Size& size) {
  const std::string name = std::string("paint.visible.") + size.name;
  if (!report.wants(name)) return;
  const MultiresSurface surface = one_band_surface(ordered_scan(size.samples));
  const Level& finest = surface.finest();
  const NeighborGraph graph = build_neighbor_graph(finest.position, 10);
  const Vec3d origin = Vec3d::Zero();
  const PaintSurface painted_on{
      .position = finest.position, .normal = finest.normal, .origin = origin, .graph = &graph};
  // The eye at (0, 0, 4), looking down; the torus reaches to 1.4.
  const PaintOperation operation{
      .shape = ScreenShape{.view = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, -1.02, 3.88, 0, 0, -1, 4},
                           .outline = ScreenPolygon{.vertices = {{-1, -1}, {0, -1}, {0, 1}, {-1, 1}}},
                           .visible = true}};
  report.time(name, "ms", static_cast<double>(size.samples), [&] {
    Marks marks(size.samples, 0);
    paint(operation, RegionKind::kZero, painted_on, marks);
  });
}

// A region from an image that lies across the scan, and one from another scan of the same size.
void bench_outside_data(BenchReport& report) {
  if (!report.wants("paint.image.2m") && !report.wants("paint.model.2m")) return;
  const Cloud scan = ordered_scan(2'000'000);
  const auto items = static_cast<double>(scan.size());
  const PaintSurface surface{.position = scan.position, .normal = scan.normal, .origin = Vec3d::Zero()};
  Image image{.width = 2048, .height = 2048, .channels = 4, .values = {}};
  image.values.resize(value_bytes(image));
  for (std::size_t i = 0; i < image.values.size(); ++i)
    image.values[i] = static_cast<std::byte>(i % 4 == 3 ? 255 : (i >> 9U) & 255U);
  const PaintOperation by_image{
      .shape = ImageShape{.source = {},
                          .image = std::make_shared<const Image>(std::move(image)),
                          .projection = PlanarProjection{.origin = Vec3d(-1.5, -1.5, 0.0),
                                                         .u = Vec3d(3.0, 0.0, 0.0),
                                                         .v = Vec3d(0.0, 3.0, 0.0),
                                                         .depth = std::nullopt}}};
  report.time("paint.image.2m", "ms", items, [&] {
    Marks marks(scan.size(), 0);
    paint(by_image, RegionKind::kOne, surface, marks);
  });
  ModelShape model{.source = {}, .cloud = std::make_shared<const Cloud>(scan), .thickness = 0.01};
  model.matrix[3] = 0.7;  // two rings, one through the other
  const PaintOperation by_model{.shape = std::move(model)};
  report.time("paint.model.2m", "ms", items, [&] {
    Marks marks(scan.size(), 0);
    paint(by_model, RegionKind::kOne, surface, marks);
  });
}

}  // namespace

void bench_editing(BenchReport& report) {
  bench_region_query(report);
  for (const Size& size : {Size{"150k", 150'000}, Size{"2m", 2'000'000}}) {
    bench_cover(report, size);
    bench_visible(report, size);
  }
  bench_outside_data(report);
  for (const Size& size : {Size{"148k", 148'000}, Size{"437k", 437'645}, Size{"2m", 2'000'000}}) {
    bench_size(report, size);
  }
}

}  // namespace pointwright::bench
