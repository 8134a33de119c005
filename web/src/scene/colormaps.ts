/** Colour maps as control points in sRGB (0..255), evenly spaced over 0..1. */
export type ColormapName = "rainbow" | "viridis" | "heat" | "coolwarm" | "purple-green";

type Rgb = readonly [number, number, number];

const CONTROL_POINTS: Record<ColormapName, readonly Rgb[]> = {
  // The rainbow of the scale parameter, blue at the zero-region to red at the one-region.
  rainbow: [
    [48, 72, 214],
    [38, 142, 236],
    [36, 200, 205],
    [66, 214, 118],
    [172, 220, 62],
    [245, 205, 54],
    [247, 138, 44],
    [214, 52, 44],
  ],
  // Evenly rising lightness, readable with any colour vision.
  viridis: [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
  ],
  // Stretch: pale where the surface is as it was, dark red where it is drawn out.
  heat: [
    [242, 238, 228],
    [251, 213, 150],
    [247, 160, 80],
    [217, 86, 50],
    [140, 20, 40],
  ],
  // Signed detail: blue below the base, white on it, red above.
  coolwarm: [
    [36, 72, 196],
    [98, 138, 236],
    [172, 196, 246],
    [244, 244, 242],
    [246, 184, 164],
    [226, 108, 88],
    [178, 24, 36],
  ],
  // Signed detail without red against green: orange below, white on it, purple above.
  "purple-green": [
    [179, 88, 6],
    [224, 130, 20],
    [253, 200, 126],
    [246, 246, 245],
    [190, 184, 220],
    [128, 115, 172],
    [84, 39, 136],
  ],
};

/** The map at `at` (clamped to 0..1), linear between its control points; 0..255 per channel. */
export function sampleColormap(name: ColormapName, at: number): [number, number, number] {
  const points = CONTROL_POINTS[name];
  const place = Math.min(1, Math.max(0, Number.isFinite(at) ? at : 0)) * (points.length - 1);
  const index = Math.min(points.length - 2, Math.floor(place));
  const fraction = place - index;
  const low = points[index] ?? [0, 0, 0];
  const high = points[index + 1] ?? low;
  return [
    Math.round(low[0] + (high[0] - low[0]) * fraction),
    Math.round(low[1] + (high[1] - low[1]) * fraction),
    Math.round(low[2] + (high[2] - low[2]) * fraction),
  ];
}

/** The map as `size` RGBA texels. */
export function colormapTexels(name: ColormapName, size = 256): Uint8Array {
  const texels = new Uint8Array(size * 4);
  for (let i = 0; i < size; ++i) {
    texels.set(sampleColormap(name, i / (size - 1)), 4 * i);
    texels[4 * i + 3] = 255;
  }
  return texels;
}

/** Tick labels of a scalar bar: three significant digits, an exponent only where it helps. */
export function formatScalar(value: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-3 && size < 1e5) return String(Number(value.toPrecision(3)));
  return value.toExponential(2).replace("e+", "e");
}
