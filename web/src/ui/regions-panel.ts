import type { RegionName, SessionDocument, Shape, ShapeOperation } from "../api/types";
import type { PaintMode } from "../edits/paint-settings";
import type { RegionCommand, RegionEditor } from "../edits/regions";
import type { Bus, SessionStore } from "../session-store";
import { append, h, replaceChildren, setText } from "./dom";
import { numberField, selectField, vectorField } from "./fields";
import { formatCount } from "./format";
import { icon } from "./icons";
import { createPaintOptions } from "./paint-options";
import { createSection } from "./section";

const NAMES: Record<RegionName, string> = { zero: "Zero-region", one: "One-region" };
const MEANINGS: Record<RegionName, string> = { zero: "stays", one: "moves" };

type ShapeType = "sphere" | "box" | "half_space" | "all";
type Mode = PaintMode | "set";

/**
 * The painting: what each region holds and what is done to it as a whole, what the chosen method asks for, and shapes by
 * numbers for those who paint without a mouse. `reach`: how far regions grow and shrink; `forms`: further sources of shapes.
 */
export function createRegionsPanel(
  bus: Bus,
  store: SessionStore,
  regions: RegionEditor,
  radius: number,
  reach: { value: number },
  ...forms: HTMLElement[]
): HTMLElement {
  const section = createSection("Regions");
  const rows = (["zero", "one"] as const).map((region) => regionRow(bus, store, regions, region, reach));
  append(section.body, [
    h("div", { class: "region-rows" }, ...rows),
    createPaintOptions(bus, store, radius),
    shapeForm(store, regions),
    ...forms,
  ]);
  return section.element;
}

const COMMANDS: readonly (readonly [RegionCommand, string, string])[] = [
  ["all", "All", "Every sample joins"],
  ["invert", "Invert", "Members leave, all others join"],
  ["grow", "Grow", "Samples within the distance join"],
  ["shrink", "Shrink", "Members within the distance of its border leave"],
];

function regionRow(
  bus: Bus,
  store: SessionStore,
  regions: RegionEditor,
  region: RegionName,
  reach: { value: number },
): HTMLElement {
  const count = h("span", { class: "region-count" });
  const clear = h(
    "button",
    {
      type: "button",
      class: "icon-button small",
      title: `Clear the ${region}-region`,
      aria: { label: `Clear the ${region}-region` },
      onclick: () => void regions.command(region, "clear", 0),
    },
    icon("trash"),
  );
  const distance = numberField("Grow and shrink by", reach.value, {
    unit: "units",
    onChange: (value) => {
      if (value > 0) reach.value = value;
    },
  });
  const buttons = COMMANDS.map(([command, label, title]) =>
    h(
      "button",
      {
        type: "button",
        class: "button quiet",
        title,
        data: { command },
        onclick: () => {
          const byDistance = command === "grow" || command === "shrink";
          if (byDistance && !(distance.value > 0)) distance.input.focus();
          else void regions.command(region, command, distance.value);
        },
      },
      label,
    ),
  );
  const drawer = h(
    "div",
    { class: "region-drawer", hidden: true, id: `region-${region}-commands` },
    h("div", { class: "command-grid" }, ...buttons),
    distance.element,
  );
  const more = h(
    "button",
    {
      type: "button",
      class: "icon-button small",
      title: "All, invert, grow, shrink",
      aria: { label: `More for the ${region}-region`, expanded: "false", controls: drawer.id },
      onclick: () => {
        drawer.hidden = !drawer.hidden;
        more.setAttribute("aria-expanded", String(!drawer.hidden));
        // The other region's drawer may have set it.
        if (!drawer.hidden) distance.set(reach.value);
      },
    },
    icon("more"),
  );
  const show = (document: SessionDocument): void => {
    const { samples } = document.regions[region];
    setText(count, samples === 0 ? "not painted" : formatCount(samples));
    count.title = samples === 0 ? "" : `${formatCount(samples)} samples`;
    clear.disabled = samples === 0;
    for (const button of buttons)
      button.disabled = samples === 0 && ["grow", "shrink"].includes(button.dataset["command"] ?? "");
  };
  bus.on("session.changed", show);
  show(store.document);
  return h(
    "div",
    { class: `region-row ${region}`, data: { region } },
    h("span", { class: "swatch", aria: { hidden: "true" } }),
    h("span", { class: "region-name" }, NAMES[region], h("small", {}, MEANINGS[region])),
    count,
    more,
    clear,
    drawer,
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
      data: { form: "numbers" },
      onsubmit: (event) => {
        event.preventDefault();
        const operation: ShapeOperation = { mode, shape: shapeOf[type]() };
        if (mode === "add" || mode === "set") operation.steal = true;
        void regions.paint(region, [operation]);
      },
    },
    h("div", { class: "field-row" }, regionSelect.element, modeSelect.element),
    typeSelect.element,
    fields,
    apply,
  );
  return h(
    "details",
    { class: "sub" },
    h("summary", {}, h("span", { class: "sub-title" }, "Shape by numbers"), icon("chevron")),
    form,
  );
}
