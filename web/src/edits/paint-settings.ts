import type { RegionName } from "../api/types";
import type { Bus } from "../session-store";

/** How the pointer chooses samples. */
export const PAINT_METHODS = ["brush", "lasso", "polygon", "rectangle", "ellipse", "line", "flood"] as const;
export type PaintMethod = (typeof PAINT_METHODS)[number];
/** What becomes of the chosen samples. */
export type PaintMode = "add" | "remove" | "intersect";
/** What is painted: a region, or, with the eraser, both. */
export type PaintTarget = RegionName | "erase";

/** How painting is done, whichever region is painted. */
export interface PaintSettings {
  readonly method: PaintMethod;
  readonly mode: PaintMode;
  /** Outlines choose what is in front rather than all depths. */
  readonly visibleOnly: boolean;
  /** A flood does not cross a greater angle between neighbouring normals; null: any. */
  readonly floodAngle: number | null;
  /** A flood stays within this distance of its seed; null: any. */
  readonly floodRadius: number | null;
  readonly floodStops: boolean;
}

export const DEFAULT_PAINT: PaintSettings = {
  method: "brush",
  mode: "add",
  visibleOnly: false,
  floodAngle: 20,
  floodRadius: null,
  floodStops: true,
};

/** Methods that draw a curve over the picture. */
export function drawsOutline(method: PaintMethod): boolean {
  return method !== "brush" && method !== "flood";
}

/** Whether samples can be kept by what the method chooses: strokes and floods choose in parts. */
export function mayIntersect(method: PaintMethod, target: PaintTarget): boolean {
  return drawsOutline(method) && target !== "erase";
}

/** The mode of one gesture: held keys go before the buttons, and the eraser erases. */
export function modeOf(
  { method, mode }: PaintSettings,
  target: PaintTarget,
  keys: { shiftKey: boolean; altKey: boolean },
): PaintMode {
  if (target === "erase" || keys.shiftKey) return "remove";
  const wanted = keys.altKey && mayIntersect(method, target) ? "intersect" : mode;
  return wanted === "intersect" && !mayIntersect(method, target) ? "add" : wanted;
}

/** Keeps the settings; every change is told as `paint.changed`. */
export class PaintSettingsStore {
  private settings_: PaintSettings = DEFAULT_PAINT;

  constructor(bus: Bus) {
    bus.function("paint.settings", () => this.settings_);
    bus.function("paint.set", (change) => {
      this.settings_ = { ...this.settings_, ...change };
      bus.fire("paint.changed", this.settings_);
    });
  }

  get value(): PaintSettings {
    return this.settings_;
  }
}
