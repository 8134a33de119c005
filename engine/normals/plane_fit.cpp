#include "engine/normals/plane_fit.h"

#include <algorithm>
#include <cmath>

namespace pointwright {
namespace {

double trace(const Symmetric3d& m) {
  return m.xx + m.yy + m.zz;
}

Symmetric3d scaled(const Symmetric3d& m, double s) {
  return {m.xx * s, m.yy * s, m.zz * s, m.xy * s, m.xz * s, m.yz * s};
}

// Eigenvalues l1, l2, l3 become l2 l3, l1 l3, l1 l2 with the same eigenvectors: the smallest becomes the
// largest.
Symmetric3d adjugate(const Symmetric3d& m) {
  return {m.yy * m.zz - m.yz * m.yz, m.xx * m.zz - m.xz * m.xz, m.xx * m.yy - m.xy * m.xy,
          m.xz * m.yz - m.xy * m.zz, m.xy * m.yz - m.xz * m.yy, m.xy * m.xz - m.xx * m.yz};
}

Symmetric3d squared(const Symmetric3d& m) {
  return {m.xx * m.xx + m.xy * m.xy + m.xz * m.xz, m.xy * m.xy + m.yy * m.yy + m.yz * m.yz,
          m.xz * m.xz + m.yz * m.yz + m.zz * m.zz, m.xx * m.xy + m.xy * m.yy + m.xz * m.yz,
          m.xx * m.xz + m.xy * m.yz + m.xz * m.zz, m.xy * m.xz + m.yy * m.yz + m.yz * m.zz};
}

Vec3d dominant_column(const Symmetric3d& m) {
  if (m.xx >= m.yy && m.xx >= m.zz) return Vec3d(m.xx, m.xy, m.xz).normalized();
  if (m.yy >= m.zz) return Vec3d(m.xy, m.yy, m.yz).normalized();
  return Vec3d(m.xz, m.yz, m.zz).normalized();
}

}  // namespace

bool smallest_eigenvector(const Symmetric3d& matrix, Vec3d& vector) {
  const double size = trace(matrix);
  if (!(size > 0.0)) {
    vector = Vec3d::UnitZ();
    return false;
  }
  const Symmetric3d m = scaled(matrix, 1.0 / size);
  Symmetric3d a = adjugate(m);
  constexpr double kCollinear = 1e-12;  // l2 l3 / (l1 + l2 + l3)^2
  if (trace(a) < kCollinear) {
    // The points lie on a line: any direction across it will do, the one farthest from an axis for stability.
    const Vec3d along = dominant_column(m);
    Eigen::Index least = 0;
    along.cwiseAbs().minCoeff(&least);
    const Vec3d axis = Vec3d::Unit(least);
    vector = along.cross(axis).normalized();
    return false;
  }
  // The ratio of the eigenvalues to the 64th power.
  for (int squaring = 0; squaring < 6; ++squaring) a = squared(scaled(a, 1.0 / trace(a)));
  vector = dominant_column(a);
  return true;
}

bool PlaneFit::normal(Vec3d& n) const {
  const Vec3d c = centroid();
  const Symmetric3d s = scaled(second_, 1.0 / weight_);
  return smallest_eigenvector({s.xx - c.x() * c.x(), s.yy - c.y() * c.y(), s.zz - c.z() * c.z(),
                               s.xy - c.x() * c.y(), s.xz - c.x() * c.z(), s.yz - c.y() * c.z()},
                              n);  // Eq. (4)
}

}  // namespace pointwright
