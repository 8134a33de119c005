import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { Bus, SessionStore } from "../session-store";
import { reportChangedMeanwhile, reportError } from "./errors";
import type { RegionEditor } from "./regions";

/** Applies a recipe file's edits on top of what is there, as one change. */
export async function applyRecipeFile(
  bus: Bus,
  client: ApiClient,
  store: SessionStore,
  regions: RegionEditor,
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
    await regions.applyRecipe(recipe);
    bus.fire("toast", {
      kind: "success",
      title: `Applied ${file.name}`,
      lines: ["The regions are those of the recipe now. Undo brings the ones before back."],
    });
  } catch (error) {
    if (problemOf(error).status === 412) await reportChangedMeanwhile(bus, client, store);
    else reportError(bus, error, `${file.name} was not applied`);
  }
}
