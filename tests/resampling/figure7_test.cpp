// Figure 7: samples inserted into a plane that is pulled up.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/resampling/resampling_support.h"
#include "tests/support/pulled_plane.h"

namespace pointwright {
namespace {

constexpr auto kHeight = static_cast<float>(test::PulledPlane::kHeight);

// A band over the plane: a product of two waves.
double wave_at(double x, double y, double spacing) {
  constexpr double kTau = 2.0 * std::numbers::pi;
  return std::sin(kTau * x / (10.0 * spacing)) * std::sin(kTau * y / (8.0 * spacing));
}

// Where the samples of a plane that is pulled straight up stood before, exactly.
Points rest_of(const Points& pulled) {
  Points rest(pulled.size());
  for (std::size_t i = 0; i < pulled.size(); ++i) rest.set(i, {pulled[i].x(), pulled[i].y(), 0.0F});
  return rest;
}

Level random_plane(std::size_t count) {
  test::Random random(3);
  Level level{.position = Points(count), .normal = Points(count)};
  for (std::size_t i = 0; i < count; ++i) {
    level.position.set(i, Vec3d(random.uniform(), random.uniform(), 0.0).cast<float>());
    level.normal.set(i, Vec3f::UnitZ());
  }
  return level;
}

// All of the following is of samples with 0 < t < 1 alone: the others hide everything.
struct Pulled {
  test::Spacing spacing;
  double most = 0.0;  // greatest distance to the nearest other sample
  test::Holes holes;
  std::size_t off_surface = 0;
};
Pulled measured(const test::PulledPlane& scene, const ResampledEdit& edit, std::size_t dense) {
  const double wanted = std::max(scene.spacing, test::PulledPlane::kMinSpacing / 1.5);
  const Points& p = edit.surface.levels[0].position;
  const ScaleField field = compute_scale_field(rest_of(p), scene.regions, scene.params.blend);
  Pulled result;
  std::vector<std::uint8_t> between(p.size());
  for (std::size_t i = 0; i < p.size(); ++i) {
    between[i] = field.t[i] > 0.0F && field.t[i] < 1.0F ? 1 : 0;
    result.off_surface += p[i].z() == field.t[i] * kHeight ? 0U : 1U;
  }
  const Points stretched = test::selected(p, between);
  result.spacing = test::spacing_of(stretched, wanted);
  result.most = test::nearest_distances(stretched).back() / wanted;
  result.holes = test::holes_of(test::evenly_on_deformed(scene, random_plane(dense)), p, wanted);
  MESSAGE(edit.sampling->size() << " samples, nearest: min " << result.spacing.least << " mean "
                                << result.spacing.mean << " cv " << result.spacing.variation << " max/mean "
                                << result.most / result.spacing.mean << ", discs: " << result.holes.p999
                                << " / " << result.holes.most);
  return result;
}

// How far the texture coordinates of inserted samples are from where these stood at rest, in spacings.
double texture_error(const test::PulledPlane& scene, const Points& position,
                     const std::vector<TexCoord>& texcoord) {
  std::vector<double> error;
  for (std::size_t i = scene.sampling->size(); i < position.size(); ++i) {
    const auto u = static_cast<double>(texcoord[i][0] - position[i].x());
    const auto v = static_cast<double>(texcoord[i][1] - position[i].y());
    error.push_back(std::hypot(u, v) / scene.spacing);
  }
  return test::root_mean_square(error);
}
double detail_error(const test::PulledPlane& scene, const Points& position,
                    const std::vector<float>& detail) {
  std::vector<double> error;
  for (std::size_t i = scene.sampling->size(); i < position.size(); ++i)
    error.push_back(static_cast<double>(detail[i]) - wave_at(static_cast<double>(position[i].x()),
                                                             static_cast<double>(position[i].y()),
                                                             scene.spacing));
  return test::root_mean_square(error);
}

TEST_CASE("10,000 samples of a plane pulled up become those of Figure 7") {
  const test::PulledPlane scene = test::pulled_plane(100);
  const ResampledEdit edit = test::resampled(scene);
  test::check_sound(edit);
  CHECK(test::relative_error(static_cast<double>(edit.sampling->size()), 69'343.0) < 0.01);
  const Pulled pulled = measured(scene, edit, 400'000);
  CHECK(pulled.off_surface == 0);
  CHECK(pulled.spacing.mean > 0.86);
  CHECK(pulled.most < 1.6 * pulled.spacing.mean);
  CHECK(pulled.spacing.variation < 0.115);
  CHECK(pulled.holes.p999 < 0.85);
  CHECK(pulled.holes.most < 1.15);
  CHECK(texture_error(scene, edit.surface.levels[0].position, edit.sampling->cloud->texcoord) < 1e-4);
}

TEST_CASE("160,000 samples of a plane pulled up become those of Figure 7") {
  const test::PulledPlane scene = test::pulled_plane(400);
  const ResampledEdit edit = test::resampled(scene);
  CHECK(test::relative_error(static_cast<double>(edit.sampling->size()), 621'499.0) < 0.01);
  const Pulled pulled = measured(scene, edit, 1'000'000);
  CHECK(pulled.off_surface == 0);
  CHECK(pulled.spacing.mean > 0.55);
  CHECK(pulled.most < 1.9 * pulled.spacing.mean);
  CHECK(pulled.spacing.variation < 0.155);
  CHECK(pulled.holes.p999 < 0.65);
  CHECK(pulled.holes.most < 0.95);
  CHECK(texture_error(scene, edit.surface.levels[0].position, edit.sampling->cloud->texcoord) < 1e-4);
}

// What the paper does: averages of the ten nearest samples, where the deformation has put these.
struct Averaged {
  std::vector<TexCoord> texcoord;
  std::vector<float> detail;
};
Averaged averaged_among_deformed(const test::PulledPlane& scene, const ResampledEdit& edit) {
  const std::size_t before = scene.sampling->size();
  const Points& p = edit.surface.levels[0].position;
  Points originals(before);
  for (std::size_t i = 0; i < before; ++i) originals.set(i, p[i]);
  const KdTree tree(originals);
  const Cloud& cloud = *scene.sampling->cloud;
  Averaged result{.texcoord = cloud.texcoord, .detail = scene.surface.detail[0]};
  std::vector<Neighbor> found;
  for (std::size_t i = before; i < p.size(); ++i) {
    tree.nearest(p[i], 10, found);
    TexCoord sum{};
    float detail = 0.0F;
    float total = 0.0F;
    for (const Neighbor& near : found) {
      const float weight = std::exp(-4.0F * near.distance_sq / found.back().distance_sq);
      total += weight;
      detail += weight * scene.surface.detail[0][near.index];
      for (std::size_t axis = 0; axis < 2; ++axis) sum[axis] += weight * cloud.texcoord[near.index][axis];
    }
    result.texcoord.push_back({sum[0] / total, sum[1] / total});
    result.detail.push_back(detail / total);
  }
  return result;
}

TEST_CASE("texture and detail of a plane pulled up are not blurred") {
  const test::PulledPlane scene =
      test::pulled_plane(100, [](double x, double y) { return wave_at(x, y, 0.01); });
  const ResampledEdit edit = test::resampled(scene);
  test::check_sound(edit);
  const Points& p = edit.surface.levels[0].position;
  const Averaged paper = averaged_among_deformed(scene, edit);
  const double texture = texture_error(scene, p, edit.sampling->cloud->texcoord);
  const double detail = detail_error(scene, p, edit.surface.detail[0]);
  const double paper_texture = texture_error(scene, p, paper.texcoord);
  const double paper_detail = detail_error(scene, p, paper.detail);
  MESSAGE("texture " << texture << " (averages among deformed samples: " << paper_texture << "), detail "
                     << detail << " (" << paper_detail << ") of 0.5");
  CHECK(texture < 1e-4);
  CHECK(detail < 0.03 * 0.5);
  CHECK(paper_texture > 0.4);
  CHECK(paper_detail > 20.0 * detail);
  // Eq. (5) holds with it, to the bit.
  const Level& base = edit.surface.levels[0];
  std::size_t off = 0;
  for (std::size_t i = scene.sampling->size(); i < p.size(); ++i) {
    const Vec3f expected = base.position[i] + edit.surface.detail[0][i] * base.normal[i];
    off += (edit.surface.levels[1].position[i] - expected).norm() > 1e-5F ? 1U : 0U;
  }
  CHECK(off == 0);
}

}  // namespace
}  // namespace pointwright
