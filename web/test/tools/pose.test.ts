import { expect, test } from "vitest";
import type { ElementaryDeformation } from "../../src/api/types";
import {
  alongNormal,
  rotation,
  scaling,
  towardPoint,
  translation,
  twisting,
} from "../../src/edits/deformation";
import { DEFAULT_RESAMPLING } from "../../src/edits/resampling";
import type { TransformKind, TransformState } from "../../src/event-map";
import { multiply, quaternionOf } from "../../src/math/quaternion";
import { normalise, type Vec3 } from "../../src/math/vec3";
import { deformationOf, poseOf } from "../../src/tools/pose";

const PIVOT: Vec3 = [1, 2, 3];
const AXIS: Vec3 = [0.2, 0.9, -0.3];

function stateOf(deformation: ElementaryDeformation | null): TransformState {
  return {
    deformation,
    steps: [deformation],
    step: 0,
    pivot: PIVOT,
    axis: null,
    pivotEditing: false,
    twist: { direction: AXIS, length: 0.5 },
    level: 0,
    blend: "quartic",
    gains: [1],
    resampling: DEFAULT_RESAMPLING,
    resamplingFault: null,
    obstacle: null,
  };
}

const CASES: [TransformKind, ElementaryDeformation][] = [
  ["move", translation([0.5, -1, 0])],
  ["rotate", rotation(PIVOT, normalise(AXIS), 130)],
  ["scale", scaling(PIVOT, [2, 0.5, 1])],
  ["twist", twisting(PIVOT, AXIS, -75, 0.5)],
  ["normal", alongNormal(0.25)],
  ["toward", towardPoint(PIVOT, 0.5)],
];

function numbersOf(value: unknown): number[] {
  if (typeof value === "number") return [value];
  return typeof value === "object" && value ? Object.values(value).flatMap(numbersOf) : [];
}

test.each(CASES)("the handles of %s tell back what they were put to", (kind, deformation) => {
  const state = stateOf(deformation);
  const told = deformationOf(kind, state, poseOf(kind, state));
  expect(told.type).toBe(deformation.type);
  const expected = numbersOf(deformation);
  numbersOf(told).forEach((value, k) => {
    expect(value).toBeCloseTo(expected[k] ?? Number.NaN, 9);
  });
});

test("a ring that is turned on and on twists beyond half a turn", () => {
  let state = stateOf(null);
  for (let angle = 40; angle <= 400; angle += 40) {
    const start = poseOf("twist", stateOf(null)).quaternion;
    const quaternion = multiply(quaternionOf({ direction: AXIS, angleDeg: angle }), start);
    const told = deformationOf("twist", state, { position: PIVOT, quaternion, scale: [1, 1, 1] });
    expect(told.type === "twist" && told.angle_deg).toBeCloseTo(angle, 6);
    state = stateOf(told);
  }
});

test("a typed axis of any length is one to the rings", () => {
  const state = stateOf(rotation(PIVOT, [0, 3, 0], 170));
  const quaternion = quaternionOf({ direction: [0, 1, 0], angleDeg: 190 });
  const told = deformationOf("rotate", state, { position: PIVOT, quaternion, scale: [1, 1, 1] });
  expect(told.type === "rotation" && told.angle_deg).toBeCloseTo(190, 6);
});

test("handles that are drawn through the pivot do not turn the surface inside out", () => {
  const pose = { ...poseOf("scale", stateOf(null)), scale: [-2, 0, 1e9] as const };
  expect(deformationOf("scale", stateOf(null), pose)).toEqual(scaling(PIVOT, [0.001, 0.001, 1000]));
});

test("the pivot is dragged by handles that stand where it is", () => {
  const state = { ...stateOf(translation([5, 5, 5])), pivotEditing: true };
  for (const kind of ["move", "scale", "twist"] as const)
    expect(poseOf(kind, state)).toEqual({ position: PIVOT, quaternion: [0, 0, 0, 1], scale: [1, 1, 1] });
});
