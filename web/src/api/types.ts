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

export type RegionName = Schemas["Painting"]["region"];
export type ExportFormat = "ply" | "draco" | "xyz";

export type CloudDocument = WithVectors<Schemas["Cloud"]>;
export type SessionDocument = WithVectors<Schemas["Session"]>;
export type SessionSummary = WithVectors<Schemas["SessionSummary"]>;
export type PaintedSession = WithVectors<Schemas["PaintedSession"]>;

/** The shapes that the viewer paints with. */
export type Shape = WithVectors<Exclude<Schemas["Shape"], { type: "points" | "screen" | "image" | "model" }>>;
/** What the server need not be told has its default. */
export type RegionOperation = Omit<WithVectors<Schemas["ShapeOperation"]>, "shape" | "steal"> & {
  shape: Shape;
  steal?: boolean;
};

export type Deformation = WithVectors<Schemas["Deformation"]>;
export type Blend = Schemas["Blend"];
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
