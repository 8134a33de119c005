import type { ToolName } from "../event-map";

/** One way of working with the pointer. Exactly one is active. */
export interface Tool {
  readonly name: ToolName;
  activate(): void;
  /**
   * Leaves nothing of the tool on the screen; what it holds unfinished is finished or dropped, as its file says. `next` is
   * the tool that follows.
   */
  deactivate(next: ToolName): void;
  /** Drops what was begun; false where nothing was. */
  cancel?(): boolean;
}
