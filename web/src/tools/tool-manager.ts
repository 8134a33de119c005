import type { ToolName } from "../event-map";
import type { Bus } from "../session-store";
import type { Tool } from "./tool";

/** Holds the tools and keeps exactly one of them active. */
export class ToolManager {
  private readonly tools_ = new Map<ToolName, Tool>();
  private readonly bus_: Bus;
  private current_: Tool;

  constructor(bus: Bus, first: Tool, others: readonly Tool[]) {
    this.bus_ = bus;
    for (const tool of [first, ...others]) {
      if (this.tools_.has(tool.name)) throw new Error(`two tools are called "${tool.name}"`);
      this.tools_.set(tool.name, tool);
    }
    this.current_ = first;
    first.activate();
    bus.function("tool.activate", (name) => this.activate(name));
    bus.function("tool.current", () => this.current_.name);
    bus.function("tool.cancel", () => this.current_.cancel?.() ?? false);
  }

  get current(): ToolName {
    return this.current_.name;
  }

  activate(name: ToolName): void {
    const next = this.tools_.get(name);
    if (!next || next === this.current_) return;
    this.current_.deactivate(name);
    this.current_ = next;
    next.activate();
    this.bus_.fire("tool.changed", name);
  }
}
