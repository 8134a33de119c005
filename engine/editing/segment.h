#pragma once
// Distances to segments, on a screen and in space.

#include <algorithm>

#include "engine/core/vector.h"

namespace pointwright {

/// Squared distance from the point to the segment from a to b, which may be one point. Vector: Vec2d, Vec3d.
template <typename Vector>
double segment_distance_sq(const Vector& a, const Vector& b, const Vector& point) {
  const Vector along = b - a;
  const Vector to_point = point - a;
  const double length_sq = along.squaredNorm();
  // A segment without length is the ball around its vertex.
  const double s = length_sq > 0.0 ? std::clamp(to_point.dot(along) / length_sq, 0.0, 1.0) : 0.0;
  return (to_point - s * along).squaredNorm();
}

}  // namespace pointwright
