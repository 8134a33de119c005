import type { SessionDocument } from "../api/types";
import type { TransformEditor } from "../edits/transform";
import { type ToolName, TRANSFORM_KINDS, type TransformKind, type TransformState } from "../event-map";
import type { Bus } from "../session-store";
import { append, h, replaceChildren, setText } from "./dom";
import { createEditOptions } from "./edit-options";
import { icon } from "./icons";
import { createResamplingOptions } from "./resampling-options";
import { createSection } from "./section";
import { createStepsList } from "./steps-list";
import { createKindFields } from "./transform-fields";

export interface TransformPanel {
  element: HTMLElement;
  /** Apply and Cancel: below all sections, so that no length of the panel hides them. */
  foot: HTMLElement;
  /** Puts the cursor into the field that a typed digit belongs to; false where there is none. */
  type(character: string): boolean;
}

const KINDS: Record<TransformKind, { label: string; title: string; hint: string }> = {
  move: { label: "Move", title: "Move (G)", hint: "Drag a handle or type. X, Y, Z hold an axis." },
  rotate: {
    label: "Turn",
    title: "Turn (R)",
    hint: "Drag a ring or type. A double click on the surface sets the pivot.",
  },
  scale: {
    label: "Scale",
    title: "Scale (S)",
    hint: "Drag a handle, the middle one for all axes, or type. The pivot stays.",
  },
  twist: {
    label: "Twist",
    title: "Twist (T)",
    hint: "Drag the ring or type. The surface turns by the angle over the length along the axis.",
  },
  normal: {
    label: "Normal",
    title: "Along normal (N)",
    hint: "The surface rises along its normals, or is carved where the distance is negative.",
  },
  toward: {
    label: "Toward",
    title: "Toward a point (A)",
    hint: "Click the surface, drag the handle or type to set the target; the amount draws the one-region there.",
  },
};

function kindOf(tool: ToolName): TransformKind | null {
  return TRANSFORM_KINDS.find((kind) => kind === tool) ?? null;
}

/** The transform in numbers: the same one that the handles make. */
export function createTransformPanel(
  bus: Bus,
  session: SessionDocument,
  editor: TransformEditor,
): TransformPanel {
  const section = createSection("Transform");
  const commit = (): void => void bus.invoke("edit.commit");
  const numbers = createKindFields(editor, session.diagonal, commit);
  const options = createEditOptions(session, editor);
  const resampling = createResamplingOptions(editor);
  let tool: ToolName = "orbit";
  let shown: TransformState = editor.state;

  const kindButtons = TRANSFORM_KINDS.map((kind) =>
    h(
      "button",
      {
        type: "button",
        class: "kind-button",
        title: KINDS[kind].title,
        aria: { pressed: "false" },
        data: { kind },
        onclick: () => bus.invoke("tool.activate", kind),
      },
      icon(kind),
      KINDS[kind].label,
    ),
  );
  const kinds = h(
    "div",
    { class: "kinds", role: "group", aria: { label: "Kind of transform" } },
    ...kindButtons,
  );
  const pivotButton = h(
    "button",
    {
      type: "button",
      class: "button quiet",
      aria: { pressed: "false" },
      onclick: () => editor.setPivotEditing(!shown.pivotEditing),
    },
    icon("pivot"),
    "Drag pivot",
  );
  const axisButtons = (["x", "y", "z"] as const).map((axis) =>
    h(
      "button",
      {
        type: "button",
        class: `axis-button axis-${axis}`,
        aria: { pressed: "false", label: `Hold ${axis.toUpperCase()}` },
        onclick: () => editor.setAxis(shown.axis === axis ? null : axis),
      },
      axis.toUpperCase(),
    ),
  );
  const axes = h(
    "div",
    { class: "axis-buttons", role: "group", aria: { label: "Axis constraint" } },
    ...axisButtons,
  );
  const apply = h(
    "button",
    { type: "button", class: "button primary", onclick: commit },
    icon("check"),
    "Apply",
  );
  const cancel = h(
    "button",
    { type: "button", class: "button", onclick: () => bus.invoke("edit.cancel") },
    "Cancel",
  );
  // Stays in sight however long the panel is.
  const ends = h("div", { class: "button-row panel-foot", hidden: true }, apply, cancel);
  const steps = createStepsList(editor, (kind) => bus.invoke("tool.activate", kind));
  const summary = h("p", { class: "hint", aria: { live: "polite" } });
  const fields = h("div", { class: "transform-fields" });
  append(section.body, [kinds, fields, resampling.main, summary, resampling.numbers, options.detail]);

  const layOut = (): void => {
    const kind = kindOf(tool);
    options.detail.hidden = kind === null;
    for (const button of kindButtons)
      button.setAttribute("aria-pressed", String(button.dataset["kind"] === kind));
    if (!kind) replaceChildren(fields);
    else {
      const handles =
        kind === "normal"
          ? null
          : h("div", { class: "field-row" }, axes, kind === "toward" ? null : pivotButton);
      replaceChildren(fields, ...numbers[kind].elements, handles, options.main, steps.element);
    }
    fields.hidden = kind === null;
    ends.hidden = kind === null;
  };
  const show = (state: TransformState): void => {
    shown = state;
    const kind = kindOf(tool);
    if (kind) {
      numbers[kind].show(state);
      for (const input of numbers[kind].inputs) input.disabled = state.obstacle !== null;
    }
    options.show(state);
    resampling.show(kind && state);
    steps.show(state);
    const ready = state.obstacle === null && editor.pending;
    apply.disabled = !ready;
    cancel.disabled = !ready;
    pivotButton.setAttribute("aria-pressed", String(state.pivotEditing));
    for (const [index, button] of axisButtons.entries())
      button.setAttribute("aria-pressed", String(state.axis === "xyz"[index]));
    const hint = kind ? KINDS[kind].hint : "What lies between the regions follows smoothly.";
    setText(summary, state.obstacle ?? (ready ? editor.description : hint));
    summary.classList.toggle("obstacle", state.obstacle !== null);
  };
  bus.on("transform.changed", show);
  bus.on("session.changed", () => show(editor.state));
  bus.on("tool.changed", (name) => {
    tool = name;
    layOut();
    show(editor.state);
    // The numbers of the tool come into sight where the panel is longer than the window.
    if (kindOf(tool)) fields.scrollIntoView({ block: "nearest" });
  });
  layOut();
  show(editor.state);
  return {
    element: section.element,
    foot: ends,
    type(character) {
      const kind = kindOf(tool);
      if (!kind || shown.obstacle) return false;
      const { input } = numbers[kind].digits(shown);
      input.focus();
      input.value = character;
      input.dispatchEvent(new Event("input"));
      return true;
    },
  };
}
