#include "engine/multires/decomposition.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/all_machines.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

struct Run {
  Surface surface;
  Decomposition parts;
  double spacing = 0.0;
  double diagonal = 0.0;
};

Run run(const Surface& surface, double scale, const DecomposeParams& params = {}) {
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  std::vector<float> spacing = local_spacing(surface.position, graph);
  const auto middle = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2);
  std::nth_element(spacing.begin(), middle, spacing.end());
  auto base =
      build_base_surface(surface.position, surface.normal, Vec3d::Zero(), static_cast<float>(scale), {});
  REQUIRE(base.ok());
  auto parts = decompose(surface.position, surface.normal, base.value(), *middle, params, {});
  REQUIRE(parts.ok());
  return {surface, std::move(parts).value(), static_cast<double>(*middle),
          static_cast<double>(bounds_of(surface.position).diagonal())};
}

const std::vector<std::pair<Surface, double>>& smooth_surfaces() {
  const auto ripple = [](const Vec3d& p) {
    return 0.004 * std::sin(31.0 * p.x()) * std::sin(31.0 * p.y()) * std::cos(31.0 * p.z());
  };
  static const std::vector<std::pair<Surface, double>> surfaces{
      {bumpy_sphere(20'000, {.count = 500, .height = 0.008, .width = 0.04}), 0.1},
      {displaced(sphere(20'000, 1.0, Sampling::kRandom), ripple), 0.12},
      {displaced(torus(30'000, 1.0, 0.4, Sampling::kRegular), ripple), 0.1},
      {displaced(torus(30'000, 1.0, 0.4, Sampling::kRandom), ripple), 0.1},
      {wave(120, 0.02, Sampling::kJittered, 0.02, 0.4), 0.1}};
  return surfaces;
}

TEST_CASE("a sample is its base point plus the detail along the base's normal") {
  for (const auto& [surface, scale] : smooth_surfaces()) {
    const Run result = run(surface, scale);
    double worst = 0.0;
    double worst_unit = 0.0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
      const Vec3d again = result.parts.base[i].cast<double>() +
                          static_cast<double>(result.parts.detail[i]) * result.parts.normal[i].cast<double>();
      worst = std::max(worst, (again - surface.position[i].cast<double>()).norm());
      worst_unit = std::max(worst_unit, std::abs(static_cast<double>(result.parts.normal[i].norm()) - 1.0));
    }
    CHECK(worst < 1e-6 * result.diagonal);
    CHECK(worst_unit < 1e-6);
  }
}

TEST_CASE("on closed and smooth surfaces with small bumps every iteration converges") {
  for (const auto& [surface, scale] : smooth_surfaces()) {
    const Decomposition parts = run(surface, scale).parts;
    CHECK(parts.at_limit == 0);
    CHECK(parts.fallback == 0);
    CHECK(parts.flipped == 0);
    CHECK(parts.mean_iterations < 4.0);
    CHECK(parts.mean_iterations > 1.0);
  }
}

TEST_CASE("the displacement stands on the base surface at a right angle") {
  // Base points of neighbouring samples span the base surface: the steps between them lie in its tangent
  // planes, but for the curvature, at most 1 / (minor radius), over half a step, and the tolerance of the
  // iteration.
  for (const auto& [surface, curvature] :
       {std::pair{bumpy_sphere(20'000, {.count = 500, .height = 0.008, .width = 0.04}), 1.1},
        std::pair{torus(20'000, 1.0, 0.4, Sampling::kRegular), 2.8}}) {
    const Run result = run(surface, 0.1);
    const NeighborGraph graph = build_neighbor_graph(surface.position, 6);
    std::size_t steep = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
      for (std::uint32_t j = 0; j < 6; ++j) {
        const Vec3d step = (result.parts.base[graph.index(i, j)] - result.parts.base[i]).cast<double>();
        if (step.norm() < 0.2 * result.spacing) continue;
        ++count;
        const double sine = std::abs(step.dot(result.parts.normal[i].cast<double>())) / step.norm();
        if (sine > 0.02 + 0.75 * curvature * step.norm()) ++steep;
      }
    }
    CHECK(count > surface.size());
    CHECK(steep <= count / 200);
  }
}

TEST_CASE("base points move no faster than their samples") {
  // |dr| / |dp| between neighbours: about 1, and jumps to another sheet would show as large values.
  // The 99.9th percentile, since steep bumps bring some neighbours close together above the base.
  for (const auto& [surface, scale] : smooth_surfaces()) {
    const Run result = run(surface, scale);
    const NeighborGraph graph = build_neighbor_graph(surface.position, 6);
    std::vector<double> ratio;
    for (std::size_t i = 0; i < surface.size(); ++i) {
      for (std::uint32_t j = 0; j < 6; ++j) {
        const std::uint32_t q = graph.index(i, j);
        const double before = static_cast<double>((surface.position[q] - surface.position[i]).norm());
        ratio.push_back(static_cast<double>((result.parts.base[q] - result.parts.base[i]).norm()) / before);
      }
    }
    const auto at = ratio.begin() + static_cast<std::ptrdiff_t>(ratio.size() * 999 / 1000);
    std::nth_element(ratio.begin(), at, ratio.end());
    CHECK(*at < 1.5);
  }
}

TEST_CASE("a bump pattern below the scale comes back as the detail coefficients") {
  // At half the distance of the bumps exp(-2 pi^2 / 4) = 0.7 % of the pattern stays in the base. The rest of
  // the error is the base's own unevenness, 4 % of s^2 / R on a sphere: a larger scale would measure that
  // instead.
  const Bumps bumps{.count = 800, .height = 0.006, .width = 0.03};
  const double scale = 0.5 * bumps.spacing();
  const Surface surface = bumpy_sphere(40'000, bumps);
  const Run result = run(surface, scale);
  std::vector<double> pattern(surface.size());
  double pattern_mean = 0.0;
  double detail_mean = 0.0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    pattern[i] = static_cast<double>(surface.position[i].norm()) - 1.0;
    pattern_mean += pattern[i] / static_cast<double>(surface.size());
    detail_mean += static_cast<double>(result.parts.detail[i]) / static_cast<double>(surface.size());
  }
  double pp = 0.0;
  double dd = 0.0;
  double pd = 0.0;
  double error = 0.0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const double p = pattern[i] - pattern_mean;
    const double d = static_cast<double>(result.parts.detail[i]) - detail_mean;
    pp += p * p;
    dd += d * d;
    pd += p * d;
    error += (p - d) * (p - d);
  }
  MESSAGE("correlation " << pd / std::sqrt(pp * dd) << ", rms error over rms pattern "
                         << std::sqrt(error / pp) << ", mean detail " << detail_mean << ", scale^2 "
                         << scale * scale);
  CHECK(pd / std::sqrt(pp * dd) > 0.985);
  CHECK(std::sqrt(error / pp) < 0.16);
  // The mean: the base of a sphere lies s^2 / R below it.
  CHECK(relative_error(detail_mean, scale * scale) < 0.02);
}

TEST_CASE("where the walk may take no step, the tree finds the same base points") {
  const Surface surface = bumpy_sphere(10'000, {.count = 300, .height = 0.01, .width = 0.05});
  const Run walk = run(surface, 0.12);
  const Run tree = run(surface, 0.12, {.walk_limit = 0, .tree_limit = 100});
  CHECK(tree.parts.at_limit == 0);
  std::size_t apart = 0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const double distance = static_cast<double>((walk.parts.base[i] - tree.parts.base[i]).norm());
    if (distance > 0.02 * walk.spacing) ++apart;
  }
  CHECK(apart < surface.size() / 200);
}

TEST_CASE("an iteration without steps ends at the limit, keeps the identity and is counted") {
  const Surface surface = bumpy_sphere(5'000, {.count = 300, .height = 0.01, .width = 0.05});
  const Run result = run(surface, 0.15, {.walk_limit = 0, .tree_limit = 0});
  CHECK(result.parts.at_limit == surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Vec3f again = result.parts.base[i] + result.parts.detail[i] * result.parts.normal[i];
    CHECK((again - surface.position[i]).norm() < static_cast<float>(1e-6 * result.diagonal));
  }
}

TEST_CASE("samples with an opposed normal are counted as flipped and keep the identity") {
  Surface surface = sphere(5'000, 1.0, Sampling::kRegular);
  const NeighborGraph graph = build_neighbor_graph(surface.position, 10);
  auto base = build_base_surface(surface.position, surface.normal, Vec3d::Zero(), 0.2F, {});
  REQUIRE(base.ok());
  for (std::size_t i = 0; i < 50; ++i) surface.normal.set(i, -surface.normal[i]);  // after the base was built
  const auto parts = decompose(surface.position, surface.normal, base.value(), 0.05F, {}, {});
  REQUIRE(parts.ok());
  CHECK(parts.value().flipped == 50);
  CHECK(parts.value().fallback == 50);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Vec3f again = parts.value().base[i] + parts.value().detail[i] * parts.value().normal[i];
    CHECK((again - surface.position[i]).norm() < 3e-6F);
  }
}

TEST_CASE("the paper's start, damping and weights are there, and why they are not the default") {
  // Random samples make a base whose neighbour sets change unevenly.
  const Surface surface = displaced(torus(30'000, 1.0, 0.4, Sampling::kRandom), [](const Vec3d& p) {
    return 0.01 * std::sin(31.0 * p.x()) * std::sin(31.0 * p.y()) * std::cos(31.0 * p.z());
  });
  const Run best = run(surface, 0.1);
  const Run fixed = run(surface, 0.1, {.damping = Damping::kFixed});
  // A half of every step: from the first step on the residual is at least halved each time, a thousandth of
  // a spacing is about ten of them away.
  CHECK(best.parts.mean_iterations < 4.0);
  CHECK(fixed.parts.mean_iterations > 2.0 * best.parts.mean_iterations);
  // The same base points, wherever both converge.
  std::size_t apart = 0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if ((best.parts.base[i] - fixed.parts.base[i]).norm() > static_cast<float>(0.02 * best.spacing)) ++apart;
  }
  CHECK(apart < surface.size() / 1000);
  // A Gaussian that is wide at the border of the neighbourhood steps over its changes: limit cycles.
  const Run wide = run(surface, 0.1, {.weights = PlaneWeights::kGaussian, .sigma = 1.0F});
  const Run narrow = run(surface, 0.1, {.weights = PlaneWeights::kGaussian, .sigma = 0.35F});
  CHECK(wide.parts.at_limit > 10 * (best.parts.at_limit + 1));
  CHECK(narrow.parts.at_limit < wide.parts.at_limit / 5);
}

TEST_CASE("on a thin sheet the nearest sample of the base may be another sheet's") {
  // Bumps that reach beyond the gap's middle: their samples stand nearer to the other sheet's base.
  const double gap = 0.05;
  const Surface sheets = displaced(parallel_sheets(120, 0.01, gap, Sampling::kJittered), [&](const Vec3d& p) {
    const bool dented = std::abs(p.x()) < 0.03 && std::abs(p.y()) < 0.03;
    return dented && p.z() > 0.0 ? -0.7 * gap : 0.0;
  });
  const Run own = run(sheets, 0.06);
  const Run nearest = run(sheets, 0.06, {.start = IterationStart::kNearest});
  CHECK(own.parts.flipped == 0);
  CHECK(nearest.parts.flipped > 20);  // of the 36 or so samples of the dent
}

TEST_CASE("a sigma out of range is refused") {
  const Surface surface = sphere(500, 1.0, Sampling::kRandom);
  const auto base = build_base_surface(surface.position, surface.normal, Vec3d::Zero(), 0.3F, {});
  REQUIRE(base.ok());
  for (const float sigma : {0.0F, -1.0F, 101.0F, std::nanf("")}) {
    const auto refused =
        decompose(surface.position, surface.normal, base.value(), 0.1F, {.sigma = sigma}, {});
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().field == "sigma");
  }
}

TEST_CASE("a cancelled decomposition says so") {
  const Surface surface = sphere(2'000, 1.0, Sampling::kRegular);
  const auto base = build_base_surface(surface.position, surface.normal, Vec3d::Zero(), 0.2F, {});
  REQUIRE(base.ok());
  const ExecutionContext context;
  context.cancel();
  const auto parts = decompose(surface.position, surface.normal, base.value(), 0.05F, {}, context);
  REQUIRE_FALSE(parts.ok());
  CHECK(parts.error().code == ErrorCode::kCancelled);
}

TEST_CASE("the decomposition depends neither on the threads nor on the instruction set") {
  const Surface surface = bumpy_sphere(20'000, {.count = 300, .height = 0.01, .width = 0.05});
  for (const PlaneWeights weights : {PlaneWeights::kCompact, PlaneWeights::kGaussian}) {
    for_all_machines([&] { return run(surface, 0.12, {.weights = weights}).parts; },
                     [](const Decomposition& one, const Decomposition& parts) {
                       CHECK(parts.base == one.base);
                       CHECK(parts.normal == one.normal);
                       CHECK(parts.detail == one.detail);
                       CHECK(parts.mean_iterations == one.mean_iterations);
                     });
  }
}

}  // namespace
}  // namespace pointwright
