import { expect, test } from "vitest";
import { channelValue, paintMask } from "../../src/edits/image-mask";

// Black, white, red, a grey of one half, and white that is nearly clear.
const PIXELS = Uint8ClampedArray.from(
  [
    [0, 0, 0, 255],
    [255, 255, 255, 255],
    [255, 0, 0, 255],
    [128, 128, 128, 255],
    [255, 255, 255, 20],
  ].flat(),
);

function maskOf(settings: Parameters<typeof paintMask>[1]): { white: number[]; part: number } {
  const into = new Uint8ClampedArray(PIXELS.length);
  const part = paintMask(PIXELS, settings, into);
  const white = [0, 1, 2, 3, 4].filter((i) => into[4 * i] === 255);
  expect([0, 1, 2, 3, 4].every((i) => into[4 * i + 3] === 255)).toBe(true);
  return { white, part };
}

test("white is 1, black 0, and colours weigh as the eye sees them", () => {
  expect(channelValue(PIXELS, 0, "luminance")).toBe(0);
  expect(channelValue(PIXELS, 4, "luminance")).toBe(1);
  expect(channelValue(PIXELS, 8, "luminance")).toBeCloseTo(0.2126, 12);
  expect(channelValue(PIXELS, 8, "red")).toBe(1);
  expect(channelValue(PIXELS, 8, "blue")).toBe(0);
  expect(channelValue(PIXELS, 16, "alpha")).toBeCloseTo(20 / 255, 12);
});

test("both sides share the opaque pixels, and the clear ones are in neither", () => {
  const settings = { channel: "luminance", threshold: 0.5 } as const;
  expect(maskOf({ ...settings, side: "above" })).toEqual({ white: [1, 3], part: 0.4 });
  expect(maskOf({ ...settings, side: "below" })).toEqual({ white: [0, 2], part: 0.4 });
  // A value on the threshold is above it.
  expect(maskOf({ channel: "luminance", threshold: 0, side: "above" }).white).toEqual([0, 1, 2, 3]);
  expect(maskOf({ channel: "green", threshold: 1, side: "above" }).white).toEqual([1]);
});

test("where opacity is the channel, clear pixels count", () => {
  expect(maskOf({ channel: "alpha", threshold: 0.5, side: "below" }).white).toEqual([4]);
});

test("no pixels make no mask", () => {
  expect(
    paintMask(
      new Uint8ClampedArray(0),
      { channel: "red", threshold: 0.5, side: "above" },
      new Uint8ClampedArray(0),
    ),
  ).toBe(0);
});
