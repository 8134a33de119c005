#include "engine/multires/hierarchy.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

Hierarchy built(const Cloud& cloud, const HierarchyParams& params = {}) {
  auto result = build_hierarchy(cloud, params, {});
  REQUIRE_MESSAGE(result.ok(), result.error().message);
  return std::move(result).value();
}

// The largest |p_{k+1} - (p_k + d_k n_k)| of all bands over the diagonal, or over the largest coordinate
// where that is more: floats have no finer steps there. Infinite where anything is not finite or a normal is
// not unit.
double identity_error(const Cloud& cloud, const Hierarchy& hierarchy) {
  const MultiresSurface& surface = hierarchy.surface;
  const Box3f box = bounds_of(cloud.position);
  const double size = static_cast<double>(
      std::max({box.diagonal(), box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff()}));
  double worst = 0.0;
  for (std::size_t band = 0; band < surface.band_count(); ++band) {
    const Level& base = surface.levels[band];
    const Level& above = surface.levels[band + 1];
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3d again = base.position[i].cast<double>() +
                          static_cast<double>(surface.detail[band][i]) * base.normal[i].cast<double>();
      const double error = (again - above.position[i].cast<double>()).norm();
      const bool units =
          std::abs(base.normal[i].norm() - 1.0F) < 1e-5F && std::abs(above.normal[i].norm() - 1.0F) < 1e-5F;
      if (!std::isfinite(error) || !units) return std::numeric_limits<double>::infinity();
      worst = std::max(worst, error);
    }
  }
  return size > 0.0 ? worst / size : worst;
}

void check_shapes(const Cloud& cloud, const Hierarchy& hierarchy, std::size_t bands = 1) {
  REQUIRE(hierarchy.surface.levels.size() == bands + 1);
  REQUIRE(hierarchy.surface.detail.size() == bands);
  REQUIRE(hierarchy.reports.size() == bands);
  CHECK(hierarchy.surface.band_count() == bands);
  CHECK(hierarchy.surface.sample_count() == cloud.size());
  for (const Level& level : hierarchy.surface.levels) {
    CHECK(level.position.size() == cloud.size());
    CHECK(level.normal.size() == cloud.size());
  }
  for (const std::vector<float>& detail : hierarchy.surface.detail) CHECK(detail.size() == cloud.size());
  CHECK(hierarchy.spacing.size() == cloud.size());
  CHECK(hierarchy.graph.count == cloud.size());
  CHECK(hierarchy.surface.finest().position == cloud.position);
}

Surface rippled(const Surface& surface) {
  return displaced(surface, [](const Vec3d& p) {
    return 0.004 * std::sin(31.0 * p.x()) * std::sin(31.0 * p.y()) * std::cos(31.0 * p.z());
  });
}

