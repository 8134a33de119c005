#include "engine/editing/region.h"

#include <doctest/doctest.h>

#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

struct Nearest {
  float distance;
  std::size_t ball;
};

// The definition of region.h, ball by ball in float.
Nearest brute_force(const Points& centers, const std::vector<float>& radii, const Vec3f& p) {
  Nearest nearest{std::numeric_limits<float>::infinity(), 0};
  for (std::size_t i = 0; i < centers.size(); ++i) {
    const float dx = p.x() - centers.x()[i];
    const float dy = p.y() - centers.y()[i];
    const float dz = p.z() - centers.z()[i];
    const float d = std::max(std::sqrt(dx * dx + dy * dy + dz * dz) - radii[i], 0.0F);
    if (d < nearest.distance) nearest = {d, i};
  }
  return nearest;
}

std::vector<float> random_radii(std::size_t n, unsigned seed, float largest) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  std::vector<float> radii(n);
  for (float& r : radii) {
    const float u = uniform(random);
    r = u < 0.2F ? 0.0F : largest * u * u * u;  // many small ones, few large
  }
  return radii;
}

void check_exact(const Region& region, const Points& centers, const std::vector<float>& radii,
                 const Points& queries) {
  std::size_t wrong = 0;
  std::uint32_t hint = 0;
  RegionDistances many;
  region.distances(queries, 0, queries.size(), many);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Nearest expected = brute_force(centers, radii, queries[i]);
    const RegionDistance found = region.distance(queries[i], hint);
    wrong += found.distance != expected.distance;
    wrong += many.distance[i] != expected.distance || many.gradient[i] != found.gradient;
    if (expected.distance <= 0.0F) {
      wrong += found.gradient != Vec3f::Zero();
      continue;
    }
    const Vec3f away = (queries[i] - centers[expected.ball]).normalized();
    wrong += (found.gradient - away).norm() > 1e-5F;  // of that very ball: ties went to the lower index
  }
  CHECK(wrong == 0);
}

TEST_CASE("distances are those of brute force, exactly, for any radii, on every instruction set") {
  for (const std::size_t balls : {1, 2, 15, 16, 17, 255, 256, 257, 3000}) {
    for (const float largest : {0.0F, 0.02F, 0.5F}) {
      CAPTURE(balls);
      CAPTURE(largest);
      const Points centers = test::random_points(balls, 11);
      const std::vector<float> radii = random_radii(balls, 12, largest);
      const Region region(centers, radii);
      CHECK(region.size() == balls);
      CHECK(region.center(balls - 1) == centers[balls - 1]);
      CHECK(region.radius(0) == radii[0]);
      test::on_every_instruction_set(
          [&] { check_exact(region, centers, radii, test::random_points(333, 13, 1.5F)); });
    }
  }
}

TEST_CASE("ties go to the lower index, whatever the order of the balls and the hint") {
  // A lattice seen from its cell centres: eight balls at exactly the same distance.
  std::vector<Vec3f> lattice;
  for (int i = 0; i < 512; ++i) {
    lattice.emplace_back(static_cast<float>(i % 8), static_cast<float>(i / 8 % 8),
                         static_cast<float>(i / 64));
  }
  std::shuffle(lattice.begin(), lattice.end(), std::mt19937(5));
  const Points centers = test::points_of(lattice);
  const std::vector<float> radii(centers.size(), 0.25F);
  std::vector<Vec3f> cells;
  for (int i = 0; i < 343; ++i) {
    cells.emplace_back(0.5F + static_cast<float>(i % 7), 0.5F + static_cast<float>(i / 7 % 7),
                       0.5F + static_cast<float>(i / 49));
  }
  const Points queries = test::points_of(cells);
  for (const BallOrder order : {BallOrder::kAny, BallOrder::kCoherent}) {  // the latter wrongly
    const Region region(centers, radii, order);
    check_exact(region, centers, radii, queries);
    for (std::uint32_t wild : {0U, 7U, 31U, 1000U, 4'000'000'000U}) {
      std::uint32_t hint = wild;
      std::uint32_t zero = 0;
      CHECK(region.distance(queries[100], hint).gradient == region.distance(queries[100], zero).gradient);
    }
  }
}

TEST_CASE("coincident, nested, tiny and far balls are all legal") {
  const std::vector<Vec3f> places = {{0, 0, 0}, {0, 0, 0}, {1e-30F, 0, 0}, {1e9F, 0, 0}, {0.5F, 0, 0}};
  const Points centers = test::points_of(places);
  const std::vector<float> radii = {0.0F, 0.25F, 1e-38F, 10.0F, 2.0F};
  const Points queries =
      test::points_of({{0, 0, 0}, {5, 0, 0}, {1e9F, 20, 0}, {-1e9F, -1e9F, 3}, {1e-25F, 1e-25F, 0}});
  check_exact(Region(centers, radii), centers, radii, queries);
}

TEST_CASE("other radii over the same centres give the same region as building it anew") {
  const Points centers = test::random_points(1000, 21);
  const std::vector<float> radii = random_radii(1000, 22, 0.1F);
  const Region region = Region(centers, std::vector<float>(1000, 0.0F)).with_radii(radii);
  CHECK(region.radius(17) == radii[17]);
  check_exact(region, centers, radii, test::random_points(200, 23));
}

TEST_CASE("limits cut distances off and change nothing below") {
  const Points centers = test::random_points(2000, 25);
  const std::vector<float> radii = random_radii(2000, 26, 0.02F);
  const Region region(centers, radii);
  const Points queries = test::random_points(500, 27, 1.5F);
  std::vector<float> limits(padded_to_block(500), 0.0F);
  for (std::size_t i = 0; i < limits.size(); ++i) limits[i] = 0.01F * static_cast<float>(i % 20);
  RegionDistances free;
  RegionDistances limited;
  region.distances(queries, 0, 500, free);
  region.distances(queries, 0, 500, limited, &limits);
  std::size_t below = 0;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < 500; ++i) {
    wrong += limited.distance[i] != std::min(free.distance[i], limits[i]);
    const bool is_below = free.distance[i] < limits[i];
    below += is_below ? 1 : 0;
    if (free.distance[i] == limits[i]) continue;
    wrong += limited.gradient[i] != (is_below ? free.gradient[i] : Vec3f(0, 0, 0));
  }
  CHECK(wrong == 0);
  CHECK(below > 50);
  CHECK(below < 400);
}

