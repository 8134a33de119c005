import type { ToolName } from "../event-map";
import type { Bus } from "../session-store";
import { h } from "./dom";
import { type IconName, icon } from "./icons";

interface ToolButton {
  name: ToolName;
  icon: IconName;
  label: string;
  key: string;
  class?: string;
}

const TOOLS: readonly (readonly ToolButton[])[] = [
  [{ name: "orbit", icon: "orbit", label: "Navigate", key: "Q" }],
  [
    { name: "zero", icon: "anchor", label: "Paint the zero-region: stays", key: "Z", class: "zero" },
    { name: "one", icon: "brush", label: "Paint the one-region: moves", key: "O", class: "one" },
    { name: "erase", icon: "eraser", label: "Erase painting", key: "E" },
  ],
  [
    { name: "move", icon: "move", label: "Move", key: "G" },
    { name: "rotate", icon: "rotate", label: "Turn", key: "R" },
    { name: "scale", icon: "scale", label: "Scale", key: "S" },
    { name: "twist", icon: "twist", label: "Twist", key: "T" },
    { name: "normal", icon: "normal", label: "Along normal", key: "N" },
    { name: "toward", icon: "toward", label: "Toward a point", key: "A" },
  ],
];

/** The rail of tools at the left. */
export function createToolbar(bus: Bus): HTMLElement {
  const buttons = new Map<ToolName, HTMLButtonElement>();
  const rail = h("div", {
    class: "rail",
    role: "toolbar",
    aria: { label: "Tools", orientation: "vertical" },
  });
  for (const group of TOOLS) {
    const holder = h("div", { class: "rail-group panel" });
    for (const tool of group) {
      const button = h(
        "button",
        {
          type: "button",
          class: `tool ${tool.class ?? ""}`,
          aria: {
            label: `${tool.label} (${tool.key})`,
            pressed: String(tool.name === "orbit"),
            keyshortcuts: tool.key,
          },
          data: { tip: `${tool.label}`, key: tool.key, tool: tool.name },
          onclick: () => bus.invoke("tool.activate", tool.name),
        },
        icon(tool.icon),
      );
      buttons.set(tool.name, button);
      holder.append(button);
    }
    rail.append(holder);
  }
  const frame = h(
    "button",
    {
      type: "button",
      class: "tool",
      aria: { label: "Frame the object (F)", keyshortcuts: "F" },
      data: { tip: "Frame the object", key: "F" },
      onclick: () => bus.invoke("view.frame"),
    },
    icon("frame"),
  );
  rail.append(h("div", { class: "rail-group panel" }, frame));
  bus.on("tool.changed", (name) => {
    for (const [tool, button] of buttons) button.setAttribute("aria-pressed", String(tool === name));
  });
  return rail;
}
