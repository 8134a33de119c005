import type { ApiClient } from "../api/client";
import type { RegionName, RegionOperation, SessionDocument } from "../api/types";
import type { CommandQueue } from "../command-queue";
import type { Bus, SessionStore } from "../session-store";
import { reportError } from "./errors";

/** Paintings of the two regions. Each change waits for those before it, so strokes land in the order of the hand. */
export class RegionEditor {
  private readonly bus_: Bus;
  private readonly client_: ApiClient;
  private readonly queue_: CommandQueue;
  private readonly store_: SessionStore;

  constructor(bus: Bus, client: ApiClient, queue: CommandQueue, store: SessionStore) {
    this.bus_ = bus;
    this.client_ = client;
    this.queue_ = queue;
    this.store_ = store;
  }

  /** Adds operations to a region's painting; resolves with the session after the last, null where one was refused. */
  paint(region: RegionName, operations: readonly RegionOperation[]): Promise<SessionDocument | null> {
    return this.change("The painting was refused", async () => {
      let document: SessionDocument | null = null;
      for (const operation of operations) {
        document = await this.client_.addOperation(this.store_.id, region, operation);
        this.store_.update(document);
      }
      return document;
    });
  }

  /** Takes the shapes out of both regions. */
  erase(operations: readonly RegionOperation[]): Promise<SessionDocument | null> {
    return this.change("The eraser was refused", async () => {
      let document: SessionDocument | null = null;
      for (const region of ["zero", "one"] as const) {
        if (this.store_.document.regions[region].samples === 0) continue;
        for (const operation of operations) {
          document = await this.client_.addOperation(this.store_.id, region, operation);
          this.store_.update(document);
        }
      }
      return document;
    });
  }

  clear(region: RegionName): Promise<SessionDocument | null> {
    return this.change("The region was not cleared", async () => {
      const document = await this.client_.clearRegion(this.store_.id, region);
      this.store_.update(document);
      return document;
    });
  }

  private async change(
    what: string,
    command: () => Promise<SessionDocument | null>,
  ): Promise<SessionDocument | null> {
    try {
      return await this.queue_.enqueue(command);
    } catch (error) {
      reportError(this.bus_, error, what);
      return null;
    }
  }
}
