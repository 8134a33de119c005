import { drawsOutline, mayIntersect, type PaintMethod, type PaintMode } from "../edits/paint-settings";
import { PAINT_TARGETS, type ToolName } from "../event-map";
import type { Bus } from "../session-store";
import { h } from "./dom";
import { type IconName, icon } from "./icons";

/** The ways of choosing samples, with their keys: the editor's table of shortcuts reads them here. */
export const METHODS: readonly { name: PaintMethod; label: string; key: string; hint: string }[] = [
  { name: "brush", label: "Brush", key: "B", hint: "Drag on the surface to paint." },
  { name: "lasso", label: "Lasso", key: "L", hint: "Drag around what you mean." },
  {
    name: "polygon",
    label: "Polygon",
    key: "P",
    hint: "Click the corners; Enter, a double click or the first corner closes it, Backspace takes the last one back.",
  },
  { name: "rectangle", label: "Rectangle", key: "U", hint: "Drag from corner to corner." },
  { name: "ellipse", label: "Ellipse", key: "C", hint: "Drag from corner to corner of the box around it." },
  { name: "line", label: "Line", key: "D", hint: "Drag from end to end; it is as wide as the brush." },
  { name: "flood", label: "Flood fill", key: "W", hint: "Click the surface: what is connected is filled." },
];

const MODES: readonly { name: PaintMode; label: string; keys: string; icon: IconName }[] = [
  { name: "add", label: "Add", keys: "", icon: "plus" },
  { name: "remove", label: "Remove", keys: "Shift", icon: "minus" },
  { name: "intersect", label: "Keep only", keys: "Alt", icon: "keep" },
];

/** How a region is painted: over the picture, while a painting tool is active. */
export function createPaintBar(bus: Bus): HTMLElement {
  const button = (name: IconName, label: string, tip: string, key: string, run: () => void) =>
    h(
      "button",
      {
        type: "button",
        class: "tool small",
        aria: { label: key ? `${label} (${key})` : label, pressed: "false" },
        data: { tip, key },
        onclick: run,
      },
      icon(name),
    );
  const methods = METHODS.map(({ name, label, key }) => {
    const made = button(name, label, label, key, () => bus.invoke("paint.set", { method: name }));
    made.dataset["method"] = name;
    made.setAttribute("aria-keyshortcuts", key);
    return made;
  });
  const modes = MODES.map(({ name, label, keys, icon: sign }) => {
    const made = button(sign, label, label, keys, () => bus.invoke("paint.set", { mode: name }));
    made.dataset["mode"] = name;
    return made;
  });
  const visible = button("visible", "Visible only", "Visible only, not through", "V", () =>
    bus.invoke("paint.set", { visibleOnly: !bus.invoke("paint.settings").visibleOnly }),
  );
  visible.dataset["option"] = "visible";
  const group = (label: string, ...buttons: HTMLElement[]): HTMLElement =>
    h("div", { class: "paint-group", role: "group", aria: { label } }, ...buttons);
  const bar = h(
    "div",
    { class: "paint-bar panel", role: "toolbar", aria: { label: "How to paint" }, hidden: true },
    group("Choose by", ...methods),
    group("What becomes of it", ...modes),
    group("Depth", visible),
  );
  let tool: ToolName = "orbit";
  const refresh = (): void => {
    const target = PAINT_TARGETS.find((name) => name === tool);
    bar.hidden = target === undefined;
    if (!target) return;
    const settings = bus.invoke("paint.settings");
    bar.dataset["target"] = target;
    for (const made of methods)
      made.setAttribute("aria-pressed", String(made.dataset["method"] === settings.method));
    const intersects = mayIntersect(settings.method, target);
    const mode = settings.mode === "intersect" && !intersects ? "add" : settings.mode;
    for (const made of modes) {
      const name = made.dataset["mode"];
      made.setAttribute("aria-pressed", String(name === (target === "erase" ? "remove" : mode)));
      made.disabled =
        target === "erase" ||
        (name === "intersect" && !intersects) ||
        (name === "remove" && settings.method === "flood");
    }
    visible.disabled = !drawsOutline(settings.method);
    visible.setAttribute("aria-pressed", String(settings.visibleOnly && !visible.disabled));
  };
  bus.on("tool.changed", (name) => {
    tool = name;
    refresh();
  });
  bus.on("paint.changed", refresh);
  return bar;
}