TEST_CASE("reconstruction without a deformation gives the input back") {
  const std::vector<Surface> surfaces{sphere(5'000, 1.0, Sampling::kRandom),
                                      rippled(torus(10'000, 1.0, 0.4, Sampling::kRegular)),
                                      wave(70, 0.03, Sampling::kJittered, 0.03, 0.4),
                                      bumpy_sphere(6'000, {}),
                                      cube(25, 1.0),
                                      parallel_sheets(40, 0.02, 0.03, Sampling::kRandom),
                                      with_noise(hemisphere(4'000, 1.0), 0.01),
                                      plane(40, 1.0, Sampling::kRegular)};
  for (const Surface& surface : surfaces) {
    for (const Cloud& cloud : {to_cloud(surface.position), to_cloud(surface)}) {
      for (const float scale : {0.0001F, 0.01F, 0.05F}) {
        CAPTURE(scale);
        const Hierarchy hierarchy = built(cloud, {.scales = {scale}});
        check_shapes(cloud, hierarchy);
        CHECK(identity_error(cloud, hierarchy) < 1e-6);
      }
    }
  }
}

TEST_CASE("degenerate clouds have a hierarchy without a number that is not one") {
  const std::vector<Points> clouds{identical(1, {1, 2, 3}),
                                   identical(2, {1, 2, 3}),
                                   identical(5000, {1, 2, 3}),
                                   from_list({{0, 0, 0}, {1, 0, 0}}),
                                   from_list({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}),
                                   from_list({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}),
                                   from_list({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}}),
                                   from_list({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}),
                                   collinear(20, {0, 0, 0}, {1, 1, 1}),
                                   collinear(3000, {0, 0, 0}, {1, 0, 0}),
                                   plane(30, 1.0, Sampling::kRegular).position,
                                   plane(30, 1.0, Sampling::kRandom).position};
  for (std::size_t c = 0; c < clouds.size(); ++c) {
    CAPTURE(c);
    const Cloud cloud = to_cloud(clouds[c]);
    for (const float scale : {0.0001F, 0.02F, 0.2F}) {
      CAPTURE(scale);
      const Hierarchy hierarchy = built(cloud, {.scales = {scale}});
      check_shapes(cloud, hierarchy);
      CHECK(identity_error(cloud, hierarchy) < 1e-6);
      for (const float d : hierarchy.surface.detail[0]) CHECK(std::isfinite(d));
      for (const float h : hierarchy.spacing) CHECK(std::isfinite(h));
    }
    const Hierarchy bands = built(cloud, {.scales = {0.1F, 0.02F, 0.0001F}});
    check_shapes(cloud, bands, 3);
    CHECK(identity_error(cloud, bands) < 1e-6);
  }
}

TEST_CASE("any finite cloud has a hierarchy") {
  // Clusters, noise that fills a volume, lattices, duplicates and strands, with any normals: nothing here is
  // a surface, and still there is an answer and the identity holds.
  Random random(2024);
  for (int trial = 0; trial < 120; ++trial) {
    CAPTURE(trial);
    const std::size_t count = 1 + random.below(trial % 4 == 0 ? 2000 : 120);
    const std::size_t clusters = 1 + random.below(8);
    const double spread = std::exp(random.uniform(-12.0, 0.0));
    std::vector<Vec3d> centers;
    for (std::size_t c = 0; c < clusters; ++c) centers.push_back(random.uniform() * random.direction());
    Surface surface{Points(count), Points(count)};
    for (std::size_t i = 0; i < count; ++i) {
      Vec3d p = centers[random.below(clusters)] +
                spread * Vec3d(random.normal(), trial % 3 == 0 ? 0.0 : random.normal(), random.normal());
      if (trial % 5 == 0) p = (p * 10.0).array().round() / 10.0;
      surface.position.set(i, p.cast<float>());
      surface.normal.set(i, random.direction().cast<float>());
    }
    surface = coherent(surface);
    const Cloud cloud = trial % 2 == 0 ? to_cloud(surface.position) : to_cloud(surface);
    const auto scale = static_cast<float>(std::exp(random.uniform(std::log(1e-4), std::log(0.2))));
    CAPTURE(count);
    CAPTURE(scale);
    const auto result = build_hierarchy(cloud, {.scales = {scale}}, {});
    if (!result.ok()) FAIL_CHECK(result.error().message);
    if (!result.ok()) continue;
    CHECK(identity_error(cloud, result.value()) < 1e-6);
  }
}

TEST_CASE("objects that are far smaller than the scale have a hierarchy") {
  // Forty small spheres: a grid cell holds all of one, and no smoothing joins two.
  std::vector<Surface> parts;
  Random random(5);
  for (int part = 0; part < 40; ++part) {
    parts.push_back(
        moved(sphere(200, 0.02, Sampling::kRegular), 5.0 * random.uniform() * random.direction()));
  }
  const Cloud cloud = to_cloud(joined(parts).position);
  for (const float scale : {0.001F, 0.01F, 0.05F, 0.2F}) {
    CAPTURE(scale);
    CHECK(identity_error(cloud, built(cloud, {.scales = {scale}})) < 1e-6);
  }
}

TEST_CASE("closed smooth surfaces are decomposed without any failure") {
  for (const Surface& surface : {bumpy_sphere(20'000, {.count = 500, .height = 0.008, .width = 0.04}),
                                 rippled(sphere(20'000, 1.0, Sampling::kRandom)),
                                 rippled(torus(30'000, 1.0, 0.4, Sampling::kRegular))}) {
    const Hierarchy hierarchy = built(to_cloud(surface.position), {.scales = {0.03F}});
    const DecompositionReport& report = hierarchy.reports[0];
    CHECK(report.at_limit == 0);
    CHECK(report.fallback == 0);
    CHECK(report.flipped == 0);
    CHECK(hierarchy.component_count == 1);
    CHECK(report.base_samples < surface.size());
    CHECK(relative_error(static_cast<double>(report.scale),
                         0.03 * static_cast<double>(bounds_of(surface.position).diagonal())) < 0.01);
    float largest = 0.0F;
    for (const float d : hierarchy.surface.detail[0]) largest = std::max(largest, std::abs(d));
    CHECK(report.max_detail == largest);
    CHECK(report.rms_detail <= largest);
    CHECK(report.rms_detail > 0.0F);
    CHECK(count_opposed(hierarchy.surface.levels[0].normal, hierarchy.surface.levels[1].normal) == 0);
  }
}

TEST_CASE("many bands: each level is the base of the next finer one, at the scale asked for") {
  for (const Surface& surface : {bumpy_sphere(30'000, {.count = 500, .height = 0.008, .width = 0.04}),
                                 rippled(torus(30'000, 1.0, 0.4, Sampling::kRandom))}) {
    const Cloud cloud = to_cloud(surface.position);
    const HierarchyParams params{.scales = {0.06F, 0.03F, 0.015F}};
    const Hierarchy hierarchy = built(cloud, params);
    check_shapes(cloud, hierarchy, 3);
    CHECK(identity_error(cloud, hierarchy) < 1e-6);
    const auto diagonal = static_cast<double>(bounds_of(cloud.position).diagonal());
    for (std::size_t band = 0; band < 3; ++band) {
      CAPTURE(band);
      const DecompositionReport& report = hierarchy.reports[band];
      CHECK(report.at_limit == 0);
      CHECK(report.fallback == 0);
      CHECK(report.flipped == 0);
      CHECK(relative_error(static_cast<double>(report.scale),
                           static_cast<double>(params.scales[band]) * diagonal) < 0.02);
      CHECK(count_opposed(hierarchy.surface.levels[band].normal, hierarchy.surface.finest().normal) == 0);
    }
    // The finest band is that of a hierarchy with this band alone, to the bit.
    const Hierarchy alone = built(cloud, {.scales = {0.015F}});
    CHECK(alone.surface.levels[0] == hierarchy.surface.levels[2]);
    CHECK(alone.surface.detail[0] == hierarchy.surface.detail[2]);
  }
}

TEST_CASE("each band holds the waves between its scales") {
  // Two waves across each other, of 0.16 and 0.64: the scales stand between and beyond them. A Gaussian of
  // standard deviation s leaves exp(-2 pi^2 s^2 / L^2) of a wave of length L.
  constexpr double kPi = 3.14159265358979323846;
  constexpr double kShort = 0.16;
  constexpr double kLong = 0.64;
  constexpr double kHeight = 0.004;
  const Surface flat = plane(256, 0.01, Sampling::kJittered);
  const Surface surface = displaced(flat, [](const Vec3d& p) {
    return kHeight * (std::sin(2.0 * kPi * p.x() / kShort) + std::sin(2.0 * kPi * p.y() / kLong));
  });
  const Cloud cloud = to_cloud(surface);
  const auto diagonal = static_cast<double>(bounds_of(cloud.position).diagonal());
  const Hierarchy hierarchy =
      built(cloud, {.scales = {static_cast<float>(0.30 / diagonal), static_cast<float>(0.08 / diagonal)}});
  // Least-squares amplitudes of both waves in a level's heights, away from the border.
  const auto amplitude = [&](const Level& level, bool along_x, double length) {
    double sum = 0.0;
    double squares = 0.0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3d p = cloud.position[i].cast<double>();
      if (std::abs(p.x()) > 0.64 || std::abs(p.y()) > 0.64) continue;
      const double s = std::sin(2.0 * kPi * (along_x ? p.x() : p.y()) / length);
      sum += s * static_cast<double>(level.position[i].z());
      squares += s * s;
    }
    return sum / squares / kHeight;
  };
  const auto kept = [&](double scale, double length) {
    return std::exp(-2.0 * kPi * kPi * scale * scale / (length * length));
  };
  const std::vector<Level>& levels = hierarchy.surface.levels;
  MESSAGE("of the short and the long wave level 1 keeps "
          << amplitude(levels[1], true, kShort) << ", " << amplitude(levels[1], false, kLong) << ", level 0 "
          << amplitude(levels[0], true, kShort) << ", " << amplitude(levels[0], false, kLong));
  CHECK(std::abs(amplitude(levels[2], true, kShort) - 1.0) < 0.01);
  CHECK(std::abs(amplitude(levels[1], true, kShort) - kept(0.08, kShort)) < 0.05);
  CHECK(std::abs(amplitude(levels[1], false, kLong) - kept(0.08, kLong)) < 0.05);
  CHECK(std::abs(amplitude(levels[0], true, kShort)) < 0.02);
  CHECK(std::abs(amplitude(levels[0], false, kLong) - kept(0.30, kLong)) < 0.05);
}

TEST_CASE("uploaded normals are kept to the bit where they are unit, and made unit where they are not") {
  Surface surface = sphere(3'000, 1.0, Sampling::kRandom);
  surface.normal = scrambled_signs(surface.normal, 6);  // a file may say what it likes
  Cloud cloud = to_cloud(surface);
  CHECK(built(cloud).surface.finest().normal == surface.normal);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.normal.set(i, 3.0F * surface.normal[i]);
  cloud.normal.set(7, {0.0F, 0.0F, 0.0F});
  cloud.normal.set(8, {std::nanf(""), 0.0F, 0.0F});
  cloud.normal.set(9, {std::numeric_limits<float>::infinity(), 0.0F, 0.0F});
  const Points normal = built(cloud).surface.finest().normal;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    CHECK(std::abs(normal[i].norm() - 1.0F) < 1e-5F);
    if (i < 7 || i > 9) CHECK((normal[i] - surface.normal[i]).norm() < 1e-6F);
    if (i >= 7 && i <= 9) CHECK(line_angle(normal[i], surface.normal[i]) < 0.3);  // estimated instead
  }
}

TEST_CASE("parameters out of range are refused and named") {
  const Cloud cloud = to_cloud(sphere(100, 1.0, Sampling::kRandom));
  HierarchyParams params;
  std::string field = "scales";
  SUBCASE("no scale") {
    params.scales = {};
  }
  SUBCASE("scale zero") {
    params.scales = {0.0F};
  }
  SUBCASE("scale negative") {
    params.scales = {-0.01F};
  }
  SUBCASE("scale too small") {
    params.scales = {0.00009F};
  }
  SUBCASE("scale too large") {
    params.scales = {0.21F};
  }
  SUBCASE("scale not a number") {
    params.scales = {std::nanf("")};
  }
  SUBCASE("scale infinite") {
    params.scales = {std::numeric_limits<float>::infinity()};
  }
  SUBCASE("scales that ascend") {
    params.scales = {0.01F, 0.02F};
  }
  SUBCASE("scales that are all but the same") {
    params.scales = {0.02F, 0.0195F};
  }
  SUBCASE("too many scales") {
    params.scales = {0.2F, 0.15F, 0.1F, 0.08F, 0.06F, 0.04F, 0.03F, 0.02F, 0.01F};
  }
  SUBCASE("too few neighbours") {
    params.neighbors = 3, field = "neighbors";
  }
  SUBCASE("too many neighbours") {
    params.neighbors = 33, field = "neighbors";
  }
  CHECK(validate(params).error().code == ErrorCode::kInvalidArgument);
  const auto result = build_hierarchy(cloud, params, {});
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kInvalidArgument);
  CHECK(result.error().field == field);
}

TEST_CASE("the ends of the ranges are allowed") {
  CHECK(validate({.scales = {0.0001F}, .neighbors = 4}).ok());
  CHECK(validate({.scales = {0.2F, 0.15F, 0.1F, 0.08F, 0.06F, 0.04F, 0.03F, 0.02F}}).ok());
  CHECK(validate({.scales = {0.2F}, .neighbors = 32}).ok());
}

TEST_CASE("a cloud without samples is refused") {
  const auto result = build_hierarchy(Cloud{}, {}, {});
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kEmptyCloud);
}

bool same(const Hierarchy& a, const Hierarchy& b) {
  bool reports = a.reports.size() == b.reports.size();
  for (std::size_t i = 0; reports && i < a.reports.size(); ++i) {
    const DecompositionReport& u = a.reports[i];
    const DecompositionReport& v = b.reports[i];
    reports = u.scale == v.scale && u.base_samples == v.base_samples && u.at_limit == v.at_limit &&
              u.fallback == v.fallback && u.flipped == v.flipped && u.mean_iterations == v.mean_iterations &&
              u.max_detail == v.max_detail && u.rms_detail == v.rms_detail;
  }
  return reports && a.surface.levels == b.surface.levels && a.surface.detail == b.surface.detail &&
         a.graph.lanes == b.graph.lanes && a.graph.k == b.graph.k && a.spacing == b.spacing &&
         a.component_count == b.component_count;
}

TEST_CASE("the hierarchy has the same bytes for any thread count") {
  const Cloud cloud = to_cloud(with_noise(torus(40'000, 1.0, 0.4, Sampling::kRandom), 0.003).position);
  const HierarchyParams params{.scales = {0.05F, 0.02F}};
  Hierarchy one;
  with_threads(1, [&] { one = built(cloud, params); });
  for (const int threads : {2, 8}) {
    CAPTURE(threads);
    with_threads(threads, [&] { CHECK(same(built(cloud, params), one)); });
  }
}

TEST_CASE("moving the origin by whole grid cells changes nothing") {
  const Surface surface = rippled(torus(10'000, 1.0, 0.4, Sampling::kRandom));
  Cloud cloud = to_cloud(surface.position);
  const Hierarchy here = built(cloud);
  const double cell =
      0.7 * static_cast<double>(HierarchyParams{}.scales[0] * bounds_of(cloud.position).diagonal());
  cloud.origin = cell * Vec3d(12'000.0, -30'000.0, 77.0);
  CHECK(same(built(cloud), here));
}

TEST_CASE("the size of the model does not matter") {
  // Powers of two: every float keeps its mantissa, so that the result is the same, to the bit, in other
  // units.
  const Cloud cloud = to_cloud(rippled(torus(10'000, 1.0, 0.4, Sampling::kRandom)).position);
  const Hierarchy reference = built(cloud);
  for (const float factor : {0x1.0p-20F, 0x1.0p20F}) {
    CAPTURE(factor);
    Cloud scaled = cloud;
    for (std::size_t i = 0; i < cloud.size(); ++i) scaled.position.set(i, factor * cloud.position[i]);
    const Hierarchy hierarchy = built(scaled);
    CHECK(hierarchy.surface.finest().normal == reference.surface.finest().normal);
    CHECK(hierarchy.surface.levels[0].normal == reference.surface.levels[0].normal);
    CHECK(hierarchy.reports[0].fallback == reference.reports[0].fallback);
    std::size_t different = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      different += hierarchy.surface.detail[0][i] != factor * reference.surface.detail[0][i] ? 1U : 0U;
    }
    CHECK(different == 0);
  }
}

TEST_CASE("work that is cancelled before it starts ends at once") {
  const Cloud cloud = to_cloud(sphere(60'000, 1.0, Sampling::kRandom).position);
  const ExecutionContext context;
  context.cancel();
  const auto result = build_hierarchy(cloud, {}, context);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kCancelled);
}

TEST_CASE("a cancel from another thread ends the work in every phase") {
  const Cloud cloud = to_cloud(with_noise(torus(60'000, 1.0, 0.4, Sampling::kRandom), 0.003).position);
  for (const std::string phase : {"neighbours", "normals", "decomposition"}) {
    CAPTURE(phase);
    const ExecutionContext context;
    std::chrono::steady_clock::time_point cancelled_at;
    std::thread canceller([&] {
      while (context.progress().phase != phase) std::this_thread::sleep_for(std::chrono::microseconds(200));
      cancelled_at = std::chrono::steady_clock::now();
      context.cancel();
    });
    const auto result = build_hierarchy(cloud, {}, context);
    const auto ended_at = std::chrono::steady_clock::now();
    canceller.join();
    REQUIRE_FALSE(result.ok());
    CHECK(result.error().code == ErrorCode::kCancelled);
    CHECK(ended_at - cancelled_at < std::chrono::milliseconds(1500));  // on a machine that is busy otherwise
  }
}

TEST_CASE("progress never decreases and ends at the whole") {
  const Cloud cloud = to_cloud(torus(40'000, 1.0, 0.4, Sampling::kRandom).position);
  const ExecutionContext context;
  std::atomic<bool> done{false};
  std::vector<Progress> seen;
  std::thread watcher([&] {
    while (!done) {
      seen.push_back(context.progress());
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
  });
  const auto result = build_hierarchy(cloud, {}, context);
  done = true;
  watcher.join();
  REQUIRE(result.ok());
  REQUIRE_FALSE(seen.empty());
  for (std::size_t i = 1; i < seen.size(); ++i) CHECK(seen[i].fraction >= seen[i - 1].fraction);
  for (const Progress& progress : seen) CHECK((progress.fraction >= 0.0 && progress.fraction <= 1.0));
  CHECK(context.progress().fraction == 1.0);
}

}  // namespace
}  // namespace pointwright
