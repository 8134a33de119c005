import type { Vec3 } from "../math/vec3";
import { freshId, h } from "./dom";

/** A number typed by a person; `value` is NaN while the text is none. */
export interface NumberField {
  element: HTMLElement;
  input: HTMLInputElement;
  value: number;
  /** `text`: how the number shows, where that is not by six digits. */
  set(value: number, text?: string): void;
}

export interface NumberOptions {
  step?: string;
  unit?: string;
  onChange?: (value: number) => void;
  onEnter?: () => void;
}

function roundForShow(value: number): string {
  return Number.isFinite(value) ? String(Number(value.toPrecision(6))) : "";
}

export function numberField(label: string, value: number, options: NumberOptions = {}): NumberField {
  const id = freshId();
  const input = h("input", {
    id,
    type: "text",
    inputMode: "decimal",
    autocomplete: "off",
    spellcheck: false,
    class: "number",
    value: roundForShow(value),
  });
  let current = value;
  input.addEventListener("input", () => {
    const text = input.value.trim().replace(",", ".");
    current = text === "" ? Number.NaN : Number(text);
    input.setAttribute("aria-invalid", String(!Number.isFinite(current)));
    if (Number.isFinite(current)) options.onChange?.(current);
  });
  input.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault();
    event.stopPropagation();
    options.onEnter?.();
  });
  const unit = options.unit ? h("span", { class: "unit" }, options.unit) : null;
  const element = h(
    "div",
    { class: "field" },
    h("label", { htmlFor: id }, label),
    h("div", { class: "input-box" }, input, unit),
  );
  return {
    element,
    input,
    get value() {
      return current;
    },
    set(next: number, text = roundForShow(next)) {
      current = next;
      input.title = text === String(next) ? "" : String(next);
      // The hand that types is not interrupted: "30." stays as it is while it means 30.
      const typing = document.activeElement === input && Number(input.value.replace(",", ".")) === next;
      if (!typing) input.value = text;
      input.setAttribute("aria-invalid", "false");
    },
  };
}

/** A line of text; what it means is the caller's. */
export function textField(
  label: string,
  value: string,
  unit: string,
): { element: HTMLElement; input: HTMLInputElement } {
  const id = freshId();
  const input = h("input", {
    id,
    type: "text",
    autocomplete: "off",
    spellcheck: false,
    class: "number",
    value,
  });
  const element = h(
    "div",
    { class: "field" },
    h("label", { htmlFor: id }, label),
    h("div", { class: "input-box" }, input, h("span", { class: "unit" }, unit)),
  );
  return { element, input };
}

/** Three numbers in a row, under one name. */
export interface VectorField {
  element: HTMLElement;
  fields: readonly [NumberField, NumberField, NumberField];
  readonly value: Vec3;
  set(value: Vec3): void;
}

/** A component by as many decimals as give the largest one three or four digits: more would not fit, and say nothing. */
function componentText(value: number, vector: Vec3): string {
  if (!vector.every(Number.isFinite)) return roundForShow(value);
  const largest = Math.max(...vector.map(Math.abs));
  const exponent = largest > 0 ? Math.floor(Math.log10(largest)) : 0;
  const decimals = Math.min(20, Math.max(0, (exponent < -1 ? 2 : 3) - exponent));
  const rounded = Number(value.toFixed(decimals));
  const counts = Math.abs(value) > 1e-5 * largest;
  return String(rounded === 0 && counts ? Number(value.toPrecision(2)) : rounded);
}

export function vectorField(name: string, value: Vec3, options: NumberOptions = {}): VectorField {
  const make = (axis: string, index: 0 | 1 | 2): NumberField => numberField(axis, value[index], options);
  const fields = [make("X", 0), make("Y", 1), make("Z", 2)] as const;
  const element = h(
    "fieldset",
    { class: "vector" },
    h("legend", {}, name),
    ...fields.map((field) => field.element),
  );
  fields.forEach((field, index) => {
    field.element.classList.add("axis", `axis-${"xyz"[index]}`);
    field.input.setAttribute("aria-label", `${name} ${"XYZ"[index]}`);
  });
  return {
    element,
    fields,
    get value(): Vec3 {
      return [fields[0].value, fields[1].value, fields[2].value];
    },
    set(next: Vec3) {
      for (const [axis, field] of fields.entries()) {
        const value = next[axis as 0 | 1 | 2];
        field.set(value, componentText(value, next));
      }
    },
  };
}

export function selectField<Value extends string>(
  label: string,
  choices: readonly (readonly [Value, string])[],
  value: Value,
  onChange: (value: Value) => void,
): { element: HTMLElement; select: HTMLSelectElement } {
  const id = freshId();
  const select = h(
    "select",
    { id, onchange: () => onChange(select.value as Value) },
    ...choices.map(([key, text]) => h("option", { value: key }, text)),
  );
  select.value = value;
  return {
    element: h(
      "div",
      { class: "field" },
      h("label", { htmlFor: id }, label),
      h("div", { class: "input-box select-box" }, select),
    ),
    select,
  };
}

export function checkField(
  label: string,
  checked: boolean,
  onChange: (checked: boolean) => void,
): { element: HTMLElement; input: HTMLInputElement } {
  const id = freshId();
  const input = h("input", {
    id,
    type: "checkbox",
    checked,
    class: "switch",
    onchange: () => onChange(input.checked),
  });
  return { element: h("div", { class: "field check" }, h("label", { htmlFor: id }, label), input), input };
}

export function rangeField(
  label: string,
  range: { min: number; max: number; step: number },
  value: number,
  format: (value: number) => string,
  onChange: (value: number) => void,
): { element: HTMLElement; input: HTMLInputElement; set(value: number): void } {
  const id = freshId();
  const output = h("output", { class: "range-value" }, format(value));
  const input = h("input", {
    id,
    type: "range",
    min: String(range.min),
    max: String(range.max),
    step: String(range.step),
    value: String(value),
  });
  const show = (next: number): void => {
    output.textContent = format(next);
    input.setAttribute("aria-valuetext", format(next));
  };
  show(value);
  input.addEventListener("input", () => {
    show(Number(input.value));
    onChange(Number(input.value));
  });
  return {
    element: h("div", { class: "field range" }, h("label", { htmlFor: id }, label), output, input),
    input,
    set(next: number) {
      input.value = String(next);
      show(next);
    },
  };
}
