import type { RegionName } from "./api/types";
import type { RegionCommand } from "./edits/regions";
import type { TransformEditor } from "./edits/transform";
import { PAINT_TARGETS, type ToolName, TRANSFORM_KINDS } from "./event-map";
import { VIEW_NAMES } from "./scene/camera-math";
import type { Viewport } from "./scene/viewport";
import type { Bus } from "./session-store";
import { METHODS } from "./ui/paint-bar";
import { ctrl, key, type Shortcut } from "./ui/shortcuts";
import type { TransformPanel } from "./ui/transform-panel";

export interface ShortcutContext {
  bus: Bus;
  viewport: Viewport;
  editor: TransformEditor;
  transformPanel: TransformPanel;
  stepBrush: (steps: number) => void;
  command: (region: RegionName, command: RegionCommand) => void;
}

const TURN = 0.12;

/** Every key of the editor, as one table: what the sheet shows is what the keys do. */
export function editorShortcuts(context: ShortcutContext): Shortcut[] {
  const { bus, viewport, editor, transformPanel, stepBrush, command } = context;
  const transforming = (): boolean => TRANSFORM_KINDS.some((kind) => kind === bus.invoke("tool.current"));
  const painting = (): boolean => PAINT_TARGETS.some((target) => target === bus.invoke("tool.current"));
  const tool = (name: ToolName, letter: string, label: string): Shortcut => ({
    group: "Tools",
    keys: letter.toUpperCase(),
    label,
    matches: key(letter),
    run: () => bus.invoke("tool.activate", name),
  });
  const axis = (name: "x" | "y" | "z"): Shortcut => ({
    group: "Transform",
    keys: name.toUpperCase(),
    label: `Only along or about ${name.toUpperCase()}`,
    matches: (event) => transforming() && key(name)(event),
    run: () => editor.setAxis(editor.state.axis === name ? null : name),
  });
  /** The region that is being painted; null while none is. */
  const region = (): RegionName | null => {
    const current = bus.invoke("tool.current");
    return current === "zero" || current === "one" ? current : null;
  };
  const toRegion = (
    keys: string,
    label: string,
    matches: (event: KeyboardEvent) => boolean,
    what: RegionCommand,
  ): Shortcut => ({
    group: "Painted region",
    keys,
    label,
    matches: (event) => region() !== null && matches(event),
    run: () => {
      const painted = region();
      if (painted) command(painted, what);
    },
  });
  const nudge = (
    keys: string,
    name: string,
    label: string,
    right: number,
    up: number,
    zoom: number,
  ): Shortcut => ({
    group: "View",
    keys,
    label,
    matches: (event) => document.activeElement === viewport.canvas && key(name)(event),
    run: () => viewport.rig.nudge(right, up, zoom),
  });
  return [
    // Before the tools: in a transform, Z holds an axis.
    axis("x"),
    axis("y"),
    axis("z"),
    tool("orbit", "q", "Navigate"),
    tool("zero", "z", "Paint the zero-region: stays"),
    tool("one", "o", "Paint the one-region: moves"),
    tool("erase", "e", "Erase painting"),
    tool("move", "g", "Move the one-region"),
    tool("rotate", "r", "Turn the one-region"),
    tool("scale", "s", "Scale the one-region"),
    tool("twist", "t", "Twist the one-region"),
    tool("normal", "n", "Raise or carve along the normals"),
    tool("toward", "a", "Draw the one-region toward a point"),
    ...METHODS.map(
      ({ name, label, key: letter }): Shortcut => ({
        group: "Painting",
        keys: letter,
        label,
        matches: key(letter),
        run: () => {
          bus.invoke("paint.set", { method: name });
          if (!painting()) bus.invoke("tool.activate", "zero");
        },
      }),
    ),
    {
      group: "Painting",
      keys: "V",
      label: "Outlines choose what is visible, or through all depths",
      matches: (event) => painting() && key("v")(event),
      run: () => bus.invoke("paint.set", { visibleOnly: !bus.invoke("paint.settings").visibleOnly }),
    },
    { group: "Painting", keys: "Shift", label: "Remove from the region" },
    { group: "Painting", keys: "Alt", label: "Keep only what the outline holds" },
    { group: "Painting", keys: "Backspace", label: "Take back a polygon's last corner" },
    { group: "Painting", keys: "Right Drag", label: "Orbit while painting" },
    toRegion("Ctrl A", "Everything", ctrl("a"), "all"),
    toRegion("Ctrl I", "Invert", ctrl("i"), "invert"),
    toRegion(".", "Grow", key("."), "grow"),
    toRegion(",", "Shrink", key(","), "shrink"),
    toRegion("Delete", "Clear", key("Delete"), "clear"),
    { group: "Brush", keys: "[", label: "Smaller brush", matches: key("["), run: () => stepBrush(-1) },
    { group: "Brush", keys: "]", label: "Larger brush", matches: key("]"), run: () => stepBrush(1) },
    { group: "Brush", keys: "Alt Wheel", label: "Brush size" },
    {
      group: "Transform",
      keys: "0…9",
      label: "Type the amount",
      matches: (event) =>
        transforming() && editor.state.axis !== null && /^[0-9.-]$/.test(event.key) && key(event.key)(event),
      run: (event) => transformPanel.type(event.key),
    },
    {
      group: "Transform",
      keys: "Enter",
      label: "Apply",
      matches: (event) =>
        editor.pending && key("Enter")(event) && !(event.target instanceof HTMLButtonElement),
      run: () => void bus.invoke("edit.commit"),
    },
    {
      group: "Transform",
      keys: "Esc",
      label: "Cancel, take the image away, leave the animation, leave the tool",
      matches: key("Escape"),
      run: () => {
        if (bus.invoke("tool.cancel") || bus.invoke("image.dismiss")) return;
        if (bus.invoke("animation.current") !== null) {
          bus.invoke("animation.set", null);
          return;
        }
        if (editor.pending) bus.invoke("edit.cancel");
        else bus.invoke("tool.activate", "orbit");
      },
    },
    { group: "Transform", keys: "Double-click", label: "Set the pivot on the surface" },
    {
      group: "History",
      keys: "Ctrl Z",
      label: "Undo",
      matches: ctrl("z"),
      run: () => void bus.invoke("edit.undo"),
    },
    {
      group: "History",
      keys: "Ctrl Y",
      label: "Redo",
      matches: ctrl("y"),
      run: () => void bus.invoke("edit.redo"),
    },
    {
      group: "History",
      keys: "Ctrl Shift Z",
      label: "Redo",
      matches: ctrl("z", true),
      run: () => void bus.invoke("edit.redo"),
    },
    {
      group: "View",
      keys: "F",
      label: "Frame the object",
      matches: key("f"),
      run: () => bus.invoke("view.frame"),
    },
    { group: "View", keys: "H", label: "The first view", matches: key("h"), run: () => viewport.rig.home() },
    ...VIEW_NAMES.map(
      (name, index): Shortcut => ({
        group: "View",
        keys: String(index + 1),
        label: `${name.charAt(0).toUpperCase()}${name.slice(1)} view`,
        matches: key(String(index + 1)),
        run: () => viewport.rig.view(name),
      }),
    ),
    nudge("←", "ArrowLeft", "Turn left", TURN, 0, 1),
    nudge("→", "ArrowRight", "Turn right", -TURN, 0, 1),
    nudge("↑", "ArrowUp", "Turn up", 0, TURN, 1),
    nudge("↓", "ArrowDown", "Turn down", 0, -TURN, 1),
    nudge("+", "+", "Zoom in", 0, 0, 0.9),
    nudge("-", "-", "Zoom out", 0, 0, 1 / 0.9),
    {
      group: "Help",
      keys: "?",
      label: "This sheet",
      matches: key("?"),
      run: () => bus.invoke("shortcuts.show"),
    },
  ];
}
