import type { Deformation, ElementaryDeformation } from "../api/types";
import { isIdentity } from "./deformation";

/** The server's limit. */
export const MAX_STEPS = 8;

/**
 * The steps of a composition, one of which the hand is at. Immutable. Along the normal is the first step or none: the wire
 * has it so, since later steps know no normal of the level any more.
 */
export interface Steps {
  /** All but the current one, in order. */
  readonly others: readonly ElementaryDeformation[];
  /** Where the current one stands among them. */
  readonly at: number;
}

export const ONE_STEP: Steps = { others: [], at: 0 };

/** Every step in order, the current one null where it does nothing yet. */
export function allSteps(
  { others, at }: Steps,
  current: ElementaryDeformation | null,
): (ElementaryDeformation | null)[] {
  return [...others.slice(0, at), current, ...others.slice(at)];
}

/** What is sent: one step as it is, several as a sequence; null where there is none. */
export function composed(steps: Steps, current: ElementaryDeformation | null): Deformation | null {
  if (steps.others.length === 0) return current;
  const all = allSteps(steps, current).filter((step) => step !== null);
  const moving = all.filter((step) => !isIdentity(step));
  const [first] = moving.length > 0 ? moving : all;
  if (!first) return null;
  return moving.length > 1 ? { type: "sequence", steps: moving } : first;
}

/** The place of the step along the normal; -1 where there is none. */
export function normalStep(steps: Steps, current: ElementaryDeformation | null): number {
  return allSteps(steps, current).findIndex((step) => step?.type === "along_normal");
}

/** Sets the current step down and begins another one at the end; null where there is no room or nothing to set down. */
export function withStepAdded(steps: Steps, current: ElementaryDeformation | null): Steps | null {
  if (!current || isIdentity(current) || steps.others.length + 1 >= MAX_STEPS) return null;
  const others = allSteps(steps, current).filter((step) => step !== null);
  return { others, at: others.length };
}

/** Goes to another step; what the current one does stays, and where it does nothing it goes. */
export function withStepChosen(
  steps: Steps,
  current: ElementaryDeformation | null,
  chosen: number,
): { steps: Steps; current: ElementaryDeformation } | null {
  const all = allSteps(steps, current);
  const next = all[chosen];
  if (!next || chosen === steps.at) return null;
  const kept = all.filter((step, i) => i === chosen || (step !== null && !isIdentity(step)));
  const at = kept.indexOf(next);
  return {
    steps: { others: kept.filter((step, i) => step !== null && i !== at) as ElementaryDeformation[], at },
    current: next,
  };
}

/** Without one step; where that is the current one, the step before it becomes current. */
export function withoutStep(
  steps: Steps,
  current: ElementaryDeformation | null,
  gone: number,
): { steps: Steps; current: ElementaryDeformation | null } {
  if (gone !== steps.at) {
    const place = gone < steps.at ? gone : gone - 1;
    return {
      steps: {
        others: steps.others.filter((_, i) => i !== place),
        at: gone < steps.at ? steps.at - 1 : steps.at,
      },
      current,
    };
  }
  const at = Math.max(0, steps.at - 1);
  return {
    steps: { others: steps.others.filter((_, i) => i !== at), at },
    current: steps.others[at] ?? null,
  };
}

/** Whether a step may change places with the one after it. */
export function maySwap(steps: Steps, current: ElementaryDeformation | null, first: number): boolean {
  const all = allSteps(steps, current);
  const [a, b] = [all[first], all[first + 1]];
  return a != null && b != null && a.type !== "along_normal" && b.type !== "along_normal";
}

/** Changes the places of a step and the one after it. */
export function withSwapped(steps: Steps, current: ElementaryDeformation | null, first: number): Steps {
  if (!maySwap(steps, current, first)) return steps;
  const all = allSteps(steps, current);
  const order = all.map((_, i) => (i === first ? first + 1 : i === first + 1 ? first : i));
  const at = order.indexOf(steps.at);
  const others = order.filter((i) => i !== steps.at).map((i) => all[i]);
  return { others: others.filter((step) => step != null), at };
}

/** Along the normal comes first: the current step's place where it becomes one. */
export function withNormalFirst(steps: Steps): Steps {
  return { others: steps.others, at: 0 };
}
