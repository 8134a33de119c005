import { expect, test } from "vitest";
import { distance, dot, normalise, subtract } from "../../src/math/vec3";
import {
  clipPlanes,
  decodeCamera,
  encodeCamera,
  frameSphere,
  framingDistance,
  VIEW_NAMES,
  VIEWS,
  worldPerPixel,
} from "../../src/scene/camera-math";

test("a framed sphere touches neither side of the picture, wide or narrow", () => {
  for (const aspect of [0.4, 1, 2.2]) {
    const away = framingDistance(2, aspect, 32, 1);
    const half = (16 * Math.PI) / 180;
    const narrow = aspect < 1 ? Math.atan(Math.tan(half) * aspect) : half;
    expect(Math.asin(2 / away)).toBeCloseTo(narrow, 10);
  }
});

test("every view looks at the centre with an up vector across its sight", () => {
  for (const name of VIEW_NAMES) {
    const camera = frameSphere([1, 2, 3], 2, 1.5, VIEWS[name].direction, VIEWS[name].up);
    expect(camera.target).toEqual([1, 2, 3]);
    const sight = normalise(subtract(camera.target, camera.position));
    expect(dot(sight, camera.up)).toBeCloseTo(0, 12);
    expect(distance(camera.position, camera.target)).toBeCloseTo(framingDistance(2, 1.5), 9);
  }
});

test("the clip planes hold the object from outside and from within", () => {
  const outside = clipPlanes([0, 0, 10], [0, 0, 0], 1);
  expect(outside.near).toBeLessThan(9);
  expect(outside.far).toBeGreaterThan(11);
  const inside = clipPlanes([0, 0, 0.1], [0, 0, 0], 1);
  expect(inside.near).toBeGreaterThan(0);
  expect(inside.far).toBeGreaterThan(1.1);
});

test("a pixel's span grows with the distance", () => {
  expect(worldPerPixel(2, 1000)).toBeCloseTo(2 * worldPerPixel(1, 1000), 12);
  expect(worldPerPixel(1, 1000, 90)).toBeCloseTo(2 / 1000, 12);
});

test("a camera survives the link", () => {
  const camera = { position: [1.25, -3e-5, 7.125], target: [0, 0.5, 0], up: [0, 1, 0] } as const;
  expect(decodeCamera(encodeCamera(camera))).toEqual(camera);
});

test("what is tiny beside the view is left out of the link", () => {
  expect(encodeCamera({ position: [3.7e-16, 0, 6], target: [0, -1e-17, 0], up: [0, 1, 0] })).toBe(
    "0,0,6;0,0,0;0,1,0",
  );
});

test("what is no camera is none", () => {
  for (const text of [
    "",
    "1,2,3",
    "1,2,3;0,0,0",
    "1,2,x;0,0,0;0,1,0",
    "1,2,;0,0,0;0,1,0",
    "0,0,0;0,0,0;0,1,0",
    "0,1,0;0,0,0;0,1,0",
    "1,2,3;0,0,0;0,1,Infinity",
  ]) {
    expect(decodeCamera(text), text).toBeNull();
  }
});
