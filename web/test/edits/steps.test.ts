import { expect, test } from "vitest";
import type { ElementaryDeformation } from "../../src/api/types";
import { alongNormal, rotation, scaling, towardPoint, translation } from "../../src/edits/deformation";
import {
  allSteps,
  composed,
  MAX_STEPS,
  maySwap,
  normalStep,
  ONE_STEP,
  type Steps,
  withNormalFirst,
  withoutStep,
  withStepAdded,
  withStepChosen,
  withSwapped,
} from "../../src/edits/steps";

const A = translation([1, 0, 0]);
const B = rotation([0, 0, 0], [0, 1, 0], 30);
const C = scaling([0, 0, 0], [2, 2, 2]);
const N = alongNormal(0.1);

function added(steps: Steps, current: ElementaryDeformation): Steps {
  const next = withStepAdded(steps, current);
  if (!next) throw new Error("no room");
  return next;
}

test("one step is sent as it is, several as a sequence without those that do nothing", () => {
  expect(composed(ONE_STEP, null)).toBeNull();
  expect(composed(ONE_STEP, A)).toBe(A);
  const two = added(ONE_STEP, A);
  expect(composed(two, null)).toBe(A);
  expect(composed(two, towardPoint([0, 0, 0], 0))).toBe(A);
  expect(composed(two, B)).toEqual({ type: "sequence", steps: [A, B] });
});

test("a step that does nothing makes no room for another, and eight are the most", () => {
  expect(withStepAdded(ONE_STEP, null)).toBeNull();
  expect(withStepAdded(ONE_STEP, translation([0, 0, 0]))).toBeNull();
  let steps = ONE_STEP;
  for (let i = 1; i < MAX_STEPS; ++i) steps = added(steps, A);
  expect(allSteps(steps, B)).toHaveLength(MAX_STEPS);
  expect(withStepAdded(steps, B)).toBeNull();
});

test("another step is taken up where it stands", () => {
  const three = added(added(ONE_STEP, A), B);
  const chosen = withStepChosen(three, C, 0);
  expect(chosen?.current).toBe(A);
  expect(chosen && composed(chosen.steps, chosen.current)).toEqual({ type: "sequence", steps: [A, B, C] });
  // An empty one goes when it is left.
  const left = withStepChosen(three, null, 1);
  expect(left?.current).toBe(B);
  expect(left && allSteps(left.steps, left.current)).toEqual([A, B]);
  expect(withStepChosen(three, C, 2)).toBeNull();
  expect(withStepChosen(three, C, 9)).toBeNull();
});

test("a step goes, and the one before it is current where it was", () => {
  const three = added(added(ONE_STEP, A), B);
  const withoutFirst = withoutStep(three, C, 0);
  expect(allSteps(withoutFirst.steps, withoutFirst.current)).toEqual([B, C]);
  expect(withoutFirst.current).toBe(C);
  const withoutCurrent = withoutStep(three, C, 2);
  expect(allSteps(withoutCurrent.steps, withoutCurrent.current)).toEqual([A, B]);
  expect(withoutCurrent.current).toBe(B);
  expect(withoutStep(ONE_STEP, A, 0)).toEqual({ steps: ONE_STEP, current: null });
});

test("steps change places, but along the normal stays the first", () => {
  const three = added(added(ONE_STEP, A), B);
  const swapped = withSwapped(three, C, 1);
  expect(allSteps(swapped, C)).toEqual([A, C, B]);
  expect(allSteps(withSwapped(three, C, 0), C)).toEqual([B, A, C]);
  const first = withNormalFirst(added(ONE_STEP, A));
  expect(allSteps(first, N)).toEqual([N, A]);
  expect(normalStep(first, N)).toBe(0);
  expect(normalStep(three, C)).toBe(-1);
  expect(maySwap(first, N, 0)).toBe(false);
  expect(withSwapped(first, N, 0)).toBe(first);
  expect(maySwap(three, C, 2)).toBe(false);
  expect(maySwap(three, C, -1)).toBe(false);
});
