#pragma once
// Surfaces with known answers, and double-precision references.

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/editing/edit.h"
#include "tests/support/all_machines.h"

namespace pointwright::test {

/// Bits of a painted region's marks.
inline constexpr std::uint8_t kZeroBit = 1;
inline constexpr std::uint8_t kOneBit = 2;

inline Points points_of(const std::vector<Vec3f>& list) {
  Points points(list.size());
  for (std::size_t i = 0; i < list.size(); ++i) points.set(i, list[i]);
  return points;
}

inline Points random_points(std::size_t n, unsigned seed, float extent = 1.0F) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-extent, extent);
  Points points(n);
  for (std::size_t i = 0; i < n; ++i)
    points.set(i, {coordinate(random), coordinate(random), coordinate(random)});
  return points;
}

/// A side x side grid in z = 0 over [-1, 1]^2 with normals +z, row after row.
inline Level plane_level(std::size_t side) {
  Level level{.position = Points(side * side), .normal = Points(side * side)};
  for (std::size_t i = 0; i < side * side; ++i) {
    const auto at = [&](std::size_t k) {
      return -1.0F + 2.0F * static_cast<float>(k) / static_cast<float>(side - 1);
    };
    level.position.set(i, {at(i % side), at(i / side), 0.0F});
    level.normal.set(i, Vec3f::UnitZ());
  }
  return level;
}

/// n samples of a sphere around the origin along a Fibonacci spiral.
inline Level sphere_level(std::size_t n, float radius) {
  Level level{.position = Points(n), .normal = Points(n)};
  for (std::size_t i = 0; i < n; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(n);
    const double turn = 2.399963229728653 * static_cast<double>(i);
    const double r = std::sqrt(1.0 - z * z);
    const Vec3f normal = Vec3d(r * std::cos(turn), r * std::sin(turn), z).cast<float>();
    level.normal.set(i, normal);
    level.position.set(i, radius * normal);
  }
  return level;
}

/// A second level over `base` with detail(i) along its normals.
inline MultiresSurface one_band(const Level& base, const std::function<float(std::size_t)>& detail) {
  MultiresSurface surface{.levels = {base, base}, .detail = {std::vector<float>(base.position.size())}};
  for (std::size_t i = 0; i < base.position.size(); ++i) {
    surface.detail[0][i] = detail(i);
    surface.levels[1].position.set(i, base.position[i] + detail(i) * base.normal[i]);
  }
  return surface;
}

/// Zero-region where x < -border, one-region where x > border.
inline Marks marks_beside(const Points& position, float border) {
  Marks marks(position.size(), 0);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const float x = position[i].x();
    marks[i] = static_cast<std::uint8_t>(x < -border ? RegionKind::kZero : RegionKind::kOne);
    if (std::abs(x) <= border) marks[i] = 0;
  }
  return marks;
}

/// t = value and no gradient anywhere: a rigid motion where value is 1.
inline ScaleField constant_field(std::size_t n, float value) {
  ScaleField field{.t = std::vector<float>(padded_to_block(n), 0.0F), .gradient = Points(n)};
  std::fill_n(field.t.begin(), n, value);
  return field;
}

/// Eq. (11) and (12) in double precision, ball by ball.
inline double reference_distance(const Region& region, const Vec3d& p) {
  double best = 1e300;
  for (std::size_t i = 0; i < region.size(); ++i) {
    const double to_center = (p - region.center(i).cast<double>()).norm();
    best = std::min(best, std::max(0.0, to_center - double{region.radius(i)}));
  }
  return best;
}
inline double reference_t(const RegionPair& regions, const Vec3d& p) {
  const double d0 = reference_distance(regions.zero, p);
  const double d1 = reference_distance(regions.one, p);
  if (d0 <= 0.0) return 0.0;
  const double x = d1 / (d0 + d1);
  return (x * x - 1.0) * (x * x - 1.0);
}

/// The unit normal of F(surface) at `p`, whose tangent plane is that of normal n, by central differences of
/// step h.
inline Vec3d reference_normal(const RegionPair& regions, const Deformation& deformation, const Vec3d& p,
                              const Vec3d& n, double h, const std::function<Vec3d(const Vec3d&)>& project) {
  const Vec3d u = n.unitOrthogonal();
  const Vec3d v = n.cross(u);
  const auto f = [&](const Vec3d& q) {
    const Vec3d on_surface = project(q);
    return deform_point(deformation, on_surface, reference_t(regions, on_surface));
  };
  return (f(p + h * u) - f(p - h * u)).cross(f(p + h * v) - f(p - h * v)).normalized();
}

/// The edit over the graph of the finest level's samples.
inline MultiresSurface edited(const MultiresSurface& surface, const EditParams& params,
                              const ScaleField& field, const Vec3d& origin) {
  return apply_edit(surface, build_neighbor_graph(surface.finest().position, 10), params, field, origin);
}

inline bool same_bytes(const float* a, const float* b, std::size_t n) {
  return n == 0 || std::memcmp(a, b, n * sizeof(float)) == 0;
}
inline bool same_bytes(const Points& a, const Points& b) {
  const std::size_t n = a.size();
  return n == b.size() && same_bytes(a.x(), b.x(), n) && same_bytes(a.y(), b.y(), n) &&
         same_bytes(a.z(), b.z(), n);
}
inline bool same_bytes(const ScaleField& a, const ScaleField& b) {
  return a.t.size() == b.t.size() && same_bytes(a.t.data(), b.t.data(), a.t.size()) &&
         same_bytes(a.gradient, b.gradient);
}
inline bool same_bytes(const MultiresSurface& a, const MultiresSurface& b) {
  if (a.levels.size() != b.levels.size() || a.detail != b.detail) return false;
  for (std::size_t k = 0; k < a.levels.size(); ++k) {
    if (!same_bytes(a.levels[k].position, b.levels[k].position)) return false;
    if (!same_bytes(a.levels[k].normal, b.levels[k].normal)) return false;
  }
  return true;
}
/// Whether sample i of both has the same bits.
inline bool same_sample(const Points& a, const Points& b, std::size_t i) {
  return same_bytes(a.x() + i, b.x() + i, 1) && same_bytes(a.y() + i, b.y() + i, 1) &&
         same_bytes(a.z() + i, b.z() + i, 1);
}
inline bool all_finite(const Points& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) return false;
  }
  return true;
}

}  // namespace pointwright::test
