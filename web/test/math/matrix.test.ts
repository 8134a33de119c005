import { expect, test } from "vitest";
import { placement } from "../../src/math/matrix";
import type { Vec3 } from "../../src/math/vec3";

function apply(matrix: readonly number[], p: Vec3): Vec3 {
  const row = (r: number): number =>
    (matrix[4 * r] ?? 0) * p[0] +
    (matrix[4 * r + 1] ?? 0) * p[1] +
    (matrix[4 * r + 2] ?? 0) * p[2] +
    (matrix[4 * r + 3] ?? 0);
  return [row(0), row(1), row(2)];
}

test("nothing is the identity, and quarter turns are exact", () => {
  expect(placement([0, 0, 0], [0, 0, 0], 1)).toEqual([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  expect(apply(placement([0, 0, 0], [90, 0, 0], 1), [0, 1, 0])).toEqual([0, 0, 1]);
  expect(apply(placement([0, 0, 0], [0, 90, 0], 1), [0, 0, 1])).toEqual([1, 0, 0]);
  expect(apply(placement([0, 0, 0], [0, 0, 90], 1), [1, 0, 0])).toEqual([0, 1, 0]);
  expect(apply(placement([0, 0, 0], [-270, 0, 360], 1), [0, 1, 0])).toEqual([0, 0, 1]);
});

test("it scales, turns about x, then y, then z, and moves last", () => {
  // x → (90° about x) x → (90° about y) -z → (90° about z) -z, twice as long, moved.
  expect(apply(placement([1, 2, 3], [90, 90, 90], 2), [1, 0, 0])).toEqual([1, 2, 1]);
  const m = placement([0, 0, 0], [20, -35, 70], 1);
  for (const [a, b] of [
    [0, 0],
    [0, 1],
    [1, 2],
    [2, 2],
  ] as const) {
    const product = [0, 1, 2].reduce((sum, k) => sum + (m[4 * a + k] ?? 0) * (m[4 * b + k] ?? 0), 0);
    expect(product).toBeCloseTo(a === b ? 1 : 0, 12);
  }
});
