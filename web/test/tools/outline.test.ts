import { PerspectiveCamera } from "three";
import { expect, test } from "vitest";
import type { Vec2 } from "../../src/api/types";
import type { Vec3 } from "../../src/math/vec3";
import { pathOf } from "../../src/scene/outline-layer";
import { placeRectangle, squareView, toSquare } from "../../src/scene/view-matrix";
import {
  ellipseOutline,
  lineOutline,
  polygonOutline,
  rectangleCorners,
  simplifyCurve,
} from "../../src/tools/outline";

const WIDE = { width: 800, height: 400 };
const TALL = { width: 300, height: 600 };

test("the longer side of the picture spans -1 to 1, in units that are square", () => {
  expect(toSquare([0, 0], WIDE)).toEqual([-1, 0.5]);
  expect(toSquare([800, 400], WIDE)).toEqual([1, -0.5]);
  expect(toSquare([400, 200], WIDE)).toEqual([0, 0]);
  expect(toSquare([0, 0], TALL)).toEqual([-0.5, 1]);
  expect(toSquare([300, 600], TALL)).toEqual([0.5, -1]);
});

test.each([WIDE, TALL])("the view projects a point of the model to its pixel in %j", (size) => {
  const camera = new PerspectiveCamera(32, size.width / size.height, 0.1, 100);
  camera.position.set(3, 2, 7);
  camera.lookAt(0.2, -0.1, 0.3);
  camera.updateMatrixWorld();
  const origin: Vec3 = [1000, -2000, 500];
  const view = squareView(camera.projectionMatrix.elements, camera.matrixWorldInverse.elements, origin, size);
  expect(view).toHaveLength(16);
  for (const p of [
    [0, 0, 0],
    [0.7, -0.4, 1.1],
    [-1.3, 0.9, 0.2],
  ] as Vec3[]) {
    const ndc = camera.position
      .clone()
      .set(...p)
      .project(camera);
    const pixel: Vec2 = [((ndc.x + 1) / 2) * size.width, ((1 - ndc.y) / 2) * size.height];
    const [x, y] = toSquare(pixel, size);
    const row = (r: number): number =>
      [...p.map((value, axis) => value + (origin[axis] ?? 0)), 1].reduce(
        (sum, value, k) => sum + value * (view[4 * r + k] ?? 0),
        0,
      );
    expect(row(3)).toBeGreaterThan(0);
    expect(row(0) / row(3)).toBeCloseTo(x, 9);
    expect(row(1) / row(3)).toBeCloseTo(y, 9);
    expect(row(2) / row(3)).toBeCloseTo(ndc.z, 9);
  }
});

test("outlines are what the hand drew, in the view's coordinates", () => {
  expect(polygonOutline(rectangleCorners([200, 100], [600, 300]), WIDE)).toEqual({
    type: "polygon",
    vertices: [
      [-0.5, 0.25],
      [0.5, 0.25],
      [0.5, -0.25],
      [-0.5, -0.25],
    ],
  });
  expect(ellipseOutline([600, 100], [200, 300], WIDE)).toEqual({
    type: "ellipse",
    center: [0, 0],
    half_axes: [0.5, 0.25],
  });
  expect(
    lineOutline(
      [
        [400, 200],
        [800, 200],
      ],
      40,
      WIDE,
    ),
  ).toEqual({
    type: "polyline",
    vertices: [
      [0, 0],
      [1, 0],
    ],
    width: 0.1,
  });
});

test("what encloses nothing is no outline", () => {
  expect(polygonOutline([], WIDE)).toBeNull();
  expect(polygonOutline([[5, 5]], WIDE)).toBeNull();
  expect(polygonOutline(rectangleCorners([5, 5], [6, 300]), WIDE)).toBeNull();
  expect(ellipseOutline([5, 5], [5, 300], WIDE)).toBeNull();
  expect(lineOutline([], 4, WIDE)).toBeNull();
  expect(lineOutline([[5, 5]], 0, WIDE)).toBeNull();
});

test("a long curve keeps its form in as many vertices as may be", () => {
  const circle = Array.from(
    { length: 5000 },
    (_, i): Vec2 => [200 + 150 * Math.cos(i / 400), 200 + 150 * Math.sin(i / 400)],
  );
  expect(simplifyCurve(circle).length).toBeLessThan(500);
  const few = simplifyCurve(circle, 20);
  expect(few.length).toBeLessThanOrEqual(20);
  for (const [x, y] of few) expect(Math.hypot(x - 200, y - 200)).toBeCloseTo(150, 6);
});

test("a rectangle of pixels stands in the plane of the focus", () => {
  const plane = {
    focus: [1, 2, 3] as Vec3,
    focusPixel: [400, 200] as Vec2,
    right: [0, 0, -1] as Vec3,
    up: [0, 1, 0] as Vec3,
    perPixel: 0.01,
  };
  const { origin, u, v } = placeRectangle(plane, [300, 150], { width: 200, height: 100 });
  // From 100 pixels left of the focus to 100 right of it, and from 50 below to 50 above.
  expect(origin.map((value) => Number(value.toFixed(9)))).toEqual([1, 1.5, 4]);
  expect(u.map(Math.abs)).toEqual([0, 0, 2]);
  expect(u[2]).toBe(-2);
  expect(v).toEqual([0, 1, 0]);
});

test("a curve becomes the path that shows it", () => {
  const points: Vec2[] = [
    [1, 2],
    [3, 4],
    [5, 6],
  ];
  expect(pathOf({ kind: "path", points, closed: true })).toBe("M1.0 2.0L3.0 4.0L5.0 6.0Z");
  expect(pathOf({ kind: "band", points, width: 3 })).toBe("M1.0 2.0L3.0 4.0L5.0 6.0");
  expect(pathOf({ kind: "path", points: [], closed: true })).toBe("");
  expect(pathOf({ kind: "ellipse", center: [5, 5], halfAxes: [2, 1] })).toBe(
    "M3.0 5.0A2.0 1.0 0 1 0 7.0 5.0A2.0 1.0 0 1 0 3.0 5.0Z",
  );
});
