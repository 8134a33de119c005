import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { CommandQueue } from "../command-queue";
import type { Bus, SessionStore } from "../session-store";
import { reportChangedMeanwhile, reportError } from "./errors";

/** Applies a recipe file's edits on top of what is there, as one change. */
export async function applyRecipeFile(
  bus: Bus,
  client: ApiClient,
  queue: CommandQueue,
  store: SessionStore,
  file: Blob & { name: string },
): Promise<void> {
  let recipe: unknown;
  try {
    recipe = JSON.parse(await file.text());
  } catch {
    bus.fire("toast", {
      kind: "error",
      title: `${file.name} is no recipe`,
      lines: ["A recipe is a JSON document, as a session gives it."],
    });
    return;
  }
  try {
    await queue.enqueue(async () => {
      store.update(await client.applyRecipe(store.id, recipe, store.document.revision));
    });
    bus.fire("toast", { kind: "success", title: `Applied ${file.name}` });
  } catch (error) {
    if (problemOf(error).status === 412) await reportChangedMeanwhile(bus, client, store);
    else reportError(bus, error, `${file.name} was not applied`);
  }
}
