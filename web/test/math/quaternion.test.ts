import { expect, test } from "vitest";
import {
  axisAngleOf,
  inverse,
  multiply,
  NO_TURN,
  type Quaternion,
  quaternionOf,
  turnFromZ,
} from "../../src/math/quaternion";
import { normalise, type Vec3 } from "../../src/math/vec3";

function quaternion(axis: Vec3, angleDeg: number): Quaternion {
  const half = (angleDeg * Math.PI) / 360;
  const s = Math.sin(half);
  return [axis[0] * s, axis[1] * s, axis[2] * s, Math.cos(half)];
}

function expectVector(actual: Vec3, expected: Vec3, digits = 9): void {
  actual.forEach((value, axis) => {
    expect(value).toBeCloseTo(expected[axis] ?? Number.NaN, digits);
  });
}

test("a quaternion's axis and angle are told back", () => {
  for (const angle of [-170, -30, 0.5, 45, 179]) {
    const { direction, angleDeg } = axisAngleOf(quaternion([0, 0.6, 0.8], angle));
    const sign = Math.sign(angleDeg) * Math.sign(angle);
    expect(angleDeg * sign).toBeCloseTo(angle, 6);
    expectVector([direction[0] * sign, direction[1] * sign, direction[2] * sign], [0, 0.6, 0.8]);
  }
});

test("a gizmo that turns on and on counts beyond half a turn, both ways", () => {
  for (const step of [25, -25]) {
    let known = axisAngleOf(quaternion([0, 1, 0], step));
    const sense = known.direction[1] > 0 ? 1 : -1;
    for (let angle = step; Math.abs(angle) <= 800; angle += step) {
      known = axisAngleOf(quaternion([0, 1, 0], angle), known);
      expect(known.angleDeg * sense).toBeCloseTo(angle, 6);
    }
  }
});

test("no rotation keeps the axis that was known", () => {
  expect(axisAngleOf([0, 0, 0, 1], { direction: [1, 0, 0], angleDeg: 3 })).toEqual({
    direction: [1, 0, 0],
    angleDeg: 0,
  });
});

/** q v q*. */
function applied(q: Quaternion, v: Vec3): Vec3 {
  const [x, y, z] = multiply(multiply(q, [...v, 0]), inverse(q));
  return [x, y, z];
}

test("the z axis is turned to any direction, its opposite too", () => {
  for (const direction of [
    [0, 0, 2],
    [0, 0, -1],
    [3, 0, 0],
    [0.2, 0.9, -0.3],
  ] as Vec3[])
    expectVector(applied(turnFromZ(direction), [0, 0, 1]), normalise(direction));
});

test("turns follow one another and are undone", () => {
  const a = quaternionOf({ direction: [0, 0, 5], angleDeg: 90 });
  const b = quaternionOf({ direction: [1, 0, 0], angleDeg: 90 });
  expectVector(applied(a, [1, 0, 0]), [0, 1, 0]);
  expectVector(applied(multiply(b, a), [1, 0, 0]), [0, 0, 1]);
  multiply(a, inverse(a)).forEach((value, k) => {
    expect(value).toBeCloseTo(NO_TURN[k] ?? Number.NaN, 12);
  });
});
