#pragma once
// Weighted least-squares planes (§2.2, Eq. 1, 2 and 4).

#include "engine/core/vector.h"

namespace pointwright {

/// A symmetric 3x3 matrix.
struct Symmetric3d {
  double xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;
};

/// Unit eigenvector of the smallest eigenvalue of a positive semi-definite matrix, as the dominant
/// eigenvector of its adjugate by repeated squaring: no branches, no iteration count that depends on the
/// data. Returns false only where the two smallest eigenvalues vanish next to the largest (points on a line
/// or in one place): `vector` is then some unit vector of the null space. Where they are equal but do not
/// vanish, as for a ball of points, it returns true with a vector that rounding chooses.
/// Cost: about 150 flops
bool smallest_eigenvector(const Symmetric3d& matrix, Vec3d& vector);

/// Accumulates weighted points and fits the plane that minimises Eq. (2). Points are best given relative to a
/// centre nearby.
class PlaneFit {
 public:
  void add(double x, double y, double z, double weight) {
    const double wx = weight * x;
    const double wy = weight * y;
    const double wz = weight * z;
    weight_ += weight;
    x_ += wx;
    y_ += wy;
    z_ += wz;
    second_.xx += wx * x;
    second_.yy += wy * y;
    second_.zz += wz * z;
    second_.xy += wx * y;
    second_.xz += wx * z;
    second_.yz += wy * z;
  }
  [[nodiscard]] double weight() const { return weight_; }
  [[nodiscard]] Vec3d centroid() const { return Vec3d(x_, y_, z_) / weight_; }

  /// The plane's unit normal, its sign undetermined. False only for points on a line or in one
  /// place.
  /// Pre: weight() > 0
  bool normal(Vec3d& n) const;

 private:
  double weight_ = 0.0;
  double x_ = 0.0, y_ = 0.0, z_ = 0.0;
  Symmetric3d second_;
};

}  // namespace pointwright
