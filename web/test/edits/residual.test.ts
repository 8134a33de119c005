import { expect, test } from "vitest";
import type { Blend, Deformation, ElementaryDeformation } from "../../src/api/types";
import {
  alongNormal,
  rotation,
  scaling,
  towardPoint,
  translation,
  twisting,
} from "../../src/edits/deformation";
import { inScene, lookAhead, residual } from "../../src/edits/residual";
import { subtract, type Vec3 } from "../../src/math/vec3";
import { ahead, deform, reblended } from "../mock/deform";

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

const sequence = (...steps: ElementaryDeformation[]): Deformation => ({ type: "sequence", steps });

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
  expectComposes(null, towardPoint(point, 0.4));
  expectComposes(towardPoint(point, 0.4), towardPoint(point, -2));
  expectComposes(towardPoint(point, 0.4), null);
  const first = translation([1, 2, 3]);
  expectComposes(first, sequence(first, rotation(point, axis, 50)));
  expectComposes(sequence(first, rotation(point, axis, 50)), first);
  expectComposes(sequence(first, twisting(point, axis, 50, 1)), sequence(first, twisting(point, axis, 9, 1)));
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
  // What was drawn into one point cannot be drawn out of it.
  expect(residual(others, null)).toBeNull();
  const two = sequence(translation([1, 0, 0]), rotation([0, 0, 0], [0, 1, 0], 5));
  expect(residual(null, two)).toBeNull();
  expect(residual(sequence(alongNormal(1), translation([1, 0, 0])), translation([1, 0, 0]))).toBeNull();
  expect(residual(others, translation([1, 0, 0]))).toBeNull();
  expect(residual(rotation([1, 0, 0], [0, 1, 0], 5), rotation([0, 0, 0], [0, 1, 0], 5))).toBeNull();
});

test("a quartic t turns into that of another blend", () => {
  const blends: Record<Blend, (x: number) => number> = {
    quartic: (x) => (x * x - 1) ** 2,
    cubic: (x) => (1 - x) ** 2 * (1 + 2 * x),
    quintic: (x) => (1 - x) ** 3 * (1 + 3 * x + 6 * x * x),
    cosine: (x) => (1 + Math.cos(Math.PI * x)) / 2,
  };
  for (const [name, blend] of Object.entries(blends))
    for (const x of [0, 0.01, 0.3, 0.7, 0.99, 1])
      expect(reblended(blends.quartic(x), name as Blend)).toBeCloseTo(blend(x), 9);
});

test("the look ahead says whether it covers what is wanted", () => {
  const plain = { blend: "quartic", gains: "" } as const;
  const moved = (x: number, under: { blend: Blend; gains: string } = plain) => ({
    deformation: translation([x, 0, 0]),
    under,
  });
  const cosine = { blend: "cosine", gains: "" } as const;
  expect(lookAhead(null, moved(1), "quartic")).toMatchObject({ covered: true, blend: null });
  expect(lookAhead(null, moved(1, cosine), "quartic")).toMatchObject({ covered: true, blend: "cosine" });
  expect(lookAhead(null, moved(1, cosine), null)).toMatchObject({ covered: false, blend: null });
  expect(lookAhead(moved(1, cosine), moved(2, cosine), "cosine")).toMatchObject({
    covered: true,
    blend: null,
  });
  expect(lookAhead(moved(1), moved(2, cosine), "quartic")).toEqual({
    residual: null,
    blend: null,
    covered: false,
  });
  expect(lookAhead(moved(1), moved(1, { ...plain, gains: "0" }), "quartic").covered).toBe(false);
  const gone = { ...plain, gains: "0.5" };
  expect(lookAhead(moved(1, gone), moved(2, gone), "quartic").covered).toBe(true);
});
