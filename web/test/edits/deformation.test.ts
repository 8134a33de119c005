import { expect, test } from "vitest";
import type { Deformation } from "../../src/api/types";
import {
  alongNormal,
  deformationFault,
  describeDeformation,
  describeEdit,
  isIdentity,
  rotation,
  scaling,
  translation,
  twisting,
  withPivot,
} from "../../src/edits/deformation";

const Y = [0, 1, 0] as const;
const O = [0, 0, 0] as const;

test("what cannot be sent is told why", () => {
  expect(deformationFault(translation([1, 2, 3]))).toBeNull();
  expect(deformationFault(translation([1, Number.NaN, 3]))).toMatch(/vector/);
  expect(deformationFault(rotation(O, O, 10))).toMatch(/direction/);
  expect(deformationFault(rotation(O, Y, Number.NaN))).toMatch(/angle/);
  expect(deformationFault(rotation(O, Y, 36_001))).toMatch(/100 turns/);
  expect(deformationFault(scaling(O, [1, 0.001, 1000]))).toBeNull();
  expect(deformationFault(scaling(O, [1, 0, 1]))).toMatch(/factor/);
  expect(deformationFault(scaling(O, [1, 1, 1001]))).toMatch(/factor/);
  expect(deformationFault(scaling(O, [1, Number.NaN, 1]))).toMatch(/factor/);
  expect(deformationFault(scaling([0, Number.NaN, 0], [1, 2, 1]))).toMatch(/pivot/);
  expect(deformationFault(twisting(O, Y, 90, 0.5))).toBeNull();
  expect(deformationFault(twisting(O, Y, 90, 0))).toMatch(/length/);
  expect(deformationFault(twisting(O, O, 90, 1))).toMatch(/direction/);
  expect(deformationFault(alongNormal(-3))).toBeNull();
  expect(deformationFault(alongNormal(Number.NaN))).toMatch(/distance/);
  expect(deformationFault({ type: "sequence", steps: [scaling(O, [0, 1, 1]) as never] })).toMatch(/factor/);
});

test("what moves nothing is known", () => {
  const still: Deformation[] = [
    translation(O),
    rotation(O, Y, 0),
    scaling([1, 2, 3], [1, 1, 1]),
    twisting(O, Y, 0, 2),
    alongNormal(0),
    { type: "toward_point", target: [1, 1, 1], amount: 0 },
    { type: "sequence", steps: [{ type: "translation", vector: O }] },
  ];
  for (const each of still) expect(isIdentity(each), each.type).toBe(true);
  for (const each of [scaling(O, [1, 1, 1.01]), twisting(O, Y, 1, 2), alongNormal(-1)])
    expect(isIdentity(each), each.type).toBe(false);
});

test("edits in words", () => {
  expect(describeDeformation(rotation(O, Y, 12.34567))).toBe("Turned 12.35° about 0, 1, 0");
  expect(describeDeformation(translation([0, 0.5, 0]))).toBe("Moved 0, 0.5, 0");
  expect(describeDeformation(scaling(O, [1.5, 1.5, 1.5]))).toBe("Scaled 1.5×");
  expect(describeDeformation(scaling(O, [1, 2, 1]))).toBe("Scaled 1, 2, 1×");
  expect(describeDeformation(twisting(O, Y, 90, 2))).toBe("Twisted 90°");
  expect(describeDeformation(alongNormal(0.25))).toBe("Raised 0.25");
  expect(describeDeformation(alongNormal(-0.25))).toBe("Carved 0.25");
  expect(describeDeformation({ type: "toward_point", target: [1, 2, 3], amount: 0.25 })).toBe(
    "Drawn 25 % toward 1, 2, 3",
  );
  const steps = [
    { type: "translation", vector: [1, 0, 0] },
    { type: "scale", center: O, factors: [2, 2, 2] },
  ] as const;
  expect(describeDeformation({ type: "sequence", steps: [...steps] })).toBe("Moved 1, 0, 0, then scaled 2×");
  expect(describeEdit({ level: 0, deformation: twisting(O, Y, 90, 2) })).toBe("Twisted 90°");
  expect(describeEdit({ level: 0, deformation: twisting(O, Y, 90, 2), gains: [0, 1] })).toBe(
    "Twisted 90°, detail 0, 1×",
  );
  expect(describeEdit({ level: 0, deformation: translation(O), gains: [1.5, 1.5] })).toBe("Detail 1.5×");
});

test("a pivot is the point that a deformation starts from", () => {
  const to = [1, 2, 3] as const;
  expect(withPivot(scaling(O, [2, 2, 2]), to)).toEqual(scaling(to, [2, 2, 2]));
  expect(withPivot(twisting(O, Y, 90, 2), to)).toEqual(twisting(to, Y, 90, 2));
  expect(withPivot(rotation(O, Y, 90), to)).toEqual(rotation(to, Y, 90));
  expect(withPivot(translation([1, 0, 0]), to)).toBeNull();
});
