#include "engine/core/points.h"

#include <doctest/doctest.h>

#include <cmath>

namespace pointwright {
namespace {

TEST_CASE("columns are padded to whole blocks with finite values") {
  for (const std::size_t n : {0U, 1U, 15U, 16U, 17U, 1000U}) {
    CAPTURE(n);
    Points points(n);
    CHECK(points.size() == n);
    CHECK(padded_to_block(n) % kSimdBlock == 0);
    CHECK(padded_to_block(n) >= n);
    CHECK(padded_to_block(n) < n + kSimdBlock);
    for (std::size_t i = 0; i < n; ++i) points.set(i, {1.0F, 2.0F, 3.0F});
    for (std::size_t i = n; i < padded_to_block(n); ++i) {
      CHECK(points.x()[i] == 0.0F);
      CHECK(points.y()[i] == 0.0F);
      CHECK(points.z()[i] == 0.0F);
    }
  }
}

TEST_CASE("a point reads as it was set") {
  Points points(20);
  for (std::size_t i = 0; i < 20; ++i) {
    const auto f = static_cast<float>(i);
    points.set(i, {f, -f, 0.5F * f});
  }
  for (std::size_t i = 0; i < 20; ++i) {
    const auto f = static_cast<float>(i);
    CHECK(points[i] == Vec3f(f, -f, 0.5F * f));
    CHECK(points.y()[i] == -f);
  }
}

TEST_CASE("points are equal where their samples are, whatever the padding holds") {
  Points a(5);
  Points b(5);
  b.x()[5] = 1.0F;  // padding
  CHECK(a == b);
  b.y()[4] = 1.0F;
  CHECK_FALSE(a == b);
  CHECK_FALSE(Points(5) == Points(6));
  CHECK(Points() == Points());
}

TEST_CASE("bounds enclose every point and nothing more") {
  Points points(3);
  points.set(0, {1.0F, -2.0F, 3.0F});
  points.set(1, {-4.0F, 5.0F, 0.0F});
  points.set(2, {0.0F, 0.0F, 9.0F});
  const Box3f box = bounds_of(points);
  CHECK(box.min == Vec3f(-4.0F, -2.0F, 0.0F));
  CHECK(box.max == Vec3f(1.0F, 5.0F, 9.0F));
  CHECK(box.diagonal() == doctest::Approx(std::sqrt(25.0 + 49.0 + 81.0)));
}

TEST_CASE("the padding is not part of the bounds") {
  Points points(1);
  points.set(0, {7.0F, 7.0F, 7.0F});
  const Box3f box = bounds_of(points);
  CHECK(box.min == Vec3f(7.0F, 7.0F, 7.0F));
  CHECK(box.diagonal() == 0.0F);
}

TEST_CASE("bounds of nothing are empty") {
  const Box3f box = bounds_of(Points{});
  CHECK(box.is_empty());
  CHECK(box.diagonal() == 0.0F);
}

}  // namespace
}  // namespace pointwright
