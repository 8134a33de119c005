import type { RegionName, RegionOperation, SessionDocument, Shape } from "../api/types";
import type { RegionEditor } from "../edits/regions";
import type { Bus, SessionStore } from "../session-store";
import { append, h, replaceChildren, setText } from "./dom";
import { numberField, rangeField, selectField, vectorField } from "./fields";
import { formatCount, formatLength } from "./format";
import { icon } from "./icons";
import { createSection } from "./section";

const NAMES: Record<RegionName, string> = { zero: "Zero-region", one: "One-region" };
const MEANINGS: Record<RegionName, string> = { zero: "stays", one: "moves" };

type ShapeType = "sphere" | "box" | "half_space" | "all";
type Mode = RegionOperation["mode"];

/** The painting: what each region holds, the brush's size, and shapes by numbers for those who paint without a mouse. */
export function createRegionsPanel(
  bus: Bus,
  store: SessionStore,
  regions: RegionEditor,
  radius: number,
): HTMLElement {
  const section = createSection("Regions");
  const rows = (["zero", "one"] as const).map((region) => regionRow(bus, store, regions, region));
  const diagonal = store.document.diagonal;
  // The slider runs over the logarithm: each step changes the radius by the same part.
  const toSlider = (value: number): number => Math.log(value / diagonal);
  const brush = rangeField(
    "Brush radius",
    { min: Math.log(5e-4), max: Math.log(0.5), step: 0.01 },
    toSlider(radius),
    (value) => formatLength(diagonal * Math.exp(value)),
    (value) => bus.invoke("brush.set", diagonal * Math.exp(value)),
  );
  bus.on("brush.radius", (value) => brush.set(toSlider(value)));
  append(section.body, [
    h("div", { class: "region-rows" }, ...rows),
    brush.element,
    h(
      "p",
      { class: "hint" },
      "Drag on the surface to paint, Shift erases, ",
      h("kbd", {}, "["),
      " ",
      h("kbd", {}, "]"),
      " size.",
    ),
    shapeForm(store, regions),
  ]);
  return section.element;
}

function regionRow(bus: Bus, store: SessionStore, regions: RegionEditor, region: RegionName): HTMLElement {
  const count = h("span", { class: "region-count" });
  const clear = h(
    "button",
    {
      type: "button",
      class: "icon-button small",
      title: `Clear the ${region}-region`,
      aria: { label: `Clear the ${region}-region` },
      onclick: () => void regions.clear(region),
    },
    icon("trash"),
  );
  const show = (document: SessionDocument): void => {
    const { samples } = document.regions[region];
    setText(count, samples === 0 ? "not painted" : `${formatCount(samples)} samples`);
    clear.disabled = samples === 0;
  };
  bus.on("session.changed", show);
  show(store.document);
  return h(
    "div",
    { class: `region-row ${region}`, data: { region } },
    h("span", { class: "swatch", aria: { hidden: "true" } }),
    h("span", { class: "region-name" }, NAMES[region], h("small", {}, MEANINGS[region])),
    count,
    clear,
  );
}

/** A region operation by numbers. */
function shapeForm(store: SessionStore, regions: RegionEditor): HTMLElement {
  const { bounds, diagonal } = store.document;
  const middle = [0, 1, 2].map((axis) => ((bounds.min[axis] ?? 0) + (bounds.max[axis] ?? 0)) / 2) as [
    number,
    number,
    number,
  ];
  let region: RegionName = "zero";
  let mode: Mode = "add";
  let type: ShapeType = "sphere";
  const center = vectorField("Centre", middle);
  const radius = numberField("Radius", diagonal * 0.1);
  const low = vectorField("Lower corner", bounds.min);
  const high = vectorField("Upper corner", bounds.max);
  const point = vectorField("Point on the plane", middle);
  const normal = vectorField("Normal, towards the region", [0, 1, 0]);
  const fields = h("div", { class: "shape-fields" });
  const byType: Record<ShapeType, HTMLElement[]> = {
    sphere: [center.element, radius.element],
    box: [low.element, high.element],
    half_space: [point.element, normal.element],
    all: [],
  };
  const shapeOf: Record<ShapeType, () => Shape> = {
    sphere: () => ({ type: "sphere", center: center.value, radius: radius.value }),
    box: () => ({ type: "box", min: low.value, max: high.value }),
    half_space: () => ({ type: "half_space", point: point.value, normal: normal.value }),
    all: () => ({ type: "all" }),
  };
  const refresh = (): void => replaceChildren(fields, ...byType[type]);
  const regionSelect = selectField(
    "Region",
    [
      ["zero", "Zero (stays)"],
      ["one", "One (moves)"],
    ],
    region,
    (value) => {
      region = value;
    },
  );
  const modeSelect = selectField(
    "Do",
    [
      ["add", "Add"],
      ["remove", "Remove"],
      ["intersect", "Keep only"],
      ["set", "Replace by"],
    ],
    mode,
    (value) => {
      mode = value;
    },
  );
  const typeSelect = selectField(
    "Shape",
    [
      ["sphere", "Sphere"],
      ["box", "Box"],
      ["half_space", "Half-space"],
      ["all", "Everything"],
    ],
    type,
    (value) => {
      type = value;
      refresh();
    },
  );
  refresh();
  const apply = h("button", { type: "submit", class: "button" }, "Apply to region");
  const form = h(
    "form",
    {
      class: "shape-form",
      onsubmit: (event) => {
        event.preventDefault();
        const operation: RegionOperation = { mode, shape: shapeOf[type]() };
        if (mode === "add" || mode === "set") operation.steal = true;
        void regions.paint(region, [operation]);
      },
    },
    h("div", { class: "field-row" }, regionSelect.element, modeSelect.element),
    typeSelect.element,
    fields,
    apply,
  );
  return h("details", { class: "sub" }, h("summary", {}, "Shape by numbers", icon("chevron")), form);
}
