// What inserted samples are called and carry.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "tests/resampling/resampling_support.h"
#include "tests/support/pulled_plane.h"

namespace pointwright {
namespace {

// Smooth over twenty spacings of a plane of 10,000 samples.
double smooth(double x, double y) {
  return std::sin(31.4 * x) * std::cos(27.0 * y);
}
double smooth(const Vec3f& p) {
  return smooth(static_cast<double>(p.x()), static_cast<double>(p.y()));
}

// Figure 7's plane, without a floor under its spacing, with attributes of its samples.
test::PulledPlane plane_with(const std::function<void(Cloud&)>& change) {
  test::PulledPlane scene = test::pulled_plane(100);
  Cloud cloud = *scene.sampling->cloud;
  change(cloud);
  pointwright::Sampling sampling = *scene.sampling;
  sampling.cloud = std::make_shared<const Cloud>(std::move(cloud));
  scene.sampling = std::make_shared<const pointwright::Sampling>(std::move(sampling));
  return scene;
}

template <typename T, typename Make>
ScalarAttribute attribute(const std::string& name, const Cloud& cloud, const Make& make) {
  std::vector<T> values;
  for (std::size_t i = 0; i < cloud.size(); ++i) values.push_back(make(i));
  return {.name = name, .values = std::move(values)};
}
template <typename T>
const std::vector<T>& values_of(const Cloud& cloud, std::size_t index) {
  return std::get<std::vector<T>>(cloud.scalars[index].values);
}
Vec3f at_rest(const Cloud& cloud, std::size_t i) {
  return {cloud.position[i].x(), cloud.position[i].y(), 0.0F};
}

TEST_CASE("inserted samples have ids of their own and know their parents") {
  const test::PulledPlane scene = test::pulled_plane(60);
  const std::size_t n = scene.sampling->size();
  const ResampledEdit edit = test::resampled(scene);
  const pointwright::Sampling& sampling = *edit.sampling;
  CHECK(scene.sampling->parent.empty());
  REQUIRE(sampling.parent.size() == n + edit.inserted);
  CHECK(scene.sampling->next_id == n);
  CHECK(sampling.next_id == n + edit.inserted);
  for (std::size_t i = 0; i < sampling.size(); ++i) {
    REQUIRE(sampling.cloud->id[i] == (i < n ? scene.sampling->cloud->id[i] : static_cast<std::uint32_t>(i)));
    if (i < n) {
      REQUIRE(sampling.parent[i] == kNoParent);
      REQUIRE(sampling.spacing[i] == scene.sampling->spacing[i]);
    } else {
      REQUIRE(sampling.parent[i] < n);
    }
  }
  // A second edit goes on counting; parents may be inserted samples.
  EditParams again = scene.params;
  again.deformation = Scaling{.factors = Vec3d(1.0, 1.0, 3.0)};
  const ResampledEdit second = test::resampled(
      test::EditScene{.surface = edit.surface,
                      .sampling = edit.sampling,
                      .regions = {.zero = Region(test::from_list({{100.0F, 0.0F, 0.0F}}), {1.0F}),
                                  .one = Region(test::from_list({Vec3f::Zero()}), {50.0F})},
                      .params = again,
                      .field = test::constant_field(sampling.size(), 1.0F)});
  test::check_sound(second);
  CHECK(second.inserted > 0);
  CHECK(second.sampling->next_id == sampling.next_id + second.inserted);
  std::size_t grandchildren = 0;
  for (std::size_t i = sampling.size(); i < second.sampling->size(); ++i) {
    REQUIRE(second.sampling->cloud->id[i] == sampling.next_id + (i - sampling.size()));
    REQUIRE(second.sampling->parent[i] < sampling.next_id);
    grandchildren += second.sampling->parent[i] >= n ? 1U : 0U;
  }
  CHECK(grandchildren > 0);
}

TEST_CASE("ids of samples that were collected do not come back") {
  const test::EditScene scene = test::scene_of(
      {.levels = {test::level_of(test::plane(40, 0.05, test::Sampling::kJittered))}, .detail = {}},
      [](const Vec3f& p) { return p.norm() > 0.9F   ? 1
                                  : p.norm() < 0.5F ? 2
                                                    : 0; },
      test::resampling_by(Scaling{.factors = Vec3d(0.3, 2.0, 1.0)}, {.collect = 0.7}));
  const ResampledEdit first = test::resampled(scene);
  REQUIRE(first.removed > 0);
  REQUIRE(first.inserted > 0);
  const ResampledEdit second = test::resampled(test::scene_after(
      first, scene.regions, test::resampling_by(Translation{.vector = Vec3d(0.0, 0.0, 2.0)})));
  REQUIRE(second.inserted > 0);
  test::check_sound(second);
  for (std::size_t i = first.sampling->size(); i < second.sampling->size(); ++i)
    REQUIRE(second.sampling->cloud->id[i] >= scene.sampling->size() + first.inserted);
}

TEST_CASE("whole numbers are the nearest sample's, other numbers and colours are interpolated") {
  const test::PulledPlane scene = plane_with([](Cloud& cloud) {
    cloud.scalars.push_back(
        attribute<std::int32_t>("label", cloud, [](std::size_t i) { return static_cast<std::int32_t>(i); }));
    cloud.scalars.push_back(attribute<float>(
        "wave", cloud, [&](std::size_t i) { return static_cast<float>(smooth(cloud.position[i])); }));
    cloud.scalars.push_back(attribute<double>(
        "noise", cloud, [](std::size_t i) { return static_cast<double>(i * 7919 % 1000); }));
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const double wave = 127.5 + 127.5 * smooth(cloud.position[i]);
      cloud.color.push_back(
          {static_cast<std::uint8_t>(std::lround(wave)), static_cast<std::uint8_t>(i * 7919 % 256), 0, 255});
    }
  });
  const ResampledEdit edit = test::resampled(scene);
  test::check_sound(edit);
  const Cloud& cloud = *edit.sampling->cloud;
  const std::size_t n = scene.sampling->size();
  const KdTree tree(scene.surface.levels[0].position);
  std::vector<Neighbor> found;
  std::size_t other = 0;
  std::size_t out_of_range = 0;
  std::vector<double> wave;
  std::vector<double> color;
  for (std::size_t i = n; i < cloud.size(); ++i) {
    const Vec3f rest = at_rest(cloud, i);
    tree.nearest(rest, 30, found);
    other += values_of<std::int32_t>(cloud, 0)[i] == static_cast<std::int32_t>(found[0].index) ? 0U : 1U;
    wave.push_back(static_cast<double>(values_of<float>(cloud, 1)[i]) - smooth(rest));
    color.push_back((static_cast<double>(cloud.color[i][0]) - 127.5) / 127.5 - smooth(rest));
    double least = 1e9;
    double greatest = -1.0;
    int dark = 255;
    int bright = 0;
    for (const Neighbor& near : found) {
      const double noise = values_of<double>(cloud, 2)[near.index];
      least = std::min(least, noise);
      greatest = std::max(greatest, noise);
      dark = std::min(dark, int{cloud.color[near.index][1]});
      bright = std::max(bright, int{cloud.color[near.index][1]});
    }
    const double noise = values_of<double>(cloud, 2)[i];
    const int green = cloud.color[i][1];
    out_of_range += noise < least || noise > greatest || green < dark || green > bright ? 1U : 0U;
    REQUIRE(cloud.color[i][2] == 0);
    REQUIRE(cloud.color[i][3] == 255);
  }
  MESSAGE("label of another than the nearest: " << other << " of " << edit.inserted << "; wave "
                                                << test::root_mean_square(wave) << ", colour "
                                                << test::root_mean_square(color) << " of 0.5");
  CHECK(other < edit.inserted / 10'000);
  CHECK(out_of_range == 0);
  CHECK(test::root_mean_square(wave) < 0.002);
  CHECK(test::root_mean_square(color) < 0.005);
}

TEST_CASE("numbers that are none stay where they are") {
  constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
  // One half of the plane has values that are the numbers of the samples, the other half has none.
  const test::PulledPlane scene = plane_with([](Cloud& cloud) {
    cloud.scalars.push_back(attribute<float>("half", cloud, [&](std::size_t i) {
      return cloud.position[i].x() < 0.5F ? static_cast<float>(i) : kNothing;
    }));
  });
  const ResampledEdit edit = test::resampled(scene);
  const Cloud& cloud = *edit.sampling->cloud;
  const std::vector<float>& half = values_of<float>(cloud, 0);
  std::size_t wrong = 0;
  for (std::size_t i = scene.sampling->size(); i < cloud.size(); ++i) {
    const float x = cloud.position[i].x();
    if (x < 0.49F && std::isnan(half[i])) ++wrong;
    if (x > 0.51F && !std::isnan(half[i])) ++wrong;
  }
  CHECK(wrong == 0);
}

TEST_CASE("texture coordinates do not mix over a seam") {
  const test::PulledPlane scene = plane_with([](Cloud& cloud) {
    for (TexCoord& at : cloud.texcoord)
      if (at[0] > 0.5F) at[0] += 7.0F;
  });
  const ResampledEdit edit = test::resampled(scene);
  const Cloud& cloud = *edit.sampling->cloud;
  double farthest = 0.0;
  double beyond = 0.0;
  for (std::size_t i = scene.sampling->size(); i < cloud.size(); ++i) {
    const bool right = cloud.texcoord[i][0] > 3.0F;
    const double u = static_cast<double>(right ? cloud.texcoord[i][0] - 7.0F : cloud.texcoord[i][0]);
    const double away = std::hypot(u - static_cast<double>(cloud.position[i].x()),
                                   static_cast<double>(cloud.texcoord[i][1] - cloud.position[i].y()));
    farthest = std::max(farthest, away / scene.spacing);
    // Which side: no farther over the seam than a spacing.
    if (right != (cloud.position[i].x() > 0.5F))
      beyond = std::max(beyond, std::abs(static_cast<double>(cloud.position[i].x()) - 0.5) / scene.spacing);
  }
  MESSAGE("texture off by at most " << farthest << " spacings beside a seam, which moved by " << beyond);
  CHECK(farthest < 1.0);
  CHECK(beyond < 0.5);
}

TEST_CASE("texture coordinates that are no numbers do not spread") {
  const test::PulledPlane scene = plane_with([](Cloud& cloud) {
    for (std::size_t i = 0; i < cloud.size(); i += 50)
      cloud.texcoord[i] = {std::numeric_limits<float>::quiet_NaN(), 0.5F};
  });
  const ResampledEdit edit = test::resampled(scene);
  const Cloud& cloud = *edit.sampling->cloud;
  const KdTree tree(scene.surface.levels[0].position);
  std::vector<Neighbor> found;
  std::size_t spread = 0;
  for (std::size_t i = scene.sampling->size(); i < cloud.size(); ++i) {
    if (std::isfinite(cloud.texcoord[i][0])) continue;
    tree.nearest(at_rest(cloud, i), 1, found);
    spread += found[0].index % 50 == 0 ? 0U : 1U;
  }
  CHECK(spread == 0);
}

TEST_CASE("exact positions, normals and missing columns") {
  const Vec3d origin(1e6, 2e6, 3e6);
  test::PulledPlane scene = plane_with([&](Cloud& cloud) {
    cloud.origin = origin;
    cloud.position_is_double = true;
    cloud.texcoord.clear();
    cloud.normal = Points(cloud.size());
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      cloud.normal.set(i, Vec3f::UnitZ());
      const Vec3d p = origin + cloud.position[i].cast<double>() + Vec3d::Constant(1e-12);
      cloud.exact_position.push_back({p.x(), p.y(), p.z()});
    }
  });
  const ResampledEdit edit = test::resampled(scene);
  test::check_sound(edit);
  const Cloud& cloud = *edit.sampling->cloud;
  CHECK(cloud.texcoord.empty());
  CHECK(cloud.color.empty());
  REQUIRE(cloud.exact_position.size() == cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (i < scene.sampling->size()) {
      REQUIRE(cloud.exact_position[i] == scene.sampling->cloud->exact_position[i]);
    } else {
      REQUIRE(model_position(cloud, i) == origin + edit.surface.finest().position[i].cast<double>());
      REQUIRE(cloud.position[i] == edit.surface.finest().position[i]);
      REQUIRE(cloud.normal[i] == edit.surface.finest().normal[i]);
    }
  }
}

}  // namespace
}  // namespace pointwright
