import { expect, test } from "vitest";
import type { Deformation } from "../../src/api/types";
import {
  axisAngleOf,
  deformationFault,
  describeDeformation,
  isIdentity,
  type Quaternion,
  residual,
  rotation,
  translation,
} from "../../src/edits/deformation";
import type { Vec3 } from "../../src/math/vec3";
import { deform } from "../mock/session";

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

test("what cannot be sent is told why", () => {
  expect(deformationFault(translation([1, 2, 3]))).toBeNull();
  expect(deformationFault(translation([1, Number.NaN, 3]))).toMatch(/vector/);
  expect(deformationFault(rotation([0, 0, 0], [0, 0, 0], 10))).toMatch(/direction/);
  expect(deformationFault(rotation([0, 0, 0], [0, 1, 0], Number.NaN))).toMatch(/angle/);
  expect(isIdentity(translation([0, 0, 0]))).toBe(true);
  expect(isIdentity(rotation([0, 0, 0], [0, 1, 0], 0))).toBe(true);
  expect(describeDeformation(rotation([0, 0, 0], [0, 1, 0], 12.34567))).toBe("Rotate 12.35° about 0, 1, 0");
});

/** The residual takes what is shown to what is wanted, for every t. */
function expectComposes(shown: Deformation | null, wanted: Deformation | null): void {
  const rest = residual(shown, wanted);
  expect(rest).not.toBeNull();
  for (const t of [0, 0.3, 1]) {
    const p: Vec3 = [0.3, -0.7, 1.1];
    const there = shown ? deform(p, shown, t) : p;
    const goal = wanted ? deform(p, wanted, t) : p;
    expectVector(rest ? deform(there, rest, t) : there, goal);
  }
}

test("what the hand is ahead of the server composes with the frame on the screen", () => {
  const axis: Vec3 = [0.2, 0.9, -0.3];
  const point: Vec3 = [0.1, 0.2, 0.3];
  expectComposes(null, translation([1, 2, 3]));
  expectComposes(translation([1, 0, 0]), translation([1, 2, 3]));
  expectComposes(translation([1, 2, 3]), null);
  expectComposes(null, rotation(point, axis, 50));
  expectComposes(rotation(point, axis, 20), rotation(point, axis, 50));
  expectComposes(rotation(point, axis, 50), null);
  expectComposes(rotation(point, [-0.2, -0.9, 0.3], 20), rotation(point, axis, 50));
  expectComposes(rotation([0.1 + 0.2, 0.2 + 0.9, 0.3 - 0.3], axis, 20), rotation(point, axis, 50));
});

test("deformations that do not compose are left to the server", () => {
  expect(residual(translation([1, 0, 0]), rotation([0, 0, 0], [0, 1, 0], 5))).toBeNull();
  expect(residual(rotation([0, 0, 0], [0, 1, 0], 5), translation([1, 0, 0]))).toBeNull();
  expect(residual(rotation([0, 0, 0], [0, 1, 0], 5), rotation([0, 0, 0], [1, 0, 0], 5))).toBeNull();
  expect(residual(rotation([1, 0, 0], [0, 1, 0], 5), rotation([0, 0, 0], [0, 1, 0], 5))).toBeNull();
});
