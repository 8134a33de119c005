import type { EditBody, Problem, Resampling } from "../api/types";

/** What a person chose of dynamic resampling; it stays for the next edit. */
export interface ResamplingChoice {
  on: boolean;
  /** A sample is split where its cell has grown to this many of its own spacings. */
  bound: number;
  /** No axis shorter than this is split, in model units. */
  minSpacing: number;
  shearAware: boolean;
  /** Removes samples that were pushed together. */
  cleanUp: boolean;
  /** How close two samples are for one of them to go, in spacings. */
  distance: number;
}

export type ResamplingNumber = "bound" | "minSpacing" | "distance";

/** A refusal, and the number that it is about; null: all of it. */
export interface ResamplingFault {
  about: ResamplingNumber | null;
  text: string;
}

export const DEFAULT_RESAMPLING: ResamplingChoice = {
  on: false,
  bound: 1.5,
  minSpacing: 0,
  shearAware: false,
  cleanUp: false,
  distance: 0.7,
};

/** What the server takes. */
const LIMITS: Record<ResamplingNumber, readonly [number, number]> = {
  bound: [1.05, 16],
  minSpacing: [0, 1e9],
  distance: [0, 0.9],
};

/** Why a number cannot be sent; null where it can. */
export function numberFault(name: ResamplingNumber, value: number): string | null {
  const [least, most] = LIMITS[name];
  if (value >= least && value <= most) return null;
  return most < 1e6
    ? `Between ${least} and ${most}.`
    : `At least ${least}, at most ${most.toLocaleString("en")}.`;
}

/** The member of an edit; null where the samples stay the same ones. */
export function resamplingOf(choice: ResamplingChoice): Resampling | null {
  if (!choice.on) return null;
  return {
    bound: choice.bound,
    min_spacing: choice.minSpacing,
    shear_aware: choice.shearAware,
    collect: choice.cleanUp ? choice.distance : 0,
  };
}

const POINTER = "/resampling";
const FIELDS: Record<string, ResamplingNumber> = {
  [`${POINTER}/bound`]: "bound",
  [`${POINTER}/min_spacing`]: "minSpacing",
  [`${POINTER}/collect`]: "distance",
};

/** What of a refusal is about the resampling; null where nothing is. */
export function faultOfProblem(problem: Problem): ResamplingFault | null {
  const { errors = [], limit, actual } = problem;
  const error = errors.find(({ pointer }) => pointer === POINTER || pointer?.startsWith(`${POINTER}/`));
  if (!error) return null;
  if (error.pointer === `${POINTER}/max_samples` && limit !== undefined) {
    const wanted = actual === undefined ? "" : `${actual.toLocaleString("en")} samples would be needed, `;
    const text = `${wanted}${limit.toLocaleString("en")} is the limit. Raise the bound or the minimum spacing, or move less.`;
    return { about: null, text: text.charAt(0).toUpperCase() + text.slice(1) };
  }
  return { about: FIELDS[error.pointer ?? ""] ?? null, text: error.detail };
}

/** What an edit did to the samples, in words; empty where they stayed the same ones. */
export function describeSamples(record: { inserted: number; removed: number }): string {
  const parts = [
    record.inserted > 0 && `${record.inserted.toLocaleString("en")} inserted`,
    record.removed > 0 && `${record.removed.toLocaleString("en")} removed`,
  ];
  return parts.filter(Boolean).join(", ");
}

/** Samples before all of the edits; `now` where there are none. */
export function samplesBefore(
  edits: readonly { edit: EditBody; inserted: number; removed: number; sample_count: number }[],
  now: number,
): number {
  const [first] = edits;
  return first ? first.sample_count - first.inserted + first.removed : now;
}

/** Storage that may be missing or refuse. */
export type KeptText = Pick<Storage, "getItem" | "setItem">;

const keyOf = (session: string): string => `pointwright.resampling.${session}`;

/** The choice that was made in this session before; what cannot be read is left at its default. */
export function loadResampling(session: string, storage: () => KeptText): ResamplingChoice {
  try {
    const kept = JSON.parse(storage().getItem(keyOf(session)) ?? "{}") as Partial<ResamplingChoice>;
    const number = (name: ResamplingNumber): number => {
      const value = kept[name];
      return typeof value === "number" && numberFault(name, value) === null
        ? value
        : DEFAULT_RESAMPLING[name];
    };
    return {
      on: kept.on === true,
      bound: number("bound"),
      minSpacing: number("minSpacing"),
      shearAware: kept.shearAware === true,
      cleanUp: kept.cleanUp === true,
      distance: number("distance"),
    };
  } catch {
    return DEFAULT_RESAMPLING;
  }
}

export function saveResampling(session: string, choice: ResamplingChoice, storage: () => KeptText): void {
  try {
    storage().setItem(keyOf(session), JSON.stringify(choice));
  } catch {
    // Storage is a comfort, not a need.
  }
}
