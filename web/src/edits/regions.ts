import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { RegionName, RegionOperation, SessionDocument } from "../api/types";
import type { CommandQueue } from "../command-queue";
import type { Bus, SessionStore } from "../session-store";
import { reportError } from "./errors";
import type { PaintTarget } from "./paint-settings";
import { PaintingHistory, REGIONS, type StepResult } from "./painting-history";

export type Painted = SessionDocument & { changed: number };

/** What is done to a region as a whole. */
export type RegionCommand = "all" | "invert" | "grow" | "shrink" | "clear";

/** The operation of a command; null where the region's list is dropped. */
export function commandOperation(command: RegionCommand, distance: number): RegionOperation | null {
  switch (command) {
    case "all":
      return { mode: "add", shape: { type: "all" }, steal: true };
    case "invert":
      return { mode: "invert", steal: true };
    case "grow":
      return { mode: "grow", distance, steal: true };
    case "shrink":
      return { mode: "shrink", distance };
    case "clear":
      return null;
  }
}

/** Paintings of the two regions. Each change waits for those before it, so strokes land in the order of the hand. */
export class RegionEditor {
  private readonly bus_: Bus;
  private readonly client_: ApiClient;
  private readonly queue_: CommandQueue;
  private readonly store_: SessionStore;
  private readonly history_: PaintingHistory;

  constructor(bus: Bus, client: ApiClient, queue: CommandQueue, store: SessionStore) {
    this.bus_ = bus;
    this.client_ = client;
    this.queue_ = queue;
    this.store_ = store;
    this.history_ = new PaintingHistory(client, store);
    bus.on("session.changed", () => this.tell());
    bus.on("edit.recorded", (headBefore) => {
      this.history_.edited(headBefore);
      this.tell();
    });
  }

  /** Adds operations to a region's painting; resolves with the session after the last, null where one was refused. */
  paint(target: PaintTarget, operations: readonly RegionOperation[]): Promise<Painted | null> {
    if (target !== "erase")
      return this.paintEach(
        operations.map((operation): [RegionName, RegionOperation] => [target, operation]),
      );
    return this.change("The eraser was refused", REGIONS, false, (take) =>
      // Out of an empty region nothing can be taken.
      this.send(
        REGIONS.filter((region) => this.store_.document.regions[region].samples > 0).flatMap((region) =>
          operations.map((operation): [RegionName, RegionOperation] => [region, operation]),
        ),
        take,
      ),
    );
  }

  /** Several operations as one change, undone together. */
  paintEach(changes: readonly (readonly [RegionName, RegionOperation])[]): Promise<Painted | null> {
    const regions = REGIONS.filter((region) => changes.some(([painted]) => painted === region));
    return this.change("The painting was refused", regions, false, (take) => this.send(changes, take));
  }

  private async send(
    changes: readonly (readonly [RegionName, RegionOperation])[],
    take: (document: SessionDocument) => void,
  ): Promise<Painted | null> {
    let last: SessionDocument | null = null;
    let changed = 0;
    for (const [region, operation] of changes) {
      const document = await this.client_.addOperation(this.store_.id, region, operation);
      changed += document.changed;
      take(document);
      last = document;
    }
    return last && { ...last, changed };
  }

  /** `distance`: how far it grows or shrinks, in model units. */
  command(region: RegionName, command: RegionCommand, distance: number): Promise<SessionDocument | null> {
    const operation = commandOperation(command, distance);
    if (operation) return this.paint(region, [operation]);
    return this.change("The region was not cleared", [region], true, async (take) => {
      const document = await this.client_.clearRegion(this.store_.id, region);
      take(document);
      return document;
    });
  }

  /** Keeps what a region has now under a name of its own, instead of what was kept there before. */
  save(name: string, from: RegionName): Promise<SessionDocument | null> {
    const operation = { mode: "set", shape: { type: "region", region: from } };
    return this.keep("The region was not saved", () =>
      this.client_.putOperations(this.store_.id, name, [operation]),
    );
  }

  /** Forgets a saved region; what was painted with it stays. */
  forget(name: string): Promise<SessionDocument | null> {
    return this.keep("The saved region was not deleted", () =>
      this.client_.clearRegion(this.store_.id, name),
    );
  }

  /** Changes nothing that is painted. */
  private async keep(what: string, request: () => Promise<SessionDocument>): Promise<SessionDocument | null> {
    try {
      return await this.queue_.enqueue(async () => {
        const document = await request();
        this.store_.update(document);
        return document;
      });
    } catch (error) {
      reportError(this.bus_, error, what);
      return null;
    }
  }

  /** Applies a recipe: its edits, and the regions of its last one instead of both; undone together. Throws where refused. */
  async applyRecipe(recipe: unknown): Promise<void> {
    try {
      await this.queue_.enqueue(() =>
        this.history_.record(REGIONS, true, async (take) =>
          take(await this.client_.applyRecipe(this.store_.id, recipe, this.store_.document.revision)),
        ),
      );
    } finally {
      this.tell();
    }
  }

  /** Undoes (-1) or redoes (1) where that concerns the painting; false where it does not. Within the command queue. */
  async step(by: -1 | 1): Promise<boolean> {
    let result: StepResult;
    try {
      result = await this.history_.step(by);
    } catch (error) {
      // A session that has moved on is the caller's to fetch.
      if (problemOf(error).status === 412) throw error;
      reportError(this.bus_, error, by < 0 ? "The painting was not undone" : "The painting was not redone");
      return true;
    } finally {
      this.tell();
    }
    if (result === "none") return false;
    if (result === "stale")
      this.bus_.fire("toast", {
        kind: "info",
        title: "The painting has changed meanwhile",
        lines: ["Someone else painted: what was painted here before can no longer be undone."],
      });
    if (result === "nearly")
      this.bus_.fire("toast", {
        kind: "info",
        title: "The painting is nearly as it was",
        lines: ["Someone else painted in between, or the regions were painted over each other."],
      });
    return true;
  }

  private async change<Result>(
    what: string,
    regions: readonly RegionName[],
    replaces: boolean,
    command: (take: (document: SessionDocument) => void) => Promise<Result>,
  ): Promise<Result | null> {
    try {
      return await this.queue_.enqueue(() => this.history_.record(regions, replaces, command));
    } catch (error) {
      reportError(this.bus_, error, what);
      return null;
    } finally {
      this.tell();
    }
  }

  private tell(): void {
    this.bus_.fire("painting.history", this.history_.next);
  }
}
