import { expect, test } from "vitest";
import { colormapTexels, formatScalar, sampleColormap } from "../../src/scene/colormaps";
import { colormapOf, DEFAULT_DISPLAY, displayOfUrlMode, urlModeOf } from "../../src/scene/display";
import { layerPrefixes, layerSizes, prefixWithin } from "../../src/scene/layers";
import { jitterOf, Pacer } from "../../src/scene/pacer";
import { regionCentres } from "../../src/scene/region-centres";

test("the layers hold every sample once", () => {
  for (const count of [0, 1, 31, 32, 33, 63, 64, 65, 4096, 437_645]) {
    expect(layerSizes(count).reduce((sum, size) => sum + size, 0)).toBe(count);
  }
});

test("a layer's size is the number of its indices", () => {
  const count = 1000;
  const of = (layer: number): number => {
    let members = 0;
    for (let i = 0; i < count; ++i) {
      const trailing = i === 0 ? 6 : Math.min(6, Math.log2(i & -i));
      if (6 - trailing === layer) ++members;
    }
    return members;
  };
  expect(layerSizes(count)).toEqual([0, 1, 2, 3, 4, 5, 6].map(of));
});

test("the last prefix is the whole cloud, with what was appended", () => {
  const prefixes = layerPrefixes(100_000, 4096, 40);
  expect(prefixes.at(-1)).toEqual({ blocks: 40, samples: 100_000 });
  for (let i = 1; i < prefixes.length; ++i)
    expect(prefixes[i]?.blocks).toBeGreaterThanOrEqual(prefixes[i - 1]?.blocks ?? 0);
});

test("a budget takes the largest prefix that it holds, and never none", () => {
  const prefixes = layerPrefixes(64_000, 4096, 20);
  expect(prefixWithin(prefixes, Number.POSITIVE_INFINITY).samples).toBe(64_000);
  expect(prefixWithin(prefixes, 32_000).samples).toBe(32_000);
  expect(prefixWithin(prefixes, 31_999).samples).toBe(16_000);
  expect(prefixWithin(prefixes, 1).samples).toBe(1000);
});

test("the stretch is a mode of links with a map of its own, and made-up modes are none", () => {
  const settings = displayOfUrlMode("stretch", DEFAULT_DISPLAY);
  expect(settings?.mode).toBe("stretch");
  expect(settings && urlModeOf(settings)).toBe("stretch");
  expect(settings && colormapOf(settings)).toBe("heat");
  expect(settings && colormapOf({ ...settings, colorBlindSafe: true })).toBe("viridis");
  expect(displayOfUrlMode("toString", DEFAULT_DISPLAY)).toBeNull();
});

test("colour maps end where they should and stay within bytes", () => {
  expect(sampleColormap("coolwarm", 0)).toEqual([36, 72, 196]);
  expect(sampleColormap("coolwarm", 1)).toEqual([178, 24, 36]);
  expect(sampleColormap("coolwarm", 0.5)).toEqual([244, 244, 242]);
  expect(sampleColormap("viridis", -3)).toEqual(sampleColormap("viridis", 0));
  expect(sampleColormap("viridis", Number.NaN)).toEqual(sampleColormap("viridis", 0));
  const texels = colormapTexels("rainbow", 16);
  expect(texels.length).toBe(64);
  expect([...texels.subarray(60, 63)]).toEqual(sampleColormap("rainbow", 1));
});

test("the colour-blind-safe map of t grows lighter all the way", () => {
  let last = -1;
  for (let i = 0; i <= 20; ++i) {
    const [r, g, b] = sampleColormap("viridis", i / 20);
    const lightness = 0.2126 * (r / 255) ** 2.2 + 0.7152 * (g / 255) ** 2.2 + 0.0722 * (b / 255) ** 2.2;
    expect(lightness).toBeGreaterThan(last);
    last = lightness;
  }
});

test("numbers of a colour bar are short", () => {
  expect(formatScalar(0)).toBe("0");
  expect(formatScalar(0.123456)).toBe("0.123");
  expect(formatScalar(-1234.56)).toBe("-1230");
  expect(formatScalar(0.0000123)).toBe("1.23e-5");
  expect(formatScalar(1.5e7)).toBe("1.50e7");
});