TEST_CASE("distances along a coherent order are exact inside the balls, near them and far away") {
  const Points sheet = test::coherent(test::random_points(4000, 31));
  for (const float thickness : {0.01F, 1.0F}) {  // a surface, and a cloud of balls
    Points centers(3000);
    for (std::size_t i = 0; i < centers.size(); ++i)
      centers.set(i, sheet[i].cwiseProduct(Vec3f(1.0F, 1.0F, thickness)));
    const std::vector<float> radii = random_radii(3000, 32, 0.05F);
    const Region region(centers, radii, BallOrder::kCoherent);
    for (const float away : {0.0F, 0.3F, 30.0F}) {
      CAPTURE(thickness);
      CAPTURE(away);
      Points queries(2000);
      for (std::size_t i = 0; i < queries.size(); ++i)
        queries.set(i, 0.2F * sheet[2 * i] + Vec3f(0.0F, 0.0F, away));
      test::on_every_instruction_set([&] { check_exact(region, centers, radii, queries); });
    }
  }
}

TEST_CASE("thousands of balls that are all as near as the others are compared one by one") {
  // Balls on a sphere, seen from around its centre: none of them can be ruled out.
  Points centers = test::random_points(3000, 33);
  for (std::size_t i = 0; i < centers.size(); ++i) centers.set(i, centers[i].normalized());
  Points queries = test::coherent(test::random_points(300, 34));
  for (std::size_t i = 0; i < queries.size(); ++i) queries.set(i, (i % 50 == 0 ? 0.0F : 0.02F) * queries[i]);
  for (const float radius : {0.0F, 0.01F}) {
    const std::vector<float> radii(centers.size(), radius);
    const Region region(centers, radii);
    test::on_every_instruction_set([&] { check_exact(region, centers, radii, queries); });
  }
}

TEST_CASE("a region without balls has no distance") {
  const Region region;
  std::uint32_t hint = 0;
  CHECK(region.empty());
  CHECK(Region(Points(), {}).empty());
  CHECK_THROWS_AS(region.distance(Vec3f::Zero(), hint), LogicError);
}

TEST_CASE("balls of neighbouring zero- and one-samples never touch and hold their own samples") {
  const std::size_t n = 4000;
  const Points position = test::random_points(n, 31);
  Marks marks(n, 0);
  for (std::size_t i = 0; i < n; ++i) marks[i] = static_cast<std::uint8_t>(i % 3);  // intermingled
  const std::vector<float> spacing(n, 0.2F);  // far larger than the gaps
  const Result<RegionPair> regions = regions_from_marks(position, spacing, marks, Vec3d::Zero());
  REQUIRE(regions.ok());
  const Region& zero = regions.value().zero;
  const Region& one = regions.value().one;
  CHECK(zero.size() == count_marked(marks, RegionKind::kZero));
  CHECK(one.size() == count_marked(marks, RegionKind::kOne));
  std::size_t touching = 0;
  for (std::size_t i = 0; i < zero.size(); ++i) {
    for (std::size_t j = 0; j < one.size(); ++j) {
      const double apart = (zero.center(i) - one.center(j)).cast<double>().norm();
      touching += double{zero.radius(i)} + double{one.radius(j)} >= apart;
    }
  }
  CHECK(touching == 0);
}

TEST_CASE("a ball is as large as the local spacing where the other region is far") {
  const Points position = test::points_of({{0, 0, 0}, {10, 0, 0}, {10.5F, 0, 0}, {5, 0, 0}});
  const Result<RegionPair> regions =
      regions_from_marks(position, {0.5F, 0.6F, 0.7F, 0.1F}, {1, 2, 2, 0}, Vec3d::Zero());
  REQUIRE(regions.ok());
  CHECK(regions.value().zero.radius(0) == 0.5F);
  CHECK(regions.value().one.radius(1) == 0.7F);
}

TEST_CASE("empty and meeting regions are refused with the place") {
  const Points position = test::points_of({{0, 0, 0}, {1, 2, 3}, {1, 2, 3}});
  const std::vector<float> spacing(3, 0.1F);
  const Vec3d origin(100.0, 0.0, 0.0);
  const auto refused = [&](const Marks& marks) {
    const Result<RegionPair> result = regions_from_marks(position, spacing, marks, origin);
    REQUIRE(!result.ok());
    return result.error();
  };
  CHECK(refused({0, 2, 2}).code == ErrorCode::kEmptyRegion);
  CHECK(refused({0, 2, 2}).field == "zero");
  CHECK(refused({1, 0, 0}).field == "one");
  for (const Marks& marks : {Marks{1, 3, 0}, Marks{0, 1, 2}}) {  // in both; two samples at one place
    const Error error = refused(marks);
    CHECK(error.code == ErrorCode::kRegionsIntersect);
    CHECK(error.message.find("(101, 2, 3)") != std::string::npos);
  }
  const Result<RegionPair> none = regions_from_marks(Points(), {}, {}, origin);
  REQUIRE(!none.ok());
  CHECK(none.error().code == ErrorCode::kEmptyRegion);
}

}  // namespace
}  // namespace pointwright
