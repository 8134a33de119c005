import { belongsToField } from "../keys";
import { h, replaceChildren } from "./dom";
import { icon } from "./icons";

/** One row of the sheet, and what its key does. */
export interface Shortcut {
  group: string;
  /** As shown: "Ctrl Z". */
  keys: string;
  label: string;
  matches?: (event: KeyboardEvent) => boolean;
  run?: (event: KeyboardEvent) => void;
}

/** Matches a bare key, whatever the case. */
export function key(name: string): (event: KeyboardEvent) => boolean {
  return (event) =>
    !event.ctrlKey && !event.metaKey && !event.altKey && event.key.toLowerCase() === name.toLowerCase();
}

export function ctrl(name: string, shift = false): (event: KeyboardEvent) => boolean {
  return (event) =>
    (event.ctrlKey || event.metaKey) && event.shiftKey === shift && event.key.toLowerCase() === name;
}

/** Runs the shortcuts of the table; returns the function that ends it. */
export function listen(shortcuts: readonly Shortcut[]): () => void {
  const onKey = (event: KeyboardEvent): void => {
    const chord = event.ctrlKey || event.metaKey;
    if (belongsToField(event) && event.key !== "Escape" && !chord) return;
    // In a field, Ctrl+Z is the field's own.
    if (belongsToField(event) && chord) return;
    if (document.querySelector("dialog[open]")) return;
    const found = shortcuts.find((shortcut) => shortcut.matches?.(event));
    if (!found?.run) return;
    event.preventDefault();
    found.run(event);
  };
  window.addEventListener("keydown", onKey);
  return () => window.removeEventListener("keydown", onKey);
}

/** The sheet of all shortcuts, searchable. */
export function createShortcutSheet(shortcuts: readonly Shortcut[]): {
  element: HTMLDialogElement;
  show(): void;
} {
  const body = h("div", { class: "sheet-body" });
  const search = h("input", {
    type: "search",
    placeholder: "Search",
    aria: { label: "Search the shortcuts" },
  });
  const fill = (): void => {
    const wanted = search.value.trim().toLowerCase();
    const rows = shortcuts.filter((row) => `${row.label} ${row.keys}`.toLowerCase().includes(wanted));
    const groups = [...new Set(rows.map((row) => row.group))].map((group) =>
      h(
        "section",
        {},
        h("h3", {}, group),
        h(
          "dl",
          {},
          ...rows
            .filter((row) => row.group === group)
            .map((row) =>
              h(
                "div",
                {},
                h("dt", {}, row.label),
                h("dd", {}, ...row.keys.split(" ").map((name) => h("kbd", {}, name))),
              ),
            ),
        ),
      ),
    );
    replaceChildren(
      body,
      ...(groups.length > 0 ? groups : [h("p", { class: "hint" }, "No shortcut is called that.")]),
    );
  };
  search.addEventListener("input", fill);
  const close = h(
    "button",
    { type: "button", class: "icon-button", aria: { label: "Close" }, onclick: () => element.close() },
    icon("close"),
  );
  const element = h(
    "dialog",
    { class: "sheet", aria: { label: "Shortcuts" } },
    h("div", { class: "sheet-head" }, h("h2", {}, "Shortcuts"), search, close),
    body,
  );
  element.addEventListener("click", (event) => {
    if (event.target === element) element.close();
  });
  fill();
  return {
    element,
    show() {
      search.value = "";
      fill();
      element.showModal();
      search.focus();
    },
  };
}
