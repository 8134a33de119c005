import type { ApiClient } from "../api/client";
import type { History } from "../api/types";
import type { CommandQueue } from "../command-queue";
import type { Bus, SessionStore } from "../session-store";
import { reportError } from "./errors";

/** Undo, redo and jumps: the server's head is the truth, the list here is its copy. */
export class HistoryEditor {
  private readonly bus_: Bus;
  private readonly client_: ApiClient;
  private readonly queue_: CommandQueue;
  private readonly store_: SessionStore;
  private history_: History = { head: 0, edits: [] };

  constructor(bus: Bus, client: ApiClient, queue: CommandQueue, store: SessionStore) {
    this.bus_ = bus;
    this.client_ = client;
    this.queue_ = queue;
    this.store_ = store;
    bus.on("history.changed", (history) => {
      this.history_ = history;
    });
    bus.function("edit.undo", () => this.step(-1));
    bus.function("edit.redo", () => this.step(1));
    bus.function("edit.jump", (edit) => this.jump(() => edit));
  }

  async load(): Promise<void> {
    this.bus_.fire("history.changed", await this.client_.history(this.store_.id));
  }

  private step(by: number): Promise<void> {
    // Resolved when its turn comes, so that two quick presses undo two edits.
    return this.jump(() => this.history_.head + by);
  }

  private async jump(target: () => number): Promise<void> {
    try {
      await this.queue_.enqueue(async () => {
        const edit = target();
        if (edit < 0 || edit > this.history_.edits.length || edit === this.history_.head) return;
        this.store_.update(await this.client_.putHead(this.store_.id, edit));
        await this.load();
      });
    } catch (error) {
      reportError(this.bus_, error, "The history could not be moved");
    }
  }
}
