import type { Deformation, History, Problem, SessionDocument } from "./api/types";
import type { Vec3 } from "./math/vec3";
import type { DisplaySettings } from "./scene/display";

export type ToolName = "orbit" | "zero" | "one" | "erase" | "move" | "rotate";

export interface PreviewStatus {
  /** `exact`: the picture is the server's frame of the newest parameters. `preview`: the hand is ahead of it. */
  state: "none" | "preview" | "exact";
  latencyMs: number;
  samplesPerSecond: number;
}

export interface LoadStatus {
  loaded: number;
  total: number;
  complete: boolean;
}

export interface TransformState {
  deformation: Deformation | null;
  pivot: Vec3;
  axis: "x" | "y" | "z" | null;
  pivotEditing: boolean;
  /** The smooth base moves and carries its detail; else the samples themselves move. */
  /** The level that moves; finer ones ride along. */
  level: number;
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
  "tool.changed": ToolName;
  "brush.radius": number;
  "display.changed": DisplaySettings;
  "detail.range": number;
  "frame.applied": { sequence: number; revision: number; key: boolean };
  "load.changed": LoadStatus;
  "preview.changed": PreviewStatus;
  "transform.changed": TransformState;
  "connection.changed": "live" | "connecting" | "lost";
  "region.touched": { hasRegions: boolean };
  toast: Toast;
}

/** What may be asked on the bus; one module answers each. */
export interface Questions {
  "tool.activate": (name: ToolName) => void;
  "tool.current": () => ToolName;
  "edit.undo": () => Promise<void>;
  "edit.redo": () => Promise<void>;
  "edit.jump": (edit: number) => Promise<void>;
  "edit.commit": () => Promise<void>;
  "edit.cancel": () => void;
  "brush.set": (radius: number) => void;
  "view.frame": () => void;
  "shortcuts.show": () => void;
}
