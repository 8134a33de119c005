import { expect, test } from "vitest";
import type { ScreenShape } from "../../src/api/types";
import { DEFAULT_PAINT } from "../../src/edits/paint-settings";
import { commandOperation } from "../../src/edits/regions";
import { floodOperation } from "../../src/tools/flood-tool";
import { screenOperation } from "../../src/tools/outline-tool";

const SHAPE: ScreenShape = {
  type: "screen",
  view: Array.from({ length: 16 }, (_, i) => i),
  outline: { type: "ellipse", center: [0, 0], half_axes: [0.5, 0.5] },
};

test("what joins a region leaves the other one; what leaves or stays does not", () => {
  expect(screenOperation(SHAPE, "add")).toEqual({ mode: "add", shape: SHAPE, steal: true });
  expect(screenOperation(SHAPE, "remove")).toEqual({ mode: "remove", shape: SHAPE });
  expect(screenOperation(SHAPE, "intersect")).toEqual({ mode: "intersect", shape: SHAPE });
});

test("a flood names the bounds that are set alone", () => {
  const free = { ...DEFAULT_PAINT, floodAngle: null, floodRadius: null, floodStops: false };
  expect(floodOperation([1, 2, 3], free)).toEqual({ mode: "flood", seed: [1, 2, 3], steal: true });
  const bound = { ...DEFAULT_PAINT, floodAngle: 15, floodRadius: 0.5, floodStops: true };
  expect(floodOperation([1, 2, 3], bound)).toEqual({
    mode: "flood",
    seed: [1, 2, 3],
    angle_deg: 15,
    radius: 0.5,
    stop_at_other: true,
  });
});

test("commands become operations; clearing drops the list", () => {
  expect(commandOperation("grow", 0.5)).toEqual({ mode: "grow", distance: 0.5, steal: true });
  expect(commandOperation("shrink", 0.5)).toEqual({ mode: "shrink", distance: 0.5 });
  expect(commandOperation("invert", 0)).toEqual({ mode: "invert", steal: true });
  expect(commandOperation("all", 0)).toEqual({ mode: "add", shape: { type: "all" }, steal: true });
  expect(commandOperation("clear", 0)).toBeNull();
});
