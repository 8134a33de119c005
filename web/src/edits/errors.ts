import { describeProblem, problemOf } from "../api/problem";
import type { Bus } from "../session-store";

/** Tells the person what a request was refused for. */
export function reportError(bus: Bus, error: unknown, what: string): void {
  const problem = problemOf(error);
  bus.fire("toast", { kind: "error", title: `${what}: ${problem.title}`, lines: describeProblem(problem) });
}
