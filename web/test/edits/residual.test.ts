import { expect, test } from "vitest";
import type { Deformation } from "../../src/api/types";
import { alongNormal, rotation, scaling, translation, twisting } from "../../src/edits/deformation";
import { inScene, residual } from "../../src/edits/residual";
import { subtract, type Vec3 } from "../../src/math/vec3";
import { ahead, deform } from "../mock/deform";

function expectVector(actual: Vec3, expected: Vec3, digits = 9): void {
  actual.forEach((value, axis) => {
    expect(value).toBeCloseTo(expected[axis] ?? Number.NaN, digits);
  });
}

const P: Vec3 = [0.3, -0.7, 1.1];
const NORMAL: Vec3 = [0.6, 0, 0.8];
const C: Vec3 = [0.1, 0.2, 0.3];
const AXIS: Vec3 = [0.2, 0.9, -0.3];

// What the engine's deform_point answers at P with t = 0.3, and the cofactors of its dF/dp on the normal.
const ENGINE: [Deformation, Vec3, Vec3][] = [
  [translation([1, -2, 3]), [0.6, -1.3, 2], NORMAL],
  [alongNormal(-0.25), [0.255, -0.7, 1.04], NORMAL],
  [
    rotation(C, AXIS, 50),
    [0.405991000746879, -0.761013016273185, 0.98762161834503],
    [0.770890569549893, -0.0946784021634122, 0.629891839876359],
  ],
  [scaling(C, [1.5, 0.5, 2]), [0.33, -0.565, 1.34], [0.64668525163516, 0, 0.762756963467112]],
  [
    twisting(C, AXIS, 120, 0.8),
    [-0.170067827723779, -0.555584901770028, 1.21986674287406],
    [-0.137214613151012, 0.233538855627665, 0.962617137209773],
  ],
];

test.each(ENGINE)("the closed form of %j is the engine's", (deformation, position, normal) => {
  const rest = residual(null, deformation);
  if (!rest) throw new Error("no closed form");
  const there = ahead(P, NORMAL, 0.3, rest);
  expectVector(there.p, position, 12);
  expectVector(there.normal, normal, 12);
  expectVector(deform(P, deformation, 0.3, NORMAL), position, 12);
});

test("the picture's coordinates start elsewhere", () => {
  const origin: Vec3 = [10, 20, 30];
  for (const [deformation, position] of ENGINE) {
    const rest = residual(null, deformation);
    if (!rest) throw new Error("no closed form");
    const scene = inScene(rest, (point) => subtract(point, origin));
    expectVector(ahead(subtract(P, origin), NORMAL, 0.3, scene).p, subtract(position, origin));
  }
});

/** The residual takes what is shown to what is wanted, for every t. */
function expectComposes(shown: Deformation | null, wanted: Deformation | null): void {
  const rest = residual(shown, wanted);
  expect(rest).not.toBeNull();
  for (const t of [0, 0.3, 1]) {
    const p: Vec3 = [0.3, -0.7, 1.1];
    const there = shown ? deform(p, shown, t, NORMAL) : p;
    const goal = wanted ? deform(p, wanted, t, NORMAL) : p;
    expectVector(rest ? ahead(there, NORMAL, t, rest).p : there, goal);
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
  expectComposes(null, scaling(point, [2, 0.5, 1]));
  expectComposes(scaling(point, [2, 0.5, 1]), scaling(point, [0.01, 3, 1]));
  expectComposes(scaling(point, [2, 0.5, 1]), null);
  expectComposes(null, twisting(point, axis, 90, 0.5));
  expectComposes(twisting(point, axis, 90, 0.5), twisting(point, axis, -200, 2));
  expectComposes(twisting(point, axis, 90, 0.5), twisting(point, [-0.2, -0.9, 0.3], 100, 0.5));
  expectComposes(twisting(point, axis, 90, 0.5), null);
  expectComposes(null, alongNormal(0.2));
  expectComposes(alongNormal(0.2), alongNormal(-0.1));
  expectComposes(alongNormal(0.2), null);
  expectComposes(translation([0, 0, 0]), twisting(point, axis, 90, 0.5));
  expectComposes(twisting(point, axis, 90, 0.5), translation([0, 0, 0]));
  expectComposes(rotation([0.1 + 0.2, 0.2 + 0.9, 0.3 - 0.3], axis, 20), rotation(point, axis, 50));
});

test("deformations that do not compose are left to the server", () => {
  expect(residual(translation([1, 0, 0]), rotation([0, 0, 0], [0, 1, 0], 5))).toBeNull();
  expect(residual(rotation([0, 0, 0], [0, 1, 0], 5), translation([1, 0, 0]))).toBeNull();
  expect(residual(rotation([0, 0, 0], [0, 1, 0], 5), rotation([0, 0, 0], [1, 0, 0], 5))).toBeNull();
  expect(residual(scaling([1, 0, 0], [2, 2, 2]), scaling([0, 0, 0], [3, 3, 3]))).toBeNull();
  expect(residual(twisting([0, 1, 0], [0, 1, 0], 5, 1), twisting([0, 0, 0], [0, 1, 0], 9, 1))).toBeNull();
  expect(residual(scaling([0, 0, 0], [2, 2, 2]), alongNormal(1))).toBeNull();
  const others: Deformation = { type: "toward_point", target: [1, 1, 1], amount: 1 };
  expect(residual(null, others)).toBeNull();
  expect(residual(others, translation([1, 0, 0]))).toBeNull();
  expect(residual(rotation([1, 0, 0], [0, 1, 0], 5), rotation([0, 0, 0], [0, 1, 0], 5))).toBeNull();
});
