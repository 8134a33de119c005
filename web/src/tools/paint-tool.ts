import type { PaintMethod, PaintSettingsStore, PaintTarget } from "../edits/paint-settings";
import type { Viewport } from "../scene/viewport";
import type { Bus } from "../session-store";
import type { Tool } from "./tool";

/** One way of choosing samples by the pointer. */
export interface PaintGesture {
  activate(target: PaintTarget): void;
  /** Finishes or drops what was begun, as its file says. */
  deactivate(): void;
  /** Drops what was begun; false where nothing was. */
  cancel(): boolean;
}

/** Paints one region, or erases from both, by whichever method is chosen. */
export class PaintTool implements Tool {
  readonly name: PaintTarget;
  private readonly bus_: Bus;
  private readonly viewport_: Viewport;
  private readonly settings_: PaintSettingsStore;
  private readonly gestures_: Record<PaintMethod, PaintGesture>;
  private current_: { method: PaintMethod; gesture: PaintGesture } | null = null;
  private end_: (() => void) | null = null;

  constructor(
    target: PaintTarget,
    bus: Bus,
    viewport: Viewport,
    settings: PaintSettingsStore,
    gestures: Record<PaintMethod, PaintGesture>,
  ) {
    this.name = target;
    this.bus_ = bus;
    this.viewport_ = viewport;
    this.settings_ = settings;
    this.gestures_ = gestures;
  }

  activate(): void {
    const { canvas, rig } = this.viewport_;
    const listeners = new AbortController();
    rig.setPainting(true);
    canvas.classList.add("painting");
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), { signal: listeners.signal });
    const unlisten = this.bus_.on("paint.changed", () => this.follow());
    this.end_ = () => {
      unlisten();
      listeners.abort();
    };
    this.follow();
  }

  deactivate(): void {
    const { canvas, rig } = this.viewport_;
    this.end_?.();
    this.end_ = null;
    this.current_?.gesture.deactivate();
    this.current_ = null;
    canvas.classList.remove("painting");
    delete canvas.dataset["method"];
    rig.setPainting(false);
  }

  cancel(): boolean {
    return this.current_?.gesture.cancel() ?? false;
  }

  /** Takes up the method of the settings. */
  private follow(): void {
    const { method } = this.settings_.value;
    if (this.current_?.method === method) return;
    this.current_?.gesture.deactivate();
    const gesture = this.gestures_[method];
    this.current_ = { method, gesture };
    this.viewport_.canvas.dataset["method"] = method;
    gesture.activate(this.name);
  }
}
