#pragma once
// Weighted least-squares planes (§2.2, Eq. 1, 2 and 4).

#include "engine/core/vector.h"

namespace pointwright {

/// Unit eigenvector of the smallest eigenvalue of a symmetric positive semi-definite matrix, as the dominant
/// eigenvector of its adjugate by repeated squaring: no branches, no iteration count that depends on the
/// data. Returns false where the smallest eigenvalue is not single (collinear or coincident points): `vector`
/// is then some unit vector of the null space. Cost: about 150 flops
bool smallest_eigenvector(const Mat3d& matrix, Vec3d& vector);

/// Accumulates weighted points and fits the plane that minimises Eq. (2). Points are best given relative to a
/// centre nearby.
class PlaneFit {
 public:
  void add(const Vec3d& p, double weight) {
    weight_ += weight;
    first_ += weight * p;
    second_ += (weight * p) * p.transpose();
  }
  [[nodiscard]] double weight() const { return weight_; }
  [[nodiscard]] Vec3d centroid() const { return first_ / weight_; }

  /// The plane's unit normal, its sign undetermined. False where the points do not span a plane. Pre:
  /// weight() > 0.
  bool normal(Vec3d& n) const {
    const Vec3d c = centroid();
    return smallest_eigenvector(second_ / weight_ - c * c.transpose(), n);  // Eq. (4)
  }

 private:
  double weight_ = 0.0;
  Vec3d first_ = Vec3d::Zero();
  Mat3d second_ = Mat3d::Zero();
};

}  // namespace pointwright
