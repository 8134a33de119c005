import type { FloodOperation } from "../api/types";
import type { PaintSettings, PaintSettingsStore, PaintTarget } from "../edits/paint-settings";
import type { RegionEditor } from "../edits/regions";
import type { Vec3 } from "../math/vec3";
import { ONE_COLOR, ZERO_COLOR } from "../scene/region-colors";
import type { Viewport } from "../scene/viewport";
import type { Bus, SessionStore } from "../session-store";
import type { PaintGesture } from "./paint-tool";
import { hearPresses } from "./presses";

/** The flood that the settings ask for, from a seed in model space. */
export function floodOperation(seed: Vec3, settings: PaintSettings): FloodOperation {
  const operation: FloodOperation = { mode: "flood", seed };
  if (settings.floodAngle !== null) operation.angle_deg = settings.floodAngle;
  if (settings.floodRadius !== null) operation.radius = settings.floodRadius;
  if (settings.floodStops) operation.stop_at_other = true;
  else operation.steal = true;
  return operation;
}

/** Fills from the sample that is clicked. Floods only add: the wire knows no other. */
export class FloodTool implements PaintGesture {
  private target_: PaintTarget = "zero";
  private readonly bus_: Bus;
  private readonly viewport_: Viewport;
  private readonly store_: SessionStore;
  private readonly regions_: RegionEditor;
  private readonly settings_: PaintSettingsStore;
  private listeners_: AbortController | null = null;
  private frame_ = 0;

  constructor(
    bus: Bus,
    viewport: Viewport,
    store: SessionStore,
    regions: RegionEditor,
    settings: PaintSettingsStore,
  ) {
    this.bus_ = bus;
    this.viewport_ = viewport;
    this.store_ = store;
    this.regions_ = regions;
    this.settings_ = settings;
  }

  activate(target: PaintTarget): void {
    this.target_ = target;
    const { canvas } = this.viewport_;
    this.listeners_ = hearPresses(canvas, this.down);
    const { signal } = this.listeners_;
    canvas.addEventListener("pointermove", this.move, { signal });
    canvas.addEventListener("pointerleave", () => this.viewport_.setRing(null), { signal });
  }

  deactivate(): void {
    this.listeners_?.abort();
    this.listeners_ = null;
    cancelAnimationFrame(this.frame_);
    this.frame_ = 0;
    this.viewport_.setRing(null);
  }

  cancel(): boolean {
    return false;
  }

  private readonly down = (event: PointerEvent): void => {
    const { canvas } = this.viewport_;
    if (event.button !== 0 || event.target !== canvas) return;
    const hit = this.viewport_.pick(event.clientX, event.clientY);
    if (!hit) return;
    event.preventDefault();
    event.stopPropagation();
    canvas.focus({ preventScroll: true });
    if (this.target_ === "erase") {
      this.bus_.fire("toast", {
        kind: "info",
        title: "A flood fills, it does not erase",
        lines: ["Choose the zero-region or the one-region."],
      });
      return;
    }
    const operation = floodOperation(this.store_.toModel(hit.position), this.settings_.value);
    void this.regions_.paint(this.target_, [operation]).then((document) => {
      if (document?.changed === 0)
        this.bus_.fire("toast", { kind: "info", title: "The flood reached nothing" });
    });
  };

  /** Where a radius bounds the flood, shows it. */
  private readonly move = (event: PointerEvent): void => {
    if (this.frame_ !== 0 || event.buttons !== 0) return;
    this.frame_ = requestAnimationFrame(() => {
      this.frame_ = 0;
      const radius = this.settings_.value.floodRadius;
      const hit = radius === null ? null : this.viewport_.pick(event.clientX, event.clientY);
      const color = this.target_ === "zero" ? ZERO_COLOR : ONE_COLOR;
      this.viewport_.setRing(hit && radius !== null ? { position: hit.position, radius, color } : null);
    });
  };
}
