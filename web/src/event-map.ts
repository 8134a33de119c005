import type { Blend, ElementaryDeformation, History, Problem, SessionDocument } from "./api/types";
import type { PaintSettings } from "./edits/paint-settings";
import type { ResamplingChoice, ResamplingFault } from "./edits/resampling";
import type { Vec3 } from "./math/vec3";
import type { DisplaySettings } from "./scene/display";

/** The tools that deform, in the order of the panel. */
export const TRANSFORM_KINDS = ["move", "rotate", "scale", "twist", "normal", "toward"] as const;
export type TransformKind = (typeof TRANSFORM_KINDS)[number];
/** The tools that paint: a region, or both with the eraser. */
export const PAINT_TARGETS = ["zero", "one", "erase"] as const;
export type ToolName = "orbit" | (typeof PAINT_TARGETS)[number] | TransformKind;

export interface PreviewStatus {
  /**
   * `exact`: the picture is the server's frame of the newest parameters. `preview`: the hand is ahead of it, and the picture
   * looks ahead. `waiting`: the picture cannot, and waits for the server.
   */
  state: "none" | "preview" | "waiting" | "exact";
  /** The server's frame has other samples than the committed state; recording relaxes them further. */
  resampled: boolean;
  latencyMs: number;
  samplesPerSecond: number;
}

export interface LoadStatus {
  loaded: number;
  total: number;
  complete: boolean;
}

export interface TransformState {
  /** Of the step that the hand is at. */
  deformation: ElementaryDeformation | null;
  /** All steps in order; the current one is null while it does nothing. */
  steps: readonly (ElementaryDeformation | null)[];
  step: number;
  pivot: Vec3;
  axis: "x" | "y" | "z" | null;
  pivotEditing: boolean;
  /** What a twist turns about, through the pivot, and the height over which it turns by the angle. */
  twist: { direction: Vec3; length: number };
  /** The level that moves; finer ones ride along. */
  level: number;
  blend: Blend;
  /** What multiplies each band's detail in the one-region; those of bands below the level do not count. */
  gains: readonly number[];
  resampling: ResamplingChoice;
  /** What the server refused of it. */
  resamplingFault: ResamplingFault | null;
  /** Why no transform can be made now; null where it can. */
  obstacle: string | null;
}

export interface Toast {
  kind: "info" | "success" | "error";
  title: string;
  lines?: string[];
}

/** What is told on the bus. */
export interface Notices {
  "session.changed": SessionDocument;
  "session.failed": Problem;
  "history.changed": History;
  /** An edit of this page was recorded on top of this head. */
  "edit.recorded": number;
  "tool.changed": ToolName;
  "brush.radius": number;
  "paint.changed": PaintSettings;
  /** What of the painting the next undo or redo would change. */
  "painting.history": { undo: boolean; redo: boolean };
  "display.changed": DisplaySettings;
  "detail.range": number;
  /** The factor that no stretch of the frames exceeds; 0: nothing was resampled yet. */
  "stretch.range": number;
  "frame.applied": { sequence: number; revision: number; samples: number };
  "load.changed": LoadStatus;
  "preview.changed": PreviewStatus;
  "transform.changed": TransformState;
  /** What part of the recorded edits is shown, 0 … 1; null: the committed state. */
  "animation.changed": { s: number | null; playing: boolean };
  "connection.changed": "live" | "connecting" | "lost";
  "region.touched": { hasRegions: boolean };
  toast: Toast;
}

/** What may be asked on the bus; one module answers each. */
export interface Questions {
  "tool.activate": (name: ToolName) => void;
  "tool.current": () => ToolName;
  /** Drops what the tool has begun; false where it has begun nothing. */
  "tool.cancel": () => boolean;
  "edit.undo": () => Promise<void>;
  "edit.redo": () => Promise<void>;
  "edit.jump": (edit: number) => Promise<void>;
  "edit.commit": () => Promise<void>;
  "edit.cancel": () => void;
  /** Whether an edit waits to be recorded or dropped. */
  "edit.pending": () => boolean;
  "brush.set": (radius: number) => void;
  "paint.settings": () => PaintSettings;
  "paint.set": (change: Partial<PaintSettings>) => void;
  /** Shows the recorded edits part of the way, not while an edit is pending; null goes back to the committed state. */
  "animation.set": (s: number | null) => void;
  "animation.play": () => void;
  "animation.current": () => number | null;
  /** Takes an image away that lies over the view; false where none does. */
  "image.dismiss": () => boolean;
  "view.frame": () => void;
  "shortcuts.show": () => void;
}
