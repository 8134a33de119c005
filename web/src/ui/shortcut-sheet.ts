import { h, replaceChildren } from "./dom";
import { icon } from "./icons";
import type { Shortcut } from "./shortcuts";

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
