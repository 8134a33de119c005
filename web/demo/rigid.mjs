// The rigid motion that best carries one set of points to another (Horn 1987: the unit quaternion that is the eigenvector
// of the greatest eigenvalue of a symmetric 4 x 4 matrix).

/** Eigenvector of the greatest eigenvalue of a symmetric matrix, by Jacobi rotations. */
function greatestEigenvector(matrix) {
  const n = matrix.length;
  const a = matrix.map((row) => [...row]);
  const vectors = a.map((_, i) => a.map((__, j) => (i === j ? 1 : 0)));
  for (let sweep = 0; sweep < 50; sweep++) {
    for (let p = 0; p < n; p++) {
      for (let q = p + 1; q < n; q++) {
        if (Math.abs(a[p][q]) < 1e-300) continue;
        const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
        const c = 1 / Math.hypot(t, 1);
        const s = t * c;
        for (const m of [a, vectors]) {
          for (const row of m) [row[p], row[q]] = [c * row[p] - s * row[q], s * row[p] + c * row[q]];
        }
        for (let j = 0; j < n; j++)
          [a[p][j], a[q][j]] = [c * a[p][j] - s * a[q][j], s * a[p][j] + c * a[q][j]];
      }
    }
  }
  const best = a.reduce((winner, row, i) => (row[i] > a[winner][winner] ? i : winner), 0);
  return vectors.map((row) => row[best]);
}

/** Rotates v by the unit quaternion (w, x, y, z). */
function rotate([w, ...u], v) {
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const c = cross(u, v);
  const cc = cross(u, c);
  return v.map((value, i) => value + 2 * (w * c[i] + cc[i]));
}

/**
 * Points of `from` and `to` at `indices`, three numbers a point. Answers the motion's {angleDeg, axis (unit, so that the
 * angle is not negative), rms, max}: the residuals of the points against it, in their own unit.
 */
export function fitRigidMotion(from, to, indices) {
  const mean = (points) => {
    const sum = [0, 0, 0];
    for (const i of indices) for (let axis = 0; axis < 3; axis++) sum[axis] += points[3 * i + axis];
    return sum.map((value) => value / indices.length);
  };
  const [fromMean, toMean] = [mean(from), mean(to)];
  // biome-ignore format: a matrix
  const s = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  for (const i of indices) {
    for (let row = 0; row < 3; row++) {
      for (let column = 0; column < 3; column++) {
        s[row][column] += (from[3 * i + row] - fromMean[row]) * (to[3 * i + column] - toMean[column]);
      }
    }
  }
  const [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
  const quaternion = greatestEigenvector([
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ]);
  const sign = quaternion[0] < 0 ? -1 : 1;
  const sine = Math.hypot(...quaternion.slice(1));
  const axis = quaternion.slice(1).map((value) => (sign * value) / (sine || 1));
  let sum = 0;
  let max = 0;
  for (const i of indices) {
    const turned = rotate(
      quaternion,
      [0, 1, 2].map((k) => from[3 * i + k] - fromMean[k]),
    );
    const error = Math.hypot(...turned.map((value, k) => value + toMean[k] - to[3 * i + k]));
    sum += error * error;
    max = Math.max(max, error);
  }
  return {
    angleDeg: (2 * Math.atan2(sine, Math.abs(quaternion[0])) * 180) / Math.PI,
    axis,
    rms: Math.sqrt(sum / indices.length),
    max,
  };
}
