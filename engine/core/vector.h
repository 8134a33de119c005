#pragma once
// The vector and matrix types of the whole engine: plain Eigen, by the names that the code reads best with.

#include <Eigen/Geometry>
#include <limits>

namespace pointwright {

using Vec3f = Eigen::Vector3f;
using Vec3d = Eigen::Vector3d;
using Mat3f = Eigen::Matrix3f;
using Mat3d = Eigen::Matrix3d;

/// Axis-aligned box; empty while min > max.
struct Box3f {
  Vec3f min = Vec3f::Constant(std::numeric_limits<float>::max());
  Vec3f max = Vec3f::Constant(std::numeric_limits<float>::lowest());

  void extend(const Vec3f& p) {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  [[nodiscard]] bool is_empty() const { return (min.array() > max.array()).any(); }
  [[nodiscard]] float diagonal() const { return is_empty() ? 0.0F : (max - min).norm(); }
};

}  // namespace pointwright
