import { expect, test } from "vitest";
import { KEPT_PX, keptWithin } from "../../src/ui/image-placer";

const room = { width: 800, height: 600 };

test("an image is moved freely within the picture and cannot be lost beyond its borders", () => {
  const size = { width: 200, height: 100 };
  expect(keptWithin([10, -20], size, room)).toEqual([10, -20]);
  expect(keptWithin([-5000, -5000], size, room)).toEqual([KEPT_PX - 200, KEPT_PX - 100]);
  expect(keptWithin([5000, 5000], size, room)).toEqual([800 - KEPT_PX, 600 - KEPT_PX]);
});

test("an image smaller than what is kept stays whole, and a picture that shrinks brings it along", () => {
  expect(keptWithin([-50, 900], { width: 20, height: 16 }, room)).toEqual([0, 584]);
  const size = { width: 200, height: 100 };
  expect(keptWithin([700, 500], size, { width: 300, height: 200 })).toEqual([268, 168]);
  expect(keptWithin([700, 500], size, { width: 0, height: 0 })).toEqual([0, 0]);
});
