import { expect, test } from "vitest";
import { distanceToSegment, type Vec3 } from "../../src/math/vec3";
import {
  isDepthJump,
  isNewVertex,
  simplifyStroke,
  steppedRadius,
  strokeOperation,
} from "../../src/tools/stroke";

test("a straight stroke keeps its ends alone", () => {
  const line = Array.from({ length: 100 }, (_, i): Vec3 => [i, 2 * i, 0]);
  expect(simplifyStroke(line, 0.01)).toEqual([line[0], line[99]]);
});

test("a corner stays", () => {
  expect(
    simplifyStroke(
      [
        [0, 0, 0],
        [1, 0, 0],
        [2, 0, 0],
        [2, 1, 0],
        [2, 2, 0],
      ],
      0.1,
    ),
  ).toEqual([
    [0, 0, 0],
    [2, 0, 0],
    [2, 2, 0],
  ]);
});

test("no vertex of a wild stroke is further than the tolerance from what is kept", () => {
  const wild = Array.from(
    { length: 500 },
    (_, i): Vec3 => [Math.cos(i * 0.05) * i * 0.01, Math.sin(i * 0.05) * i * 0.01, Math.sin(i * 0.31) * 0.05],
  );
  const kept = simplifyStroke(wild, 0.02);
  expect(kept.length).toBeLessThan(wild.length / 2);
  for (const vertex of wild) {
    const off = Math.min(...kept.slice(1).map((b, i) => distanceToSegment(vertex, kept[i] ?? b, b)));
    expect(off).toBeLessThanOrEqual(0.02 + 1e-12);
  }
});

test("a stroke of one or no vertex stays as it is", () => {
  expect(simplifyStroke([], 1)).toEqual([]);
  expect(simplifyStroke([[1, 2, 3]], 1)).toEqual([[1, 2, 3]]);
});

test("a stroke that returns to its beginning keeps its turn", () => {
  expect(
    simplifyStroke(
      [
        [0, 0, 0],
        [3, 0, 0],
        [0, 0, 0],
      ],
      0.1,
    ),
  ).toEqual([
    [0, 0, 0],
    [3, 0, 0],
    [0, 0, 0],
  ]);
});

test("a jump in depth begins a new part, a slide along the surface does not", () => {
  expect(isDepthJump([0, 0, 0], [0.1, 0, -5], 10, 15, 1)).toBe(true);
  expect(isDepthJump([0, 0, 0], [0.1, 0, -1], 10, 11, 1)).toBe(false);
});

test("vertices are taken a part of the radius apart", () => {
  expect(isNewVertex(undefined, [0, 0, 0], 1)).toBe(true);
  expect(isNewVertex([0, 0, 0], [0.1, 0, 0], 1)).toBe(false);
  expect(isNewVertex([0, 0, 0], [0.2, 0, 0], 1)).toBe(true);
});

test("the radius steps by equal parts and stays sensible", () => {
  expect(steppedRadius(1, 1, 100) / 1).toBeCloseTo(1.15);
  expect(steppedRadius(steppedRadius(1, 1, 100), -1, 100)).toBeCloseTo(1);
  expect(steppedRadius(1, 1000, 10)).toBe(5);
  expect(steppedRadius(1, -1000, 10)).toBeCloseTo(0.005);
});

test("a touch becomes a sphere, a stroke a polyline; painting takes from the other region, erasing does not", () => {
  expect(strokeOperation([[1, 2, 3]], 0.5, [0, 0, 1], false)).toEqual({
    mode: "add",
    shape: { type: "sphere", center: [1, 2, 3], radius: 0.5 },
    facing: [0, 0, 1],
    steal: true,
  });
  expect(
    strokeOperation(
      [
        [0, 0, 0],
        [1, 0, 0],
        [2, 0, 0],
      ],
      0.5,
      [0, 0, 1],
      true,
    ),
  ).toEqual({
    mode: "remove",
    shape: {
      type: "stroke",
      vertices: [
        [0, 0, 0],
        [2, 0, 0],
      ],
      radius: 0.5,
    },
    facing: [0, 0, 1],
  });
});
