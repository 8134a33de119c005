#include "engine/editing/ball_cover.h"

#include <doctest/doctest.h>

#include <cmath>
#include <initializer_list>
#include <vector>

#include "engine/editing/painting.h"
#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

// What painting with the cover marks, from nothing.
SampleMask painted(const std::vector<PointSet>& cover, const Points& position, const Vec3d& origin) {
  const Points no_normals;
  SampleMask marks(position.size(), 0);
  for (const PointSet& set : cover) {
    const PaintOperation operation{.shape = set};
    REQUIRE(validate(operation).ok());
    paint(operation, RegionKind::kZero, {.position = position, .normal = no_normals, .origin = origin},
          marks);
  }
  return marks;
}

std::size_t ball_count(const std::vector<PointSet>& cover) {
  std::size_t count = 0;
  for (const PointSet& set : cover) count += set.points.size();
  return count;
}

template <typename Chosen>
SampleMask mask_of(const Points& position, const Chosen& chosen) {
  SampleMask members(position.size());
  for (std::size_t i = 0; i < position.size(); ++i) members[i] = chosen(i, position[i]) ? 1 : 0;
  return members;
}

// The cover, the same on any machine, marks exactly the members. Returns its number of balls.
std::size_t check_exact(const Points& position, const SampleMask& members, const Vec3d& origin) {
  const std::vector<PointSet> cover = ball_cover(position, members, origin);
  const SampleMask marks = painted(cover, position, origin);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < marks.size(); ++i) wrong += marks[i] != members[i] ? 1 : 0;
  CHECK(wrong == 0);
  return ball_count(cover);
}

