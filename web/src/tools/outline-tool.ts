import type { Outline, RegionOperation, ScreenShape, Vec2 } from "../api/types";
import { modeOf, type PaintMode, type PaintSettingsStore, type PaintTarget } from "../edits/paint-settings";
import type { RegionEditor } from "../edits/regions";
import { belongsToField } from "../keys";
import { distance } from "../math/vec3";
import { worldPerPixel } from "../scene/camera-math";
import type { CurveTone } from "../scene/outline-layer";
import type { Viewport } from "../scene/viewport";
import type { Bus, SessionStore } from "../session-store";
import type { BrushSize } from "./brush-tool";
import { ellipseOutline, ellipseWithin, lineOutline, polygonOutline, rectangleCorners } from "./outline";
import type { PaintGesture } from "./paint-tool";
import { hearPresses } from "./presses";

export type OutlineMethod = "lasso" | "polygon" | "rectangle" | "ellipse" | "line";

/** A click so near to the first corner closes a polygon. */
const CLOSE_PX = 9;
const LASSO_STEP_PX = 2;

interface Drawing {
  /** Of the pointer that is held; null for a polygon, which is clicked. */
  pointer: number | null;
  points: Vec2[];
  /** Where the pointer is. */
  at: Vec2;
  width: number;
  mode: PaintMode;
}

/** The operation that an outline makes. */
export function screenOperation(shape: ScreenShape, mode: PaintMode): RegionOperation {
  return mode === "add" ? { mode, shape, steal: true } : { mode, shape };
}

/** Draws a curve over the picture and chooses what lies in it. Escape, a lost pointer and leaving the tool drop it. */
export class OutlineTool implements PaintGesture {
  private target_: PaintTarget = "zero";
  private readonly method_: OutlineMethod;
  private readonly bus_: Bus;
  private readonly viewport_: Viewport;
  private readonly store_: SessionStore;
  private readonly regions_: RegionEditor;
  private readonly settings_: PaintSettingsStore;
  private readonly size_: BrushSize;
  private listeners_: AbortController | null = null;
  private drawing_: Drawing | null = null;
  private sent_ = 0;

  constructor(
    method: OutlineMethod,
    bus: Bus,
    viewport: Viewport,
    store: SessionStore,
    regions: RegionEditor,
    size: BrushSize,
    settings: PaintSettingsStore,
  ) {
    this.method_ = method;
    this.bus_ = bus;
    this.viewport_ = viewport;
    this.store_ = store;
    this.regions_ = regions;
    this.size_ = size;
    this.settings_ = settings;
  }

  activate(target: PaintTarget): void {
    this.target_ = target;
    const { canvas } = this.viewport_;
    this.listeners_ = hearPresses(canvas, this.down);
    const { signal } = this.listeners_;
    canvas.addEventListener("pointermove", this.move, { signal });
    canvas.addEventListener("pointerup", this.up, { signal });
    canvas.addEventListener("pointercancel", () => this.cancel(), { signal });
    canvas.addEventListener("dblclick", this.finish, { signal });
    window.addEventListener("keydown", this.key, { signal, capture: true });
    window.addEventListener("keyup", this.key, { signal, capture: true });
  }

  deactivate(): void {
    this.cancel();
    this.listeners_?.abort();
    this.listeners_ = null;
  }

  cancel(): boolean {
    if (!this.drawing_) return false;
    this.drawing_ = null;
    this.viewport_.outline.clear();
    this.viewport_.rig.setEnabled(true);
    return true;
  }

  private readonly down = (event: PointerEvent): void => {
    const { canvas } = this.viewport_;
    if (event.button !== 0 || event.target !== canvas) return;
    event.preventDefault();
    event.stopPropagation();
    canvas.focus({ preventScroll: true });
    const at = this.viewport_.pixelOf(event);
    const mode = modeOf(this.settings_.value, this.target_, event);
    if (this.method_ === "polygon") {
      this.addCorner(at, mode);
      return;
    }
    if (this.drawing_) return;
    canvas.setPointerCapture(event.pointerId);
    this.viewport_.rig.setEnabled(false);
    this.drawing_ = { pointer: event.pointerId, points: [at], at, width: this.lineWidth(event), mode };
    this.draw();
  };

  private addCorner(at: Vec2, mode: PaintMode): void {
    const drawing = this.drawing_;
    if (!drawing) {
      this.drawing_ = { pointer: null, points: [at], at, width: 0, mode };
    } else {
      const [first] = drawing.points;
      if (first && drawing.points.length >= 3 && Math.hypot(at[0] - first[0], at[1] - first[1]) < CLOSE_PX) {
        this.finish();
        return;
      }
      const last = drawing.points.at(-1);
      // The second press of a double click adds nothing.
      if (!last || Math.hypot(at[0] - last[0], at[1] - last[1]) >= 2) drawing.points.push(at);
      drawing.at = at;
    }
    this.draw();
  }

