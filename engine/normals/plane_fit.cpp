#include "engine/normals/plane_fit.h"

#include <cmath>

namespace pointwright {

bool smallest_eigenvector(const Mat3d& matrix, Vec3d& vector) {
  const double trace = matrix.trace();
  if (!(trace > 0.0)) {
    vector = Vec3d::UnitZ();
    return false;
  }
  const Mat3d m = matrix / trace;
  // The adjugate has the same eigenvectors with eigenvalues l2 l3, l1 l3, l1 l2: the smallest becomes the
  // largest.
  Mat3d a;
  a(0, 0) = m(1, 1) * m(2, 2) - m(1, 2) * m(1, 2);
  a(1, 1) = m(0, 0) * m(2, 2) - m(0, 2) * m(0, 2);
  a(2, 2) = m(0, 0) * m(1, 1) - m(0, 1) * m(0, 1);
  a(0, 1) = a(1, 0) = m(0, 2) * m(1, 2) - m(0, 1) * m(2, 2);
  a(0, 2) = a(2, 0) = m(0, 1) * m(1, 2) - m(0, 2) * m(1, 1);
  a(1, 2) = a(2, 1) = m(0, 1) * m(0, 2) - m(0, 0) * m(1, 2);
  constexpr double kCollinear = 1e-12;  // l2 l3 / (l1 + l2 + l3)^2
  const double size = a.trace();
  if (size < kCollinear) {
    // The points lie on a line: any direction across it will do, the one farthest from an axis for stability.
    Eigen::Index row = 0;
    m.diagonal().maxCoeff(&row);
    const Vec3d along = m.col(row).normalized();
    Eigen::Index least = 0;
    along.cwiseAbs().minCoeff(&least);
    vector = along.cross(Vec3d::Unit(least)).normalized();
    return false;
  }
  a /= size;
  for (int squaring = 0; squaring < 6; ++squaring) {  // the ratio of eigenvalues to the 64th power
    a = (a * a).eval();
    a /= a.trace();
  }
  Eigen::Index column = 0;
  a.diagonal().maxCoeff(&column);
  vector = a.col(column).normalized();
  return true;
}

}  // namespace pointwright
