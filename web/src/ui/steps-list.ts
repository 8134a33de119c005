import { describeDeformation, isIdentity } from "../edits/deformation";
import { MAX_STEPS, maySwap } from "../edits/steps";
import type { TransformEditor } from "../edits/transform";
import type { TransformKind, TransformState } from "../event-map";
import { h, replaceChildren } from "./dom";
import { icon } from "./icons";

export interface StepsList {
  element: HTMLElement;
  show(state: TransformState): void;
}

/** The steps of a composition: one is current, the others wait in their order. Shown once there are two. */
export function createStepsList(editor: TransformEditor, activate: (kind: TransformKind) => void): StepsList {
  const list = h("ol", { class: "steps", aria: { label: "Steps, in order" } });
  const add = h(
    "button",
    {
      type: "button",
      class: "button quiet wide",
      title: "Keep this step and go on with another; all are recorded as one edit",
      onclick: () => editor.addStep(),
    },
    icon("plus"),
    "Add step",
  );
  const small = (
    name: "up" | "chevron" | "close",
    label: string,
    disabled: boolean,
    run: () => void,
  ): HTMLElement =>
    h(
      "button",
      {
        type: "button",
        class: "icon-button small",
        disabled,
        title: label,
        aria: { label },
        onclick: run,
      },
      icon(name),
    );
  const show = (state: TransformState): void => {
    const { steps, step: current } = state;
    const ready = state.deformation !== null && !isIdentity(state.deformation);
    add.disabled = state.obstacle !== null || !ready || steps.length >= MAX_STEPS;
    list.hidden = steps.length < 2;
    if (list.hidden) {
      list.textContent = "";
      return;
    }
    const others = {
      others: steps.filter((_, i) => i !== current).filter((step) => step !== null),
      at: current,
    };
    const swaps = (first: number): boolean => maySwap(others, state.deformation, first);
    const row = (step: (typeof steps)[number], place: number): HTMLElement => {
      const name = `Step ${place + 1}`;
      const choose = h(
        "button",
        {
          type: "button",
          class: "step-choose",
          onclick: () => {
            const kind = editor.chooseStep(place);
            if (kind) activate(kind);
          },
        },
        h("span", { class: "step-number" }, String(place + 1)),
        h("span", { class: "step-text" }, step ? describeDeformation(step) : "New step"),
      );
      if (place === current) choose.setAttribute("aria-current", "step");
      return h(
        "li",
        { class: `step ${place === current ? "current" : ""}` },
        choose,
        small("up", `${name}: earlier`, !swaps(place - 1), () => editor.swapSteps(place - 1)),
        small("chevron", `${name}: later`, !swaps(place), () => editor.swapSteps(place)),
        small("close", `${name}: remove`, false, () => {
          const kind = editor.removeStep(place);
          if (kind) activate(kind);
        }),
      );
    };
    // The keyboard stays at its button, though the rows are new.
    const focused = [...list.querySelectorAll("button")].indexOf(document.activeElement as HTMLButtonElement);
    replaceChildren(list, ...steps.map(row));
    if (focused >= 0) list.querySelectorAll("button")[focused]?.focus();
  };
  return { element: h("div", { class: "steps-holder" }, list, add), show };
}
