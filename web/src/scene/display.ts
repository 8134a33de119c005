import type { ColormapName } from "./colormaps";

export type DisplayMode = "shaded" | "color" | "normals" | "t" | "detail" | "stretch";

/** What the person chose to see. */
export interface DisplaySettings {
  mode: DisplayMode;
  /** Tint the regions blue and red in the modes that show the surface itself. */
  tintRegions: boolean;
  colorBlindSafe: boolean;
  /** Splat radius in multiples of what closes the surface. */
  splatSize: number;
  depthCues: boolean;
  /** The level on show: 0 the smooth base, null the whole surface. */
  level: number | null;
}

export const DEFAULT_DISPLAY: DisplaySettings = {
  mode: "shaded",
  tintRegions: true,
  colorBlindSafe: false,
  splatSize: 1,
  depthCues: true,
  level: null,
};

/** The number that the shader knows a mode by. */
export const MODE_NUMBERS: Record<DisplayMode, number> = {
  shaded: 0,
  color: 1,
  normals: 2,
  t: 3,
  detail: 4,
  stretch: 5,
};

export function colormapOf(settings: DisplaySettings): ColormapName | null {
  if (settings.mode === "t") return settings.colorBlindSafe ? "viridis" : "rainbow";
  if (settings.mode === "detail") return settings.colorBlindSafe ? "purple-green" : "coolwarm";
  if (settings.mode === "stretch") return settings.colorBlindSafe ? "viridis" : "heat";
  return null;
}

/** The settings that a `mode` of the URL asks for; null where there is no such mode. */
export function displayOfUrlMode(mode: string, base: DisplaySettings): DisplaySettings | null {
  if (mode === "regions") return { ...base, mode: "shaded", tintRegions: true };
  if (mode === "shaded") return { ...base, mode: "shaded", tintRegions: false };
  return Object.hasOwn(MODE_NUMBERS, mode) ? { ...base, mode: mode as DisplayMode } : null;
}

export function urlModeOf(settings: DisplaySettings): string {
  return settings.mode === "shaded" && settings.tintRegions ? "regions" : settings.mode;
}
