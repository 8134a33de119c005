import type { SessionDocument } from "../api/types";
import { describeDeformation, rotation, translation } from "../edits/deformation";
import { levelName } from "../edits/scales";
import type { TransformEditor } from "../edits/transform";
import type { ToolName, TransformState } from "../event-map";
import type { Bus } from "../session-store";
import { append, h, replaceChildren, setText } from "./dom";
import { numberField, selectField, vectorField } from "./fields";
import { icon } from "./icons";
import { createSection } from "./section";

const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] } as const;

export interface TransformPanel {
  element: HTMLElement;
  /** Puts the cursor into the field that a typed digit belongs to; false where there is none. */
  type(character: string): boolean;
}

/** The transform in numbers: the same one that the handles make. */
export function createTransformPanel(
  bus: Bus,
  session: SessionDocument,
  editor: TransformEditor,
): TransformPanel {
  const section = createSection("Transform");
  const commit = (): void => void bus.invoke("edit.commit");
  let tool: ToolName = "orbit";
  let shown: TransformState = editor.state;

  const vector = vectorField("Move by", [0, 0, 0], {
    onChange: () => editor.set(translation(vector.value)),
    onEnter: commit,
  });
  const turn = (): void => editor.set(rotation(pivot.value, direction.value, angle.value));
  const angle = numberField("Angle", 0, { unit: "°", onChange: turn, onEnter: commit });
  const direction = vectorField("Axis", [0, 1, 0], { onChange: turn, onEnter: commit });
  const pivot = vectorField("Pivot", [0, 0, 0], {
    onChange: () => {
      if (pivot.value.every(Number.isFinite)) editor.setPivot(pivot.value);
    },
    onEnter: commit,
  });
  const pivotButton = h(
    "button",
    {
      type: "button",
      class: "button quiet",
      aria: { pressed: "false" },
      onclick: () => editor.setPivotEditing(!shown.pivotEditing),
    },
    icon("pivot"),
    "Drag the pivot",
  );
  const axisButtons = (["x", "y", "z"] as const).map((axis) =>
    h(
      "button",
      {
        type: "button",
        class: `axis-button axis-${axis}`,
        aria: { pressed: "false", label: `Only along ${axis.toUpperCase()}` },
        onclick: () => chooseAxis(axis),
      },
      axis.toUpperCase(),
    ),
  );
  const chooseAxis = (axis: "x" | "y" | "z"): void => {
    editor.setAxis(shown.axis === axis ? null : axis);
    if (tool === "rotate" && !editor.pending) direction.set(AXES[axis]);
  };
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
  const finest = session.levels.length - 1;
  const level = selectField(
    "Edited level",
    session.levels.map((each) => [
      String(each.level),
      each.level === finest ? "Full surface, no detail carried" : levelName(each, session.diagonal),
    ]),
    String(shown.level),
    (value) => editor.setLevel(Number(value)),
  );
  level.select.title = "The level that moves; everything finer than its scale is carried along as detail.";
  const summary = h("p", { class: "hint", aria: { live: "polite" } });
  const fields = h("div", { class: "transform-fields" });
  const start = h(
    "div",
    { class: "button-row" },
    h(
      "button",
      { type: "button", class: "button", onclick: () => bus.invoke("tool.activate", "move") },
      icon("move"),
      "Move",
    ),
    h(
      "button",
      { type: "button", class: "button", onclick: () => bus.invoke("tool.activate", "rotate") },
      icon("rotate"),
      "Rotate",
    ),
  );
  append(section.body, [fields, summary]);

  const layOut = (): void => {
    const axes = h(
      "div",
      { class: "axis-buttons", role: "group", aria: { label: "Axis constraint" } },
      ...axisButtons,
    );
    const ends = h("div", { class: "button-row" }, apply, cancel);
    if (tool === "move") replaceChildren(fields, vector.element, axes, pivotButton, level.element, ends);
    else if (tool === "rotate")
      replaceChildren(
        fields,
        angle.element,
        direction.element,
        axes,
        pivot.element,
        pivotButton,
        level.element,
        ends,
      );
    else replaceChildren(fields, start);
  };
  const show = (state: TransformState): void => {
    shown = state;
    const { deformation } = state;
    if (deformation?.type === "translation") vector.set(deformation.vector);
    if (deformation?.type === "rotation") {
      angle.set(deformation.angle_deg);
      direction.set(deformation.axis.direction);
    }
    if (!deformation) {
      vector.set([0, 0, 0]);
      angle.set(0);
    }
    pivot.set(state.pivot);
    level.select.value = String(state.level);
    const ready = state.obstacle === null && editor.pending;
    apply.disabled = !ready;
    cancel.disabled = !ready;
    pivotButton.setAttribute("aria-pressed", String(state.pivotEditing));
    for (const [index, button] of axisButtons.entries())
      button.setAttribute("aria-pressed", String(state.axis === "xyz"[index]));
    for (const field of [...vector.fields, ...direction.fields, ...pivot.fields, angle])
      field.input.disabled = state.obstacle !== null;
    setText(
      summary,
      state.obstacle ?? (ready && deformation ? describeDeformation(deformation) : hintOf(tool)),
    );
    summary.classList.toggle("obstacle", state.obstacle !== null);
  };
  bus.on("transform.changed", show);
  bus.on("session.changed", () => show(editor.state));
  bus.on("tool.changed", (name) => {
    tool = name;
    layOut();
    show(editor.state);
  });
  layOut();
  show(editor.state);
  return {
    element: section.element,
    type(character) {
      if (tool !== "move" && tool !== "rotate") return false;
      const index = shown.axis ? "xyz".indexOf(shown.axis) : 0;
      const field = tool === "rotate" ? angle : vector.fields[index as 0 | 1 | 2];
      if (shown.obstacle) return false;
      if (tool === "rotate" && shown.axis) direction.set(AXES[shown.axis]);
      field.input.focus();
      field.input.value = character;
      field.input.dispatchEvent(new Event("input"));
      return true;
    },
  };
}

function hintOf(tool: ToolName): string {
  if (tool === "move") return "Drag a handle or type. X, Y, Z hold an axis.";
  if (tool === "rotate") return "Drag a ring or type. A double click on the surface sets the pivot.";
  return "What lies between the regions follows smoothly.";
}