  private readonly move = (event: PointerEvent): void => {
    const drawing = this.drawing_;
    if (!drawing || (drawing.pointer !== null && event.pointerId !== drawing.pointer)) return;
    drawing.at = this.viewport_.pixelOf(event);
    drawing.mode = modeOf(this.settings_.value, this.target_, event);
    if (this.method_ === "lasso") {
      const events = event.getCoalescedEvents?.() ?? [];
      for (const part of events.length > 0 ? events : [event]) {
        const at = this.viewport_.pixelOf(part);
        const last = drawing.points.at(-1);
        if (!last || Math.hypot(at[0] - last[0], at[1] - last[1]) >= LASSO_STEP_PX) drawing.points.push(at);
      }
    }
    this.draw();
  };

  private readonly up = (event: PointerEvent): void => {
    const drawing = this.drawing_;
    if (!drawing || drawing.pointer === null || event.pointerId !== drawing.pointer) return;
    drawing.at = this.viewport_.pixelOf(event);
    drawing.mode = modeOf(this.settings_.value, this.target_, event);
    this.finish();
  };

  private readonly key = (event: KeyboardEvent): void => {
    const drawing = this.drawing_;
    if (!drawing || belongsToField(event)) return;
    if (event.type === "keydown" && ["Escape", "Enter", "Backspace"].includes(event.key)) {
      event.preventDefault();
      event.stopPropagation();
      if (event.key === "Escape") this.cancel();
      else if (drawing.pointer !== null) return;
      else if (event.key === "Enter") this.finish();
      else {
        drawing.points.pop();
        if (drawing.points.length === 0) this.cancel();
        else this.draw();
      }
      return;
    }
    // Alone, this key would open a browser's menu.
    if (event.key === "Alt") event.preventDefault();
    drawing.mode = modeOf(this.settings_.value, this.target_, event);
    this.draw();
  };

  /** Pixels that the brush's diameter spans where the pointer is, or, beside the surface, at the focus. */
  private lineWidth(event: PointerEvent): number {
    const hit = this.viewport_.pick(event.clientX, event.clientY);
    const { position, target } = this.viewport_.rig.state;
    const depth = hit?.depth ?? distance(position, target);
    return (2 * this.size_.radius) / worldPerPixel(depth, this.viewport_.size.height);
  }

  private draw(): void {
    const drawing = this.drawing_;
    if (!drawing) return;
    const { points, at, width, mode } = drawing;
    const tone: CurveTone = mode !== "add" ? mode : this.target_ === "erase" ? "remove" : this.target_;
    const start = points[0] ?? at;
    const { outline } = this.viewport_;
    switch (this.method_) {
      case "lasso":
        outline.draw({ kind: "path", points, closed: true }, tone);
        break;
      case "polygon":
        outline.draw({ kind: "path", points: [...points, at], closed: true, corners: true }, tone);
        break;
      case "rectangle":
        outline.draw({ kind: "path", points: rectangleCorners(start, at), closed: true }, tone);
        break;
      case "ellipse":
        outline.draw({ kind: "ellipse", ...ellipseWithin(start, at) }, tone);
        break;
      case "line":
        outline.draw({ kind: "band", points: [start, at], width }, tone);
        break;
    }
  }

  private outlineOf({ points, at, width }: Drawing): Outline | null {
    const { size } = this.viewport_;
    const start = points[0] ?? at;
    switch (this.method_) {
      case "lasso":
      case "polygon":
        return polygonOutline(points, size);
      case "rectangle":
        return polygonOutline(rectangleCorners(start, at), size);
      case "ellipse":
        return ellipseOutline(start, at, size);
      case "line":
        return lineOutline([start, at], width, size);
    }
  }

  private readonly finish = (): void => {
    const drawing = this.drawing_;
    if (!drawing) return;
    const outline = this.outlineOf(drawing);
    if (!outline) {
      this.cancel();
      return;
    }
    this.drawing_ = null;
    this.viewport_.rig.setEnabled(true);
    this.viewport_.outline.rest();
    const view = this.viewport_.squareView(this.store_.document.origin);
    const shape: ScreenShape = { type: "screen", view, outline };
    if (this.settings_.value.visibleOnly) shape.visible = true;
    this.sent_ += 1;
    const own = this.sent_;
    void this.regions_.paint(this.target_, [screenOperation(shape, drawing.mode)]).then((document) => {
      if (document?.changed === 0)
        this.bus_.fire("toast", { kind: "info", title: "Nothing in this outline has changed" });
      // A newer outline may be on the screen already.
      if (own !== this.sent_ || this.drawing_) return;
      if (document) this.viewport_.outline.clearAtRevision(document.revision);
      else this.viewport_.outline.clear();
    });
  };
}
