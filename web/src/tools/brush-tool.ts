import type { SessionDocument } from "../api/types";
import { modeOf, type PaintMode, type PaintSettingsStore, type PaintTarget } from "../edits/paint-settings";
import type { RegionEditor } from "../edits/regions";
import { add, normalise, type Vec3 } from "../math/vec3";
import type { Hit } from "../scene/picker";
import { ONE_COLOR, ZERO_COLOR } from "../scene/region-colors";
import type { Viewport } from "../scene/viewport";
import type { SessionStore } from "../session-store";
import type { PaintGesture } from "./paint-tool";
import { hearPresses } from "./presses";
import { isDepthJump, isNewVertex, strokeOperation } from "./stroke";

type Color = readonly [number, number, number];
const ERASER_COLOR: Color = [0.86, 0.87, 0.9];
const COLORS: Record<PaintTarget, Color> = { zero: ZERO_COLOR, one: ONE_COLOR, erase: ERASER_COLOR };
const BARE_COLOR: Color = [0.66, 0.64, 0.6];

/** The brush's radius, in model units; lines are as wide. */
export interface BrushSize {
  radius: number;
}

interface Stroke {
  pointer: number;
  mode: PaintMode;
  parts: Vec3[][];
  last: Hit;
  towardsCamera: Vec3;
}

/** Paints on the surface: the stroke shows at once, and becomes operations of the region when the hand lifts. */
export class BrushTool implements PaintGesture {
  private target_: PaintTarget = "zero";
  private readonly viewport_: Viewport;
  private readonly store_: SessionStore;
  private readonly regions_: RegionEditor;
  private readonly size_: BrushSize;
  private readonly settings_: PaintSettingsStore;
  private listeners_: AbortController | null = null;
  private stroke_: Stroke | null = null;
  private pointer_: { x: number; y: number; mode: PaintMode } | null = null;
  private frame_ = 0;
  private strokes_ = 0;

  constructor(
    viewport: Viewport,
    store: SessionStore,
    regions: RegionEditor,
    size: BrushSize,
    settings: PaintSettingsStore,
  ) {
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
    canvas.addEventListener("pointercancel", this.abandon, { signal });
    canvas.addEventListener("pointerleave", this.leave, { signal });
  }

  deactivate(): void {
    this.finish();
    this.listeners_?.abort();
    cancelAnimationFrame(this.frame_);
    this.frame_ = 0;
    this.viewport_.setRing(null);
  }

  cancel(): boolean {
    const begun = this.stroke_ !== null;
    this.abandon();
    return begun;
  }

  /** Draws the ring again, for a radius that has changed under a resting hand. */
  refresh(): void {
    if (this.listeners_ && !this.listeners_.signal.aborted && this.pointer_) this.scheduleRing();
  }

  private readonly down = (event: PointerEvent): void => {
    if (event.button !== 0 || event.target !== this.viewport_.canvas || this.stroke_) return;
    const hit = this.viewport_.pick(event.clientX, event.clientY);
    if (!hit) return;
    event.preventDefault();
    event.stopPropagation();
    this.viewport_.canvas.focus({ preventScroll: true });
    this.viewport_.canvas.setPointerCapture(event.pointerId);
    const mode = modeOf(this.settings_.value, this.target_, event);
    this.stroke_ = {
      pointer: event.pointerId,
      mode,
      parts: [[hit.position]],
      last: hit,
      towardsCamera: hit.towardsCamera,
    };
    this.viewport_.rig.setEnabled(false);
    this.viewport_.mask.begin(mode === "remove" ? BARE_COLOR : COLORS[this.target_]);
    this.viewport_.mask.add(hit.position, hit.position, this.size_.radius);
    this.showRing(hit, mode);
  };

  private readonly move = (event: PointerEvent): void => {
    this.pointer_ = {
      x: event.clientX,
      y: event.clientY,
      mode: modeOf(this.settings_.value, this.target_, event),
    };
    const stroke = this.stroke_;
    if (!stroke) {
      if (event.buttons === 0) this.scheduleRing();
      else this.viewport_.setRing(null);
      return;
    }
    if (event.pointerId !== stroke.pointer) return;
    const events = event.getCoalescedEvents?.() ?? [];
    for (const part of events.length > 0 ? events.slice(-4) : [event]) this.extend(stroke, part);
  };

  private extend(stroke: Stroke, event: PointerEvent): void {
    const hit = this.viewport_.pick(event.clientX, event.clientY);
    if (!hit) return;
    this.showRing(hit, stroke.mode);
    const { radius } = this.size_;
    const part = stroke.parts[stroke.parts.length - 1];
    if (!part || !isNewVertex(part[part.length - 1], hit.position, radius)) return;
    if (isDepthJump(stroke.last.position, hit.position, stroke.last.depth, hit.depth, radius)) {
      stroke.parts.push([hit.position]);
      this.viewport_.mask.add(hit.position, hit.position, radius);
    } else {
      part.push(hit.position);
      this.viewport_.mask.add(stroke.last.position, hit.position, radius);
    }
    stroke.last = hit;
    stroke.towardsCamera = add(stroke.towardsCamera, hit.towardsCamera);
  }

  private readonly up = (event: PointerEvent): void => {
    if (this.stroke_ && event.pointerId === this.stroke_.pointer) this.finish();
  };

  private readonly abandon = (): void => {
    if (!this.stroke_) return;
    this.stroke_ = null;
    this.viewport_.rig.setEnabled(true);
    this.viewport_.mask.clear();
  };

  private readonly leave = (): void => {
    this.pointer_ = null;
    if (!this.stroke_) this.viewport_.setRing(null);
  };

  private finish(): void {
    const stroke = this.stroke_;
    if (!stroke) return;
    this.stroke_ = null;
    this.viewport_.rig.setEnabled(true);
    this.strokes_ += 1;
    const own = this.strokes_;
    void this.send(stroke).then((document) => {
      // The tint stays until the frame with the server's marks is there; a refused stroke has none to wait for.
      if (own !== this.strokes_ || this.stroke_) return;
      if (document) this.viewport_.mask.clearAtRevision(document.revision);
      else this.viewport_.mask.clear();
    });
  }

  private send(stroke: Stroke): Promise<SessionDocument | null> {
    const facing = normalise(stroke.towardsCamera);
    const operations = stroke.parts.map((part) =>
      strokeOperation(
        part.map((p) => this.store_.toModel(p)),
        this.size_.radius,
        facing,
        stroke.mode === "remove",
      ),
    );
    return this.regions_.paint(this.target_, operations);
  }

  private scheduleRing(): void {
    if (this.frame_ !== 0) return;
    this.frame_ = requestAnimationFrame(() => {
      this.frame_ = 0;
      const pointer = this.pointer_;
      if (!pointer || this.stroke_) return;
      const hit = this.viewport_.pick(pointer.x, pointer.y);
      if (hit) this.showRing(hit, pointer.mode);
      else this.viewport_.setRing(null);
    });
  }

  private showRing(hit: Hit, mode: PaintMode): void {
    const color = COLORS[mode === "remove" ? "erase" : this.target_];
    this.viewport_.setRing({ position: hit.position, radius: this.size_.radius, color });
  }
}
