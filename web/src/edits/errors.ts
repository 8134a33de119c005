import type { ApiClient } from "../api/client";
import { describeProblem, problemOf } from "../api/problem";
import type { Bus, SessionStore } from "../session-store";

/** Tells the person what a request was refused for. */
export function reportError(bus: Bus, error: unknown, what: string): void {
  const problem = problemOf(error);
  bus.fire("toast", { kind: "error", title: `${what}: ${problem.title}`, lines: describeProblem(problem) });
}

/** After a 412: takes the session as it is now, and says so. */
export async function reportChangedMeanwhile(
  bus: Bus,
  client: ApiClient,
  store: SessionStore,
): Promise<void> {
  store.update(await client.session(store.id));
  bus.fire("toast", {
    kind: "error",
    title: "The session has changed meanwhile",
    lines: ["Someone else painted or edited. Look at the new state, then try again."],
  });
}
