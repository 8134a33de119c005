import type { PaintSettings } from "../edits/paint-settings";
import { PAINT_TARGETS } from "../event-map";
import type { Bus, SessionStore } from "../session-store";
import { h, replaceChildren } from "./dom";
import { checkField, rangeField } from "./fields";
import { formatLength } from "./format";
import { METHODS } from "./paint-bar";

/** Of the diagonal: a flood's radius where one is first asked for. */
const FLOOD_PART = 0.1;
const LEAST_PART = 5e-4;
const GREATEST_PART = 0.5;

/** A length by a slider over its logarithm: each step changes it by the same part. */
export function lengthSlider(
  label: string,
  value: number,
  diagonal: number,
  onChange: (value: number) => void,
): { element: HTMLElement; input: HTMLInputElement; set(value: number): void } {
  const toSlider = (length: number): number => Math.log(length / diagonal);
  const slider = rangeField(
    label,
    { min: Math.log(LEAST_PART), max: Math.log(GREATEST_PART), step: 0.01 },
    toSlider(value),
    (place) => formatLength(diagonal * Math.exp(place)),
    (place) => onChange(diagonal * Math.exp(place)),
  );
  return { element: slider.element, input: slider.input, set: (length) => slider.set(toSlider(length)) };
}

/** What the chosen method asks for beside the pointer: a size, the bounds of a flood, or a word on how it works. */
export function createPaintOptions(bus: Bus, store: SessionStore, radius: number): HTMLElement {
  const { diagonal } = store.document;
  const brush = lengthSlider("Brush radius", radius, diagonal, (value) => bus.invoke("brush.set", value));
  bus.on("brush.radius", (value) => brush.set(value));
  const set = (change: Partial<PaintSettings>): void => bus.invoke("paint.set", change);
  const start = bus.invoke("paint.settings");
  let angle = start.floodAngle ?? 20;
  let reach = start.floodRadius ?? FLOOD_PART * diagonal;
  const byAngle = checkField("Stop at edges", start.floodAngle !== null, (on) =>
    set({ floodAngle: on ? angle : null }),
  );
  const angleSlider = rangeField(
    "Greatest angle between neighbours",
    { min: 1, max: 90, step: 1 },
    angle,
    (value) => `${value}°`,
    (value) => {
      angle = value;
      set({ floodAngle: value });
    },
  );
  const byRadius = checkField("Stay near the click", start.floodRadius !== null, (on) =>
    set({ floodRadius: on ? reach : null }),
  );
  const radiusSlider = lengthSlider("Within", reach, diagonal, (value) => {
    reach = value;
    set({ floodRadius: value });
  });
  const stops = checkField("Stop at the other region", start.floodStops, (on) => set({ floodStops: on }));
  const hint = h("p", { class: "hint" });
  const element = h("div", { class: "paint-options" });
  let painting = false;
  const refresh = (settings: PaintSettings): void => {
    if (!painting) {
      replaceChildren(
        element,
        h(
          "p",
          { class: "hint" },
          "Press ",
          h("kbd", {}, "Z"),
          " or ",
          h("kbd", {}, "O"),
          " and drag to paint.",
        ),
      );
      return;
    }
    const { method, floodAngle, floodRadius } = settings;
    byAngle.input.checked = floodAngle !== null;
    byRadius.input.checked = floodRadius !== null;
    const text = METHODS.find(({ name }) => name === method)?.hint ?? "";
    const keys =
      method === "flood" ? "" : method === "brush" ? " Shift removes." : " Shift removes, Alt keeps only.";
    const size: (Node | string)[] = [" ", h("kbd", {}, "["), " ", h("kbd", {}, "]"), " size."];
    const sized = method === "brush" || method === "line";
    replaceChildren(hint, text, keys, ...(sized ? size : []));
    // A slider that is being dragged stays where it is.
    const wanted =
      method === "flood"
        ? [
            byAngle.element,
            ...(floodAngle === null ? [] : [angleSlider.element]),
            byRadius.element,
            ...(floodRadius === null ? [] : [radiusSlider.element]),
            stops.element,
            hint,
          ]
        : sized
          ? [brush.element, hint]
          : [hint];
    const shown = [...element.children];
    if (wanted.length !== shown.length || wanted.some((child, i) => child !== shown[i]))
      replaceChildren(element, ...wanted);
  };
  bus.on("paint.changed", refresh);
  bus.on("tool.changed", (tool) => {
    painting = PAINT_TARGETS.some((target) => target === tool);
    element.hidden = !painting && tool !== "orbit";
    refresh(bus.invoke("paint.settings"));
  });
  refresh(start);
  return element;
}
