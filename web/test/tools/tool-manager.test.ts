import { expect, test } from "vitest";
import type { Notices, Questions, ToolName } from "../../src/event-map";
import { Events } from "../../src/events";
import type { Tool } from "../../src/tools/tool";
import { ToolManager } from "../../src/tools/tool-manager";

function tool(name: ToolName, log: string[]): Tool {
  return { name, activate: () => log.push(`+${name}`), deactivate: () => log.push(`-${name}`) };
}

test("exactly one tool is active", () => {
  const bus = new Events<Notices, Questions>();
  const log: string[] = [];
  bus.on("tool.changed", (name) => log.push(name));
  new ToolManager(bus, tool("orbit", log), [tool("zero", log), tool("move", log)]);
  bus.invoke("tool.activate", "zero");
  bus.invoke("tool.activate", "zero");
  bus.invoke("tool.activate", "move");
  expect(log).toEqual(["+orbit", "-orbit", "+zero", "zero", "-zero", "+move", "move"]);
  expect(bus.invoke("tool.current")).toBe("move");
});

test("two tools of one name are a mistake", () => {
  const bus = new Events<Notices, Questions>();
  expect(() => new ToolManager(bus, tool("orbit", []), [tool("orbit", [])])).toThrow(/two tools/);
});
