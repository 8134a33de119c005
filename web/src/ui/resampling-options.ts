import {
  numberFault,
  type ResamplingChoice,
  type ResamplingFault,
  type ResamplingNumber,
} from "../edits/resampling";
import type { TransformEditor } from "../edits/transform";
import type { TransformState } from "../event-map";
import { h, setText } from "./dom";
import { checkField, type NumberField, numberField } from "./fields";
import { icon } from "./icons";

/** A number with its faults told below it. */
interface GuardedField {
  element: HTMLElement;
  show(choice: ResamplingChoice, fault: ResamplingFault | null): void;
}

function guardedField(
  editor: TransformEditor,
  name: ResamplingNumber,
  label: string,
  unit: string,
  title: string,
): GuardedField {
  const fault = h("p", { class: "hint obstacle", hidden: true, aria: { live: "polite" } });
  const tell = (text: string | null): void => {
    setText(fault, text ?? "");
    fault.hidden = text === null;
    if (text !== null) field.input.setAttribute("aria-invalid", "true");
  };
  const field: NumberField = numberField(label, editor.state.resampling[name], {
    unit,
    onChange: (value) => {
      const wrong = numberFault(name, value);
      tell(wrong);
      if (!wrong) editor.setResampling({ [name]: value });
    },
  });
  field.input.title = title;
  const show: GuardedField["show"] = (choice, refused) => {
    // What is being typed stays; what is left shows what is sent.
    if (document.activeElement !== field.input) {
      field.set(choice[name]);
      field.input.title = title;
    } else if (numberFault(name, field.value)) return;
    tell(refused?.about === name ? refused.text : null);
  };
  field.input.addEventListener("blur", () => show(editor.state.resampling, editor.state.resamplingFault));
  return { element: h("div", { class: "guarded" }, field.element, fault), show };
}

export interface ResamplingOptions {
  /** The switch, and what of it was refused. */
  main: HTMLElement;
  /** The numbers; folded until asked for. */
  numbers: HTMLElement;
  /** Null: there is no transform to resample after. */
  show(state: TransformState | null): void;
}

/** Whether an edit inserts samples where it stretches the surface, and, folded away, where exactly. */
export function createResamplingOptions(editor: TransformEditor): ResamplingOptions {
  const on = checkField("Resample", editor.state.resampling.on, (checked) =>
    editor.setResampling({ on: checked }),
  );
  const note = "Inserts samples where the surface is stretched.";
  on.input.title = note;
  const bound = guardedField(
    editor,
    "bound",
    "Bound",
    "×",
    "A sample is split where its cell has grown to this many of its own spacings",
  );
  const least = guardedField(
    editor,
    "minSpacing",
    "Minimum spacing",
    "units",
    "Cells shorter than this are not split; 0 for none",
  );
  const shear = checkField("Shear-aware", editor.state.resampling.shearAware, (shearAware) =>
    editor.setResampling({ shearAware }),
  );
  shear.input.title = "A stretch counts less where the surface is squeezed across it: shear splits less";
  const clean = checkField("Clean up afterwards", editor.state.resampling.cleanUp, (cleanUp) =>
    editor.setResampling({ cleanUp }),
  );
  clean.input.title = "Of two samples that were pushed together, one goes when the edit is applied";
  const distance = guardedField(
    editor,
    "distance",
    "Closer than",
    "spacings",
    "One of two samples goes while they are closer than this",
  );
  const fault = h("p", { class: "hint obstacle", hidden: true, aria: { live: "polite" } });
  const aside = h("span", { class: "section-aside" });
  const main = h("div", { class: "guarded" }, on.element, fault);
  const numbers = h(
    "details",
    { class: "sub", data: { part: "resampling" } },
    h("summary", {}, h("span", { class: "sub-title" }, "Resampling"), aside, icon("chevron")),
    h(
      "div",
      { class: "shape-form" },
      h("div", { class: "field-row" }, bound.element, least.element),
      shear.element,
      clean.element,
      distance.element,
      h("p", { class: "hint" }, note),
    ),
  );
  let told: ResamplingFault | null = null;
  return {
    main,
    numbers,
    show(state) {
      main.hidden = state === null;
      numbers.hidden = !state?.resampling.on;
      if (!state) return;
      const { resampling, resamplingFault } = state;
      on.input.checked = resampling.on;
      shear.input.checked = resampling.shearAware;
      clean.input.checked = resampling.cleanUp;
      distance.element.hidden = !resampling.cleanUp;
      for (const field of [bound, least, distance]) field.show(resampling, resamplingFault);
      const whole = resamplingFault?.about === null ? resamplingFault.text : null;
      setText(fault, whole ?? "");
      fault.hidden = whole === null;
      setText(aside, `bound ${resampling.bound}×${resampling.cleanUp ? ", cleans up" : ""}`);
      // What was refused comes into sight.
      if (resamplingFault && resamplingFault !== told) numbers.open = true;
      told = resamplingFault;
    },
  };
}