TEST_CASE("painting with the cover of a selection marks exactly its samples") {
  const Points cloud = test::random_points(6000, 21);
  const test::Surface torus = test::torus(8000, 1.0, 0.4, test::Sampling::kRandom, 4);
  const test::Surface sheets = test::parallel_sheets(60, 0.02, 1e-4, test::Sampling::kJittered, 5);
  for (const Vec3d& origin :
       {Vec3d(0.0, 0.0, 0.0), Vec3d(500'123.25, 5'400'321.5, 312.0), Vec3d(-3e8, 9e8, 1e3)}) {
    for (const Points* position : {&cloud, &torus.position, &sheets.position}) {
      test::Random random(77);
      check_exact(*position, mask_of(*position, [&](auto, auto) { return random.uniform() < 0.5; }), origin);
      check_exact(*position, mask_of(*position, [&](auto, auto) { return random.uniform() < 0.02; }), origin);
      check_exact(*position, mask_of(*position, [&](auto, auto) { return random.uniform() < 0.98; }), origin);
      check_exact(*position, mask_of(*position, [](auto, const Vec3f& p) { return p.x() < 0.1F; }), origin);
      check_exact(*position, mask_of(*position, [](auto, const Vec3f& p) { return p.z() > 0.0F; }), origin);
      CHECK(check_exact(*position, mask_of(*position, [](auto i, auto) { return i == 17; }), origin) == 1);
      CHECK(check_exact(*position, mask_of(*position, [](auto, auto) { return true; }), origin) == 1);
      CHECK(check_exact(*position, mask_of(*position, [](auto, auto) { return false; }), origin) == 0);
      check_exact(*position, mask_of(*position, [](auto i, auto) { return i != 17; }), origin);
    }
  }
}

TEST_CASE("a cover is the same on any machine") {
  const test::Surface torus = test::torus(20'000, 1.0, 0.4, test::Sampling::kRandom, 6);
  const SampleMask members = mask_of(
      torus.position, [](auto, const Vec3f& p) { return p.x() + 0.1F * std::sin(40.0F * p.y()) > 0.0F; });
  test::for_all_machines([&] { return ball_cover(torus.position, members, Vec3d(1.0, 2.0, 3.0)); },
                         [](const std::vector<PointSet>& a, const std::vector<PointSet>& b) {
                           REQUIRE(a.size() == b.size());
                           for (std::size_t i = 0; i < a.size(); ++i) {
                             CHECK(a[i].points == b[i].points);
                             CHECK(a[i].radii == b[i].radii);
                           }
                         });
}

TEST_CASE("any number of samples, in one place, on a line, or too near for floats to square, has a cover") {
  const Vec3d origin(10.0, 0.0, 0.0);
  for (const std::size_t n : std::initializer_list<std::size_t>{0, 1, 2, 15, 16, 17, 300}) {
    const Points one_place = test::identical(n, {1.0F, 2.0F, 3.0F});
    const auto everyone = mask_of(one_place, [](auto, auto) { return true; });
    CHECK(check_exact(one_place, everyone, origin) == (n > 0 ? 1 : 0));
    check_exact(one_place, everyone, Vec3d::Zero());
    const Points line = test::collinear(n, {0.0F, 0.0F, 0.0F}, {1.0F, 2.0F, 3.0F});
    if (n > 1) check_exact(line, mask_of(line, [](auto i, auto) { return i % 3 == 0; }), origin);
  }
  const Points near = test::points_of({{0, 0, 0}, {1e-25F, 0, 0}, {2e-25F, 0, 0}, {1e-20F, 0, 0}, {1, 0, 0}});
  check_exact(near, SampleMask{1, 0, 1, 0, 1}, Vec3d::Zero());
  check_exact(near, SampleMask{0, 1, 0, 1, 0}, Vec3d::Zero());
}

TEST_CASE("a sample at the very place of a member joins, nobody else does") {
  const Points position = test::points_of({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1.0000001F, 0, 0}, {2, 0, 0}});
  const SampleMask members{0, 1, 0, 0, 1};
  CHECK(painted(ball_cover(position, members, Vec3d::Zero()), position, Vec3d::Zero()) ==
        SampleMask{0, 1, 1, 0, 1});
  // Beside a large origin the fourth rounds to the same place, too.
  const Vec3d far(1e10, 0.0, 0.0);
  CHECK(painted(ball_cover(position, members, far), position, far) == SampleMask{0, 1, 1, 1, 1});
}

TEST_CASE("members beyond what one point set holds go into several") {
  // Every other sample of a lattice: nobody's ball holds a second member.
  const std::size_t side = 460;
  Points lattice(side * side);
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    const std::size_t row = i / side;
    lattice.set(i, {static_cast<float>(i % side), static_cast<float>(row), 0.0F});
  }
  const SampleMask members =
      mask_of(lattice, [&](std::size_t i, auto) { return (i % side + i / side) % 2 == 0; });
  const std::vector<PointSet> cover = ball_cover(lattice, members, Vec3d::Zero());
  REQUIRE(cover.size() == 2);
  CHECK(cover[0].points.size() == kMaxStrokeVertices);
  CHECK(ball_count(cover) == side * side / 2);
  CHECK(painted(cover, lattice, Vec3d::Zero()) == members);
}

TEST_CASE("the number of balls follows the length of the border, not the area inside") {
  const auto balls = [](std::size_t side) {
    const test::Surface plane =
        test::plane(side, 1.0 / static_cast<double>(side), test::Sampling::kJittered, 9);
    return static_cast<double>(check_exact(
        plane.position, mask_of(plane.position, [](auto, const Vec3f& p) { return p.x() < 0.013F; }),
        Vec3d::Zero()));
  };
  const double few = balls(100);
  const double many = balls(400);
  MESSAGE("balls along a straight border: ", few, " of 10,000 samples, ", many, " of 160,000");
  // Sixteen times the samples, four times the border; each row of balls is twice as wide as the one before
  // it, so that a constant number stands over a spacing of the border.
  CHECK(many < 6.0 * few);
  CHECK(few < 5.0 * 100);
}

TEST_CASE("a cancelled cover stops") {
  ExecutionContext context;
  context.cancel();
  const Points position = test::random_points(5000, 3);
  const SampleMask members = mask_of(position, [](auto i, auto) { return i % 2 == 0; });
  CHECK(ball_cover(position, members, Vec3d::Zero(), &context).empty());
}

}  // namespace
}  // namespace pointwright
