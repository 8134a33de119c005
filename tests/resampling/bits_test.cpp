// Which bits resampling promises: those of an edit without it, and the same on all machines.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "engine/multires/surface_delta.h"
#include "engine/resampling/resampled_drag.h"
#include "tests/resampling/resampling_support.h"
#include "tests/support/all_machines.h"
#include "tests/support/pulled_plane.h"

namespace pointwright {
namespace {

// A sphere with a band, its north raised along the normals.
test::EditScene raised_sphere(const ResamplingParams& resampling, std::size_t count = 4'000) {
  const Level base = test::level_of(test::sphere(count, 1.0, test::Sampling::kRegular));
  const MultiresSurface surface =
      test::one_band(base, [&](std::size_t i) { return 0.02F * std::sin(9.0F * base.position[i].x()); });
  return test::scene_of(
      surface, [](const Vec3f& p) { return p.z() < -0.3F  ? 1
                                           : p.z() > 0.6F ? 2
                                                          : 0; },
      test::resampling_by(NormalOffset{.distance = 1.5}, resampling));
}
test::EditScene pulled(std::size_t side) {
  const test::PulledPlane plane = test::pulled_plane(
      side, [](double x, double y) { return 0.01 * std::sin(60.0 * x) * std::cos(50.0 * y); });
  return {.surface = plane.surface,
          .sampling = plane.sampling,
          .regions = plane.regions,
          .params = plane.params,
          .field = plane.field};
}
test::EditScene squeezed() {
  test::EditScene scene = test::scene_of(
      {.levels = {test::level_of(test::plane(50, 0.04, test::Sampling::kJittered))}, .detail = {}},
      [](const Vec3f& p) { return p.norm() > 0.9F   ? 1
                                  : p.norm() < 0.5F ? 2
                                                    : 0; },
      test::resampling_by(Scaling{.factors = Vec3d(0.3, 2.0, 1.0)}, {.collect = 0.7}));
  return scene;
}

void check_originals(const test::EditScene& scene, ResamplingEffort effort) {
  const ResampledEdit edit = test::resampled(scene, effort);
  test::check_sound(edit);
  EditParams plain = scene.params;
  plain.resampling.reset();
  const MultiresSurface expected =
      apply_edit(scene.surface, *scene.sampling->graph, plain, scene.field, Vec3d::Zero());
  std::size_t changed = 0;
  std::size_t moved = 0;
  for (std::size_t k = 0; k < expected.levels.size(); ++k) {
    for (std::size_t i = 0; i < scene.sampling->size(); ++i) {
      const Level& now = edit.surface.levels[k];
      changed += test::same_sample(now.position, expected.levels[k].position, i) ? 0U : 1U;
      changed += test::same_sample(now.normal, expected.levels[k].normal, i) ? 0U : 1U;
      if (scene.field.t[i] > 0.0F) continue;
      moved += test::same_sample(now.position, scene.surface.levels[k].position, i) ? 0U : 1U;
      moved += test::same_sample(now.normal, scene.surface.levels[k].normal, i) ? 0U : 1U;
    }
  }
  CHECK(edit.inserted > 0);
  CHECK(changed == 0);
  CHECK(moved == 0);
}

TEST_CASE("samples that were there before get the bits of an edit without resampling") {
  for (const ResamplingEffort effort : {ResamplingEffort::kExact, ResamplingEffort::kPreview}) {
    check_originals(pulled(60), effort);
    check_originals(raised_sphere({}), effort);
    // Gains and a level above the coarsest.
    test::EditScene scene = raised_sphere({});
    scene.params.gains = {2.0F};
    check_originals(scene, effort);
    scene.params.gains.clear();
    scene.params.level = 1;
    scene.field = compute_scale_field(scene.surface.levels[1].position, scene.regions, Blend::kQuartic);
    check_originals(scene, effort);
  }
}

TEST_CASE("neighbours of the block that inserted samples begin in get their bits, too") {
  for (const std::size_t count : {4'001U, 4'009U, 4'015U})
    for (const ResamplingEffort effort : {ResamplingEffort::kExact, ResamplingEffort::kPreview})
      check_originals(raised_sphere({}, count), effort);
  check_originals(pulled(61), ResamplingEffort::kExact);
}

void check_same_bytes(const test::EditScene& scene, ResamplingEffort effort) {
  test::for_all_machines(
      [&] { return test::resampled(scene, effort); },
      [](const ResampledEdit& a, const ResampledEdit& b) { REQUIRE(test::same_bytes(a, b)); });
}

TEST_CASE("resampling gives the same bytes with any number of threads, on every instruction set") {
  for (const ResamplingEffort effort : {ResamplingEffort::kExact, ResamplingEffort::kPreview}) {
    check_same_bytes(pulled(60), effort);
    check_same_bytes(raised_sphere({.shear_aware = true}), effort);
    check_same_bytes(squeezed(), effort);
  }
  const ResampledEdit edit = test::resampled(squeezed());
  CHECK(edit.inserted > 0);
  CHECK(edit.removed > 0);
}

TEST_CASE("a second edit gives the same bytes with any number of threads too") {
  const test::EditScene scene = pulled(40);
  const ResampledEdit first = test::resampled(scene);
  check_same_bytes(test::scene_after(first, scene.regions,
                                     test::resampling_by(Rotation{.point = Vec3d(0.5, 0.5, 0.0),
                                                                  .axis = Vec3d(1.0, 0.0, 0.0),
                                                                  .angle_rad = 1.0},
                                                         {.collect = 0.6})),
                   ResamplingEffort::kExact);
}

TEST_CASE("frames of a drag are those of edits of their own, padding included, whatever frames came before") {
  test::EditScene scene = pulled(41);  // whole blocks and one sample more
  REQUIRE(scene.sampling->size() % kSimdBlock == 1);
  ResampledDrag drag(std::make_shared<const MultiresSurface>(scene.surface), scene.sampling, scene.params,
                     std::make_shared<const ScaleField>(scene.field), scene.regions);
  const auto frame = [&](double height, ResamplingEffort effort, MultiresSurface room) {
    scene.params.deformation = Translation{.vector = Vec3d(0.0, 0.0, height)};
    auto result = drag.frame(scene.params, effort, std::move(room));
    REQUIRE(result.ok());
    return std::move(result).value();
  };
  // Histories compare the padding too.
  const auto is_its_own = [&](const ResampledEdit& edit, ResamplingEffort effort) {
    const ResampledEdit own = test::resampled(scene, effort);
    return test::same_bytes(edit, own) && SurfaceDelta(edit.surface, own.surface).empty();
  };
  MultiresSurface room = frame(3.0, ResamplingEffort::kPreview, {}).surface;
  for (const double height : {1e-3, 2.0, 1.0, 1e-3, 3.0}) {
    for (const ResamplingEffort effort : {ResamplingEffort::kPreview, ResamplingEffort::kExact}) {
      CAPTURE(height);
      const ResampledEdit fresh = frame(height, effort, {});
      CHECK(is_its_own(fresh, effort));
      CHECK((fresh.inserted == 0) == (height == 1e-3));
      ResampledEdit reused = frame(height, effort, std::move(room));
      CHECK(is_its_own(reused, effort));
      room = std::move(reused.surface);
    }
  }
}

TEST_CASE("a preview inserts no more than comes in time, and collects nothing") {
  const test::EditScene large = pulled(300);
  const ResampledEdit preview = test::resampled(large, ResamplingEffort::kPreview);
  test::check_sound(preview);
  CHECK(preview.inserted > 50'000);
  CHECK(preview.inserted <= 100'000);
  const ResampledEdit exact = test::resampled(squeezed());
  const ResampledEdit small = test::resampled(squeezed(), ResamplingEffort::kPreview);
  CHECK(exact.removed > 0);
  CHECK(small.removed == 0);
  CHECK(small.inserted == exact.inserted);  // few enough: the same ones
  CHECK(test::resampled(squeezed(), ResamplingEffort::kPreview).surface.sample_count() ==
        small.sampling->size());
}

TEST_CASE("a cancelled edit says so") {
  const test::EditScene scene = pulled(30);
  ExecutionContext context;
  context.cancel();
  const auto result = apply_resampled_edit(scene.surface, scene.sampling, scene.params, scene.field,
                                           scene.regions, ResamplingEffort::kExact, &context);
  REQUIRE(!result.ok());
  CHECK(result.error().code == ErrorCode::kCancelled);
}

}  // namespace
}  // namespace pointwright
