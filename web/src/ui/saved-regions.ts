import type { NamedRegion, RegionName, SessionDocument } from "../api/types";
import type { RegionEditor } from "../edits/regions";
import type { Bus, SessionStore } from "../session-store";
import { h, replaceChildren, setText } from "./dom";
import { selectField, textField } from "./fields";
import { formatCount } from "./format";
import { icon } from "./icons";

const NAME = /^[A-Za-z0-9_ .-]{1,64}$/;
const RESERVED = ["zero", "one", "t", ".", ".."];

/** Why a region cannot be called so; empty where it can. */
export function nameFault(name: string): string {
  if (!NAME.test(name) || name.trim() !== name)
    return "A name has 1 to 64 letters, digits, spaces, dots, dashes or underscores, and no outer spaces.";
  return RESERVED.includes(name) ? `“${name}” means something else here.` : "";
}

/** Regions under names: what a region has now is kept, and joins the zero- or the one-region again later. */
export function createSavedRegions(bus: Bus, store: SessionStore, regions: RegionEditor): HTMLElement {
  let from: RegionName = "one";
  const list = h("ul", { class: "saved-regions", aria: { label: "Saved regions" } });
  const none = h(
    "p",
    { class: "hint" },
    "None yet. A saved region stays with its samples through all edits.",
  );
  const source = selectField(
    "Region",
    [
      ["zero", "Zero (stays)"],
      ["one", "One (moves)"],
    ],
    from,
    (value) => {
      from = value;
      show(store.document);
    },
  );
  const name = textField("Save as", "", "");
  const fault = h("p", { class: "hint obstacle", aria: { live: "polite" } });
  const save = h("button", { type: "submit", class: "button" }, "Save region");
  const use = async (saved: string, into: RegionName): Promise<void> => {
    const shape = { type: "region", region: saved } as const;
    const painted = await regions.paint(into, [{ mode: "add", shape, steal: true }]);
    if (painted?.changed === 0)
      bus.fire("toast", { kind: "info", title: `All of “${saved}” is in that region already` });
  };
  const row = ({ region: saved, samples }: NamedRegion): HTMLElement => {
    const into = (target: RegionName, label: string): HTMLElement =>
      h(
        "button",
        {
          type: "button",
          class: "button quiet",
          title: `Its samples join the ${target}-region`,
          aria: { label: `Add ${saved} to the ${target}-region` },
          disabled: samples === 0,
          onclick: () => void use(saved, target),
        },
        label,
      );
    return h(
      "li",
      { class: "saved-region", data: { saved } },
      h(
        "span",
        { class: "saved-name", title: `${saved}, ${formatCount(samples)} samples` },
        saved,
        h("small", {}, formatCount(samples)),
      ),
      into("zero", "Zero"),
      into("one", "One"),
      h(
        "button",
        {
          type: "button",
          class: "icon-button small",
          title: `Delete ${saved}`,
          aria: { label: `Delete the saved region ${saved}` },
          onclick: () => void regions.forget(saved),
        },
        icon("trash"),
      ),
    );
  };
  const show = (document: SessionDocument): void => {
    const { named } = document.regions;
    replaceChildren(list, ...named.map(row));
    none.hidden = named.length > 0;
    save.disabled = document.regions[from].samples === 0;
  };
  const form = h(
    "form",
    {
      class: "shape-form",
      data: { form: "save-region" },
      onsubmit: (event) => {
        event.preventDefault();
        const wanted = name.input.value.trim();
        const wrong = nameFault(wanted);
        setText(fault, wrong);
        name.input.setAttribute("aria-invalid", String(wrong !== ""));
        if (wrong) return name.input.focus();
        void regions.save(wanted, from).then((saved) => {
          if (saved) name.input.value = "";
        });
      },
    },
    h("div", { class: "field-row" }, source.element, name.element),
    fault,
    save,
  );
  bus.on("session.changed", show);
  show(store.document);
  return h("div", { class: "saved" }, list, none, form);
}
