#include "engine/simplification/attributes.h"

#include <doctest/doctest.h>

#include <cmath>
#include <numeric>
#include <variant>
#include <vector>

#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

using namespace test;

TEST_CASE("columns are averaged or taken over what each sample stands for") {
  const Surface surface = torus(3'000, 1.0, 0.4, Sampling::kRandom);
  Cloud cloud = to_cloud(surface);
  const std::size_t n = cloud.size();
  cloud.color.resize(n);
  cloud.texcoord.resize(n);
  std::vector<float> height(n);
  std::vector<double> index(n);
  std::vector<std::int32_t> label(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3f p = cloud.position[i];
    cloud.color[i] = {static_cast<std::uint8_t>(i % 251), 7, 200, 255};
    cloud.texcoord[i] = {p.x(), p.y()};
    height[i] = p.z();
    index[i] = static_cast<double>(i);
    label[i] = p.z() > 0.0F ? 1'000'000 : -5;
  }
  cloud.scalars = {{"height", height}, {"index", index}, {"label", label}};
  const auto outcome = simplify(cloud.position, cloud.normal, build_neighbor_graph(cloud.position, 10),
                                {.target = KeepCount{300}});
  REQUIRE(outcome.ok());
  const Simplification& simplified = outcome.value();
  const Cloud result = simplified_cloud(simplified, cloud);
  REQUIRE(validate(result).ok());
  CHECK(result.size() == 300);
  CHECK(result.position == simplified.position);

  std::vector<std::vector<std::size_t>> members(300);
  for (std::size_t i = 0; i < n; ++i) members[simplified.parent[i]].push_back(i);
  const std::vector<std::uint32_t> nearest = representatives(simplified, cloud.position);
  const std::vector<float> means = averaged(simplified, height);
  const auto& labels = std::get<std::vector<std::int32_t>>(result.scalars[2].values);
  for (std::size_t m = 0; m < members.size(); ++m) {
    double mean_height = 0.0;
    double mean_index = 0.0;
    double mean_red = 0.0;
    double mean_u = 0.0;
    for (const std::size_t i : members[m]) {
      const double share = 1.0 / static_cast<double>(members[m].size());
      mean_height += share * static_cast<double>(height[i]);
      mean_index += share * index[i];
      mean_red += share * static_cast<double>(cloud.color[i][0]);
      mean_u += share * static_cast<double>(cloud.texcoord[i][0]);
      const auto distance = [&](std::size_t s) {
        return (cloud.position[s] - simplified.position[m]).norm();
      };
      CHECK(distance(nearest[m]) <= distance(i));
    }
    CHECK(simplified.parent[nearest[m]] == m);
    CHECK(static_cast<double>(means[m]) == doctest::Approx(mean_height).epsilon(1e-5));
    CHECK(std::get<std::vector<float>>(result.scalars[0].values)[m] == means[m]);
    CHECK(std::get<std::vector<double>>(result.scalars[1].values)[m] == doctest::Approx(mean_index));
    CHECK(std::abs(static_cast<double>(result.color[m][0]) - mean_red) <= 0.5001);
    CHECK(result.color[m][1] == 7);
    CHECK(result.color[m][3] == 255);
    CHECK(static_cast<double>(result.texcoord[m][0]) == doctest::Approx(mean_u).epsilon(1e-5));
    CHECK(labels[m] == label[nearest[m]]);
  }
}

TEST_CASE("interleaved components keep apart") {
  const Surface surface = plane(10, 0.1, Sampling::kRegular);
  const auto outcome = simplify(surface.position, surface.normal, build_neighbor_graph(surface.position, 8),
                                {.target = KeepCount{20}});
  REQUIRE(outcome.ok());
  std::vector<float> pairs(200);
  for (std::size_t i = 0; i < 100; ++i) {
    pairs[2 * i] = 3.0F;
    pairs[2 * i + 1] = -1.0F;
  }
  const std::vector<float> mean = averaged(outcome.value(), pairs, 2);
  REQUIRE(mean.size() == 40);
  for (std::size_t m = 0; m < 20; ++m) {
    CHECK(mean[2 * m] == 3.0F);
    CHECK(mean[2 * m + 1] == -1.0F);
  }
}

TEST_CASE("chosen samples keep all columns, and the caller's order") {
  const Surface surface = plane(10, 0.1, Sampling::kJittered);
  Cloud cloud = to_cloud(surface);
  cloud.color.resize(100);
  std::vector<std::int32_t> label(100);
  for (std::uint32_t i = 0; i < 100; ++i) {
    cloud.id[i] = (i * 37 + 11) % 100;
    cloud.color[i] = {static_cast<std::uint8_t>(i), 1, 2, 200};
    label[i] = static_cast<std::int32_t>(1'000 * i);
  }
  cloud.scalars.push_back({.name = "label", .values = label});
  const std::vector<std::uint32_t> kept{0, 3, 4, 50, 51, 98};
  const Cloud result = chosen_cloud(cloud, kept);
  REQUIRE(validate(result).ok());
  REQUIRE(result.size() == kept.size());
  for (std::size_t m = 0; m < kept.size(); ++m) {
    CHECK(result.position[m] == cloud.position[kept[m]]);
    CHECK(result.normal[m] == cloud.normal[kept[m]]);
    CHECK(result.color[m] == cloud.color[kept[m]]);
    CHECK(std::get<std::vector<std::int32_t>>(result.scalars[0].values)[m] == label[kept[m]]);
    for (std::size_t other = 0; other < kept.size(); ++other) {
      CHECK((result.id[m] < result.id[other]) == (cloud.id[kept[m]] < cloud.id[kept[other]]));
    }
  }
}

}  // namespace
}  // namespace pointwright
