/** The documents of the HTTP contract, as the viewer reads them. */
import type { Vec3 } from "../math/vec3";

export type RegionName = "zero" | "one";
export type ExportFormat = "ply" | "draco" | "xyz";

export interface Bounds {
  min: Vec3;
  max: Vec3;
}

export interface ProblemDetail {
  pointer?: string;
  detail: string;
}

/** RFC 9457, with the limit that was met where there is one. */
export interface Problem {
  type: string;
  title: string;
  status: number;
  detail?: string;
  request_id?: string;
  errors?: ProblemDetail[];
  limit?: number;
  actual?: number;
  revision?: number;
}

export interface ImportReport {
  format: string;
  encoding?: string;
  declared_count?: number;
  dropped_non_finite?: number;
  duplicate_count?: number;
  from_mesh?: boolean;
  position_is_double?: boolean;
  attributes?: string[];
  skipped?: string[];
}

export interface CloudDocument {
  id: string;
  name: string;
  bytes: number;
  created: string;
  sample_count: number;
  bounds: Bounds;
  origin: Vec3;
  diagonal: number;
  report: ImportReport;
}

export interface RegionSummary {
  samples: number;
  operations: number;
}

export interface Decomposition {
  scale: number;
  base_samples?: number;
  at_limit?: number;
  fallback?: number;
  flipped?: number;
  mean_iterations?: number;
  max_detail?: number;
  rms_detail?: number;
}

export interface SessionDocument {
  id: string;
  name: string;
  cloud: string;
  state: "building" | "ready" | "failed";
  progress?: { phase: string; fraction: number };
  error?: Problem;
  revision: number;
  created: string;
  sample_count: number;
  origin: Vec3;
  bounds: Bounds;
  diagonal: number;
  spacing: number;
  levels: { level: number; scale: number }[];
  decomposition: Decomposition[];
  regions: { zero: RegionSummary; one: RegionSummary };
  history: { head: number; edits: number };
  timings_ms?: Record<string, number>;
}

/** What the list of sessions says of each. */
export type SessionSummary = Pick<SessionDocument, "id" | "name" | "cloud" | "state" | "created"> &
  Partial<SessionDocument>;

export type Shape =
  | { type: "sphere"; center: Vec3; radius: number }
  | { type: "stroke"; vertices: Vec3[]; radius: number }
  | { type: "box"; min: Vec3; max: Vec3 }
  | { type: "half_space"; point: Vec3; normal: Vec3 }
  | { type: "all" };

export type OperationMode = "add" | "remove" | "intersect" | "set";

export interface RegionOperation {
  mode: OperationMode;
  shape: Shape;
  facing?: Vec3;
  steal?: boolean;
}

export type Deformation =
  | { type: "translation"; vector: Vec3 }
  | { type: "rotation"; axis: { point: Vec3; direction: Vec3 }; angle_deg: number };

export interface EditBody {
  level: number;
  blend?: string;
  deformation: Deformation;
}

export interface EditRecord {
  index: number;
  edit: EditBody;
  created: string;
  moved_samples: number;
  zero_samples?: number;
  one_samples?: number;
}

export interface History {
  head: number;
  edits: EditRecord[];
}

export interface ServiceInfo {
  version: string;
  limits: Record<string, number>;
  formats?: string[];
}