test("display modes survive the link", () => {
  for (const mode of ["shaded", "regions", "color", "normals", "t", "detail"]) {
    const display = displayOfUrlMode(mode, DEFAULT_DISPLAY);
    expect(display && urlModeOf(display)).toBe(mode);
  }
  expect(displayOfUrlMode("nonsense", DEFAULT_DISPLAY)).toBeNull();
  expect(colormapOf({ ...DEFAULT_DISPLAY, mode: "t" })).toBe("rainbow");
  expect(colormapOf({ ...DEFAULT_DISPLAY, mode: "t", colorBlindSafe: true })).toBe("viridis");
  expect(colormapOf(DEFAULT_DISPLAY)).toBeNull();
});

test("the pacer draws a change at once, refines at rest, then stops", () => {
  const pacer = new Pacer();
  const first = pacer.next(1000, 50_000);
  expect(first).toMatchObject({ kind: "picture", index: 0, jitter: [0, 0] });
  expect(pacer.next(1016, 50_000).kind).toBe("none");
  expect(pacer.wait(1016)).toBeGreaterThan(0);
  let now = 1200;
  const indices: number[] = [];
  for (let i = 0; i < 100 && pacer.wait(now) !== null; ++i, now += 16) {
    const step = pacer.next(now, 50_000);
    if (step.kind === "picture") indices.push(step.index);
  }
  expect(indices).toEqual(Array.from({ length: indices.length }, (_, i) => i + 1));
  expect(indices.length).toBeGreaterThanOrEqual(4);
  expect(pacer.settled).toBe(true);
  pacer.change();
  expect(pacer.settled).toBe(false);
  expect(pacer.wait(now)).toBe(0);
});

test("a slow machine draws fewer samples while things move and all of them at rest", () => {
  const pacer = new Pacer();
  pacer.next(0, 1_000_000);
  pacer.finished(400, 1_000_000, 1_000_000);
  expect(pacer.budget).toBeLessThan(500_000);
  pacer.change();
  const moving = pacer.next(500, 1_000_000);
  expect(moving.budget).toBe(pacer.budget);
  const rest = pacer.next(700, 1_000_000);
  expect(rest).toMatchObject({ kind: "picture", index: 0, budget: Number.POSITIVE_INFINITY });
  for (let i = 0; i < 30; ++i) pacer.finished(10, 500_000, 1_000_000);
  expect(pacer.budget).toBe(Number.POSITIVE_INFINITY);
});

test("the jitter stays within its pixel and is centred", () => {
  const offsets = Array.from({ length: 15 }, (_, i) => jitterOf(i + 1));
  for (const [x, y] of offsets) {
    expect(Math.abs(x)).toBeLessThanOrEqual(0.5);
    expect(Math.abs(y)).toBeLessThanOrEqual(0.5);
  }
  expect(Math.abs(offsets.reduce((sum, [x]) => sum + x, 0) / 15)).toBeLessThan(0.05);
});

test("region centres are the means of their samples, and the boundary's is where t is one half", () => {
  const table = new Float32Array(8);
  table.set([-1, 0, 0, 4, 2, 0, 0, 0]);
  // Samples at x = -1 (zero), 1 (one), 0 (t = 1/2), 1 (t = 0 and unmarked).
  const positions = Uint16Array.from([0, 0, 0, 0, 65535, 0, 0, 65535, 32768, 0, 0, 32768, 65535, 0, 0, 0]);
  const marks = Uint8Array.from([1, 2, 0, 0]);
  const centres = regionCentres({ positions, marks, table, blockSize: 4, blockCount: 1 });
  expect(centres.zero?.[0]).toBeCloseTo(-1);
  expect(centres.one?.[0]).toBeCloseTo(1);
  expect(centres.boundary?.[0]).toBeCloseTo(0, 3);
  expect(
    regionCentres({ positions, marks: null, table: new Float32Array(8), blockSize: 4, blockCount: 1 }),
  ).toEqual({ zero: null, one: null, boundary: null });
});
