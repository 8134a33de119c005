import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { CommandQueue } from "../command-queue";
import type { Bus, SessionStore } from "../session-store";
import { reportChangedMeanwhile, reportError } from "./errors";
import type { RegionEditor } from "./regions";

/**
 * Undo, redo and jumps: the server's head is the truth. The list that is shown follows every change, whoever makes it.
 * Undo goes back over paintings and edits in the order in which this page made them.
 */
export class HistoryEditor {
  private readonly bus_: Bus;
  private readonly client_: ApiClient;
  private readonly queue_: CommandQueue;
  private readonly store_: SessionStore;
  private readonly regions_: RegionEditor;
  private loading_ = false;
  private stale_ = false;

  constructor(bus: Bus, client: ApiClient, queue: CommandQueue, store: SessionStore, regions: RegionEditor) {
    this.bus_ = bus;
    this.client_ = client;
    this.queue_ = queue;
    this.store_ = store;
    this.regions_ = regions;
    bus.on("session.changed", () => void this.load());
    bus.function("edit.undo", () => this.step(-1));
    bus.function("edit.redo", () => this.step(1));
    bus.function("edit.jump", (edit) => this.change(() => this.move(edit)));
  }

  /** Fetches the list; while an answer is awaited, further calls ask for one more. */
  async load(): Promise<void> {
    this.stale_ = true;
    if (this.loading_) return;
    this.loading_ = true;
    try {
      while (this.stale_) {
        this.stale_ = false;
        this.bus_.fire("history.changed", await this.client_.history(this.store_.id));
      }
    } catch (error) {
      reportError(this.bus_, error, "The history cannot be read");
    } finally {
      this.loading_ = false;
    }
  }

  private step(by: -1 | 1): Promise<void> {
    // Resolved when its turn comes, so that two quick presses undo two steps.
    return this.change(async () => {
      if (await this.regions_.step(by)) return;
      await this.move(this.store_.document.history.head + by);
    });
  }

  private async move(edit: number): Promise<void> {
    const { history, revision } = this.store_.document;
    if (edit < 0 || edit > history.edits || edit === history.head) return;
    this.store_.update(await this.client_.putHead(this.store_.id, edit, revision));
  }

  private async change(command: () => Promise<void>): Promise<void> {
    try {
      await this.queue_.enqueue(command);
    } catch (error) {
      if (problemOf(error).status === 412) await reportChangedMeanwhile(this.bus_, this.client_, this.store_);
      else reportError(this.bus_, error, "The history could not be moved");
    }
  }
}
