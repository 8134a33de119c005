#include "engine/core/cloud.h"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

// A cloud with every column filled, sample i recognisable in each.
Cloud full_cloud(std::size_t n) {
  Cloud cloud;
  cloud.origin = {1e6, -2e6, 3.0};
  cloud.position = Points(n);
  cloud.normal = Points(n);
  cloud.color_has_alpha = true;
  cloud.position_is_double = true;
  std::vector<std::int16_t> shorts(n);
  std::vector<double> doubles(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto f = static_cast<float>(i);
    cloud.position.set(i, {f, 2.0F * f, 3.0F * f});
    cloud.normal.set(i, Vec3f(1.0F, f, 0.0F).normalized());
    const auto c = static_cast<std::uint8_t>(i);
    cloud.color.push_back({c, c, c, c});
    cloud.texcoord.push_back({f, -f});
    cloud.id.push_back(static_cast<std::uint32_t>(i));
    cloud.exact_position.push_back({1e6 + static_cast<double>(i) + 1e-9, 0.0, 0.0});
    shorts[i] = static_cast<std::int16_t>(-static_cast<int>(i));
    doubles[i] = 0.1 * static_cast<double>(i);
  }
  cloud.scalars = {{"intensity", shorts}, {"gps time", doubles}};
  return cloud;
}

TEST_CASE("a permutation carries every column along") {
  const Cloud cloud = full_cloud(50);
  std::vector<std::uint32_t> order(50);
  for (std::size_t i = 0; i < 50; ++i) order[i] = static_cast<std::uint32_t>((i * 7 + 3) % 50);
  const Cloud result = permuted(cloud, order);
  CHECK(result.origin == cloud.origin);
  CHECK(result.color_has_alpha);
  CHECK(result.position_is_double);
  REQUIRE(result.scalars.size() == 2);
  CHECK(result.scalars[0].name == "intensity");
  const auto& shorts = std::get<std::vector<std::int16_t>>(result.scalars[0].values);
  const auto& doubles = std::get<std::vector<double>>(result.scalars[1].values);
  for (std::size_t i = 0; i < 50; ++i) {
    const std::size_t from = order[i];
    CHECK(result.position[i] == cloud.position[from]);
    CHECK(result.normal[i] == cloud.normal[from]);
    CHECK(result.color[i] == cloud.color[from]);
    CHECK(result.texcoord[i] == cloud.texcoord[from]);
    CHECK(result.id[i] == from);
    CHECK(result.exact_position[i] == cloud.exact_position[from]);
    CHECK(shorts[i] == -static_cast<int>(from));
    CHECK(doubles[i] == 0.1 * static_cast<double>(from));
  }
  CHECK(validate(result).ok());
}

TEST_CASE("the caller's order undoes any permutation") {
  const Cloud cloud = full_cloud(50);
  std::vector<std::uint32_t> order(50);
  for (std::size_t i = 0; i < 50; ++i) order[i] = static_cast<std::uint32_t>((i * 13 + 8) % 50);
  const Cloud back = in_caller_order(permuted(cloud, order));
  CHECK(back.position == cloud.position);
  CHECK(back.normal == cloud.normal);
  CHECK(back.color == cloud.color);
  CHECK(back.texcoord == cloud.texcoord);
  CHECK(back.scalars == cloud.scalars);
  CHECK(back.id == cloud.id);
  CHECK(back.exact_position == cloud.exact_position);
}

TEST_CASE("a subset keeps the caller's ids") {
  const Cloud result = permuted(full_cloud(10), {9, 2});
  CHECK(result.size() == 2);
  CHECK(result.id == std::vector<std::uint32_t>{9, 2});
  CHECK(in_caller_order(result).id == std::vector<std::uint32_t>{2, 9});
}

TEST_CASE("columns that a cloud does not have stay absent") {
  const Cloud result = permuted(test::to_cloud(test::collinear(3, {0, 0, 0}, {1, 0, 0})), {2, 1, 0});
  CHECK_FALSE(result.has_normals());
  CHECK_FALSE(result.has_colors());
  CHECK(result.texcoord.empty());
  CHECK(result.exact_position.empty());
}

TEST_CASE("a model position is the exact one where there is one") {
  Cloud cloud = full_cloud(3);
  CHECK(model_position(cloud, 2) == Vec3d(1e6 + 2.0 + 1e-9, 0.0, 0.0));
  cloud.exact_position.clear();
  CHECK(model_position(cloud, 2) == Vec3d(1e6 + 2.0, -2e6 + 4.0, 9.0));
}

TEST_CASE("a whole cloud is valid, and so is one without samples") {
  CHECK(validate(full_cloud(50)).ok());
  CHECK(validate(Cloud{}).ok());
}

TEST_CASE("a column of another length is malformed and named") {
  Cloud cloud = full_cloud(20);
  std::string field;
  SUBCASE("normal") {
    cloud.normal.resize(19), field = "normal";
  }
  SUBCASE("color") {
    cloud.color.pop_back(), field = "color";
  }
  SUBCASE("texcoord") {
    cloud.texcoord.emplace_back(), field = "texcoord";
  }
  SUBCASE("exact position") {
    cloud.exact_position.pop_back(), field = "exact_position";
  }
  SUBCASE("id") {
    cloud.id.pop_back(), field = "id";
  }
  SUBCASE("no id at all") {
    cloud.id.clear(), field = "id";
  }
  SUBCASE("scalar") {
    cloud.scalars[0].values = std::vector<float>(21), field = "intensity";
  }
  SUBCASE("empty scalar") {
    cloud.scalars[1].values = std::vector<float>(), field = "gps time";
  }
  const auto result = validate(cloud);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kMalformedData);
  CHECK(result.error().field == field);
}

TEST_CASE("ids may have gaps, as inserted and removed samples leave them") {
  Cloud cloud = full_cloud(20);
  cloud.id[3] = 20;
  cloud.id[7] = 0xfffffffeU;
  CHECK(validate(cloud).ok());
}

TEST_CASE("ids of two samples that are the same are malformed") {
  Cloud cloud = full_cloud(20);
  SUBCASE("neighbours") {
    cloud.id[3] = 4;
  }
  SUBCASE("far apart and beyond the count") {
    cloud.id[3] = cloud.id[17] = 0xffffffffU;
  }
  const auto result = validate(cloud);
  REQUIRE_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kMalformedData);
  CHECK(result.error().field == "id");
}

TEST_CASE("a position that is not finite is refused") {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Cloud cloud = full_cloud(20);
      (axis == 0 ? cloud.position.x() : axis == 1 ? cloud.position.y() : cloud.position.z())[19] = bad;
      const auto result = validate(cloud);
      REQUIRE_FALSE(result.ok());
      CHECK(result.error().code == ErrorCode::kNonFinite);
    }
  }
}

}  // namespace
}  // namespace pointwright
