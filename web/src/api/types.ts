/** The documents of the HTTP contract, from the types that the OpenAPI document generates. */
import type { Vec3 } from "../math/vec3";
import type { components } from "../protocol/openapi";

type Schemas = components["schemas"];

/** The contract's vectors have three numbers, which the generated types do not say. */
type WithVectors<Type> = Type extends number[]
  ? Vec3
  : Type extends (infer Item)[]
    ? WithVectors<Item>[]
    : Type extends object
      ? { [Name in keyof Type]: WithVectors<Type[Name]> }
      : Type;

/** The regions that edits are made with. Others have names of their own. */
export type RegionName = "zero" | "one";
export type NamedRegion = Schemas["RegionEntry"];
export type ExportFormat = "ply" | "draco" | "xyz";

export type ImportDocument = WithVectors<Schemas["Import"]>;
export type UploadDocument = Schemas["Upload"];
export type CloudDocument = WithVectors<Schemas["Cloud"]>;
export type SessionDocument = WithVectors<Schemas["Session"]>;
export type SessionSummary = WithVectors<Schemas["SessionSummary"]>;
export type PaintedSession = WithVectors<Schemas["PaintedSession"]>;

export type Vec2 = readonly [number, number];

/** A curve over the picture, in the device coordinates of a view. */
export type Outline =
  | { type: "polygon"; vertices: Vec2[] }
  | { type: "ellipse"; center: Vec2; half_axes: Vec2 }
  | { type: "polyline"; vertices: Vec2[]; width: number };

/** All that a view projects into an outline; with `visible`, only what is in front there. */
export interface ScreenShape {
  type: "screen";
  /** Model to clip space, row after row. */
  view: number[];
  outline: Outline;
  visible?: true;
}

/** Where the pixels of an image are above or below a threshold. */
export interface ImageShape {
  type: "image";
  image: string;
  channel: ImageChannel;
  threshold: number;
  side: "above" | "below";
  projection:
    | { type: "texture"; repeat: boolean }
    /** The lower left corner, the whole width and the whole height. */
    | { type: "planar"; origin: Vec3; u: Vec3; v: Vec3; depth?: Vec2 };
}
export type ImageChannel = "luminance" | "red" | "green" | "blue" | "alpha";

export type ImageDocument = Schemas["Image"];
/** What a job is made of; what the server need not be told has its default. */
export type JobRequest = Partial<Omit<Schemas["JobRequest"], "recipe" | "validate">> & { recipe?: unknown };
export type JobEstimate = Schemas["JobEstimate"]["estimate"];
export type Job = Schemas["Job"];
export type JobStatus = Schemas["JobStatus"];
export type JobMode = JobEstimate["mode"];
export type JobFormat = NonNullable<Schemas["JobOutput"]["format"]>;
export type JobReport = Schemas["JobReport"];
export type JobResults = Schemas["JobResults"];
export type JobEvent = Schemas["JobEvent"];

export type Share = Schemas["ShareMembers"];
export type NewShare = Schemas["NewShare"];

/** What is within a distance of another cloud, placed by a matrix (row after row). */
export interface ModelShape {
  type: "model";
  cloud: string;
  matrix: number[];
  thickness: number;
}

/** The shapes that the viewer paints with. */
export type Shape =
  | WithVectors<Exclude<Schemas["Shape"], { type: "points" | "screen" | "image" | "model" }>>
  | ScreenShape
  | ImageShape
  | ModelShape;
/** What the server need not be told has its default. */
export type ShapeOperation = Omit<WithVectors<Schemas["ShapeOperation"]>, "shape" | "steal"> & {
  shape: Shape;
  steal?: boolean;
};
type Lenient<Operation> = Operation extends object
  ? Omit<Operation, "steal" | "stop_at_other"> & { steal?: boolean; stop_at_other?: boolean }
  : never;
export type FloodOperation = Lenient<WithVectors<Schemas["FloodOperation"]>>;
export type MembershipOperation = Lenient<Schemas["MembershipOperation"]>;
export type DistanceOperation = Lenient<Schemas["DistanceOperation"]>;
export type RegionOperation = ShapeOperation | FloodOperation | MembershipOperation | DistanceOperation;
/** A painting's list as the server holds it: not always what was sent, and sent back unread. */
export type RecordedOperation = { readonly mode: string };

export type Deformation = WithVectors<Schemas["Deformation"]>;
export type ElementaryDeformation = WithVectors<Schemas["ElementaryDeformation"]>;
export type Blend = Schemas["Blend"];
/** Every member has a default. */
export type Resampling = Schemas["Resampling"];
export type EditBody = Omit<WithVectors<Schemas["Edit"]>, "blend" | "gains"> & {
  blend?: Blend;
  gains?: readonly number[];
};
export type EditRecord = Omit<WithVectors<Schemas["EditRecord"]>, "edit"> & { edit: EditBody };
export type History = { head: number; edits: EditRecord[] };
export type ServiceInfo = Schemas["Info"];

/**
 * A problem as the viewer shows it: the server's own documents name all of these, a proxy's or the browser's failure only
 * what there is.
 */
export type Problem = Pick<
  Schemas["Problem"],
  "title" | "status" | "errors" | "limit" | "actual" | "revision"
> &
  Partial<Pick<Schemas["Problem"], "detail" | "instance" | "request_id">> & { type: string };
export type ProblemDetail = NonNullable<Schemas["Problem"]["errors"]>[number];
