import type { Blend, SessionDocument } from "../api/types";
import { bandName, levelName } from "../edits/scales";
import type { TransformEditor } from "../edits/transform";
import type { TransformState } from "../event-map";
import { h, setText } from "./dom";
import { rangeField, selectField } from "./fields";
import { icon } from "./icons";

const BLENDS: readonly (readonly [Blend, string])[] = [
  ["quartic", "Quartic"],
  ["cubic", "Cubic"],
  ["quintic", "Quintic"],
  ["cosine", "Cosine"],
];
const GREATEST_GAIN = 2;

export interface EditOptions {
  /** Which level moves, and how the movement fades. */
  main: HTMLElement;
  /** The detail of each band; folded until asked for. */
  detail: HTMLElement;
  show(state: TransformState): void;
}

/** What every kind of transform has beside its numbers. */
export function createEditOptions(session: SessionDocument, editor: TransformEditor): EditOptions {
  const start = editor.state;
  const finest = session.levels.length - 1;
  const level = selectField(
    "Edited level",
    session.levels.map((each) => [
      String(each.level),
      each.level === finest ? "Full surface" : levelName(each, session.diagonal),
    ]),
    String(start.level),
    (value) => editor.setLevel(Number(value)),
  );
  level.select.title =
    "The level that moves; everything finer than its scale is carried along as detail. The full surface carries none.";
  const blend = selectField("Blend", BLENDS, start.blend, (value) => editor.setBlend(value));
  blend.select.title =
    "How the movement fades between the regions. Quartic stays near the one-region, cubic and cosine are even, quintic is the smoothest at both ends.";
  const bands = start.gains.map((_, band) =>
    rangeField(
      bandName(session.levels, band, session.diagonal),
      { min: 0, max: GREATEST_GAIN, step: 0.05 },
      1,
      (gain) => `${Number(gain.toFixed(2))}×`,
      (gain) => editor.setGain(band, gain),
    ),
  );
  const aside = h("span", { class: "section-aside" });
  const detail = h(
    "details",
    { class: "sub", data: { part: "detail" } },
    h("summary", {}, h("span", { class: "sub-title" }, "Detail"), aside, icon("chevron")),
    h(
      "div",
      { class: "shape-form" },
      ...bands.map((band) => band.element),
      h(
        "p",
        { class: "hint" },
        "Relief of each size in the one-region, in % of the diagonal: 0× smooths it away.",
      ),
    ),
  );
  return {
    main: h("div", { class: "field-row" }, level.element, blend.element),
    detail,
    show(state) {
      level.select.value = String(state.level);
      blend.select.value = state.blend;
      for (const [band, field] of bands.entries()) {
        if (document.activeElement !== field.input || state.gains[band] === 1)
          field.set(state.gains[band] ?? 1);
        // A band below the level that moves is not rebuilt.
        field.input.disabled = state.obstacle !== null || band < state.level;
      }
      const changed = state.gains.some((gain, band) => band >= state.level && gain !== 1);
      setText(aside, changed ? "changed" : "as it is");
    },
  };
}
