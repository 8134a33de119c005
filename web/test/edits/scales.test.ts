import { expect, test } from "vitest";
import { bandName, DEFAULT_SCALES, levelName, parseScales, scalesText } from "../../src/edits/scales";

test("scales are read as people write them, the coarsest first", () => {
  expect(parseScales("4, 2, 1")).toEqual([0.04, 0.02, 0.01]);
  expect(parseScales(" 2 ")).toEqual([0.02]);
  expect(parseScales("20;10 5\t0.01")).toEqual([0.2, 0.1, 0.05, 0.0001]);
  expect(parseScales(scalesText(DEFAULT_SCALES))).toEqual(DEFAULT_SCALES);
});

test("what cannot be scales is told why", () => {
  for (const text of ["", "  ", "9 8 7 6 5 4 3 2 1"]) expect(parseScales(text)).toMatch(/One to 8/);
  for (const text of ["0", "-1", "21", "two", "4, x", "0.009", "1e9", "NaN"])
    expect(parseScales(text)).toMatch(/between/);
  for (const text of ["1, 2", "2, 2", "2, 1.95"]) expect(parseScales(text)).toMatch(/Coarsest first/);
});

test("levels are named by what their base smooths away", () => {
  expect(levelName({ level: 0, scale: 0.08 }, 2)).toBe("Level 0 (4 %)");
  expect(levelName({ level: 3, scale: 0 }, 2)).toBe("Level 3");
});

test("bands of detail are named by the scales that they lie between", () => {
  const levels = [{ scale: 0.08 }, { scale: 0.04 }, { scale: 0 }];
  expect(bandName(levels, 0, 2)).toBe("4 % to 2 %");
  expect(bandName(levels, 1, 2)).toBe("Below 2 %");
  expect(bandName([{ scale: 0 }, { scale: 0 }], 0, 2)).toBe("Band 0");
});
