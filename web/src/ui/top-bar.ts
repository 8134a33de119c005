import type { ApiClient } from "../api/client";
import type { ExportFormat } from "../api/types";
import { reportError } from "../edits/errors";
import type { Bus, SessionStore } from "../session-store";
import { h } from "./dom";
import { type IconName, icon, logo } from "./icons";
import { saveFile } from "./save-file";

const FORMATS: readonly (readonly [ExportFormat, string, string])[] = [
  ["ply", "PLY", "all attributes, full precision"],
  ["draco", "Draco", "compressed"],
  ["xyz", "XYZ", "plain text"],
];
const EXTENSIONS: Record<ExportFormat, string> = { ply: "ply", draco: "drc", xyz: "xyz" };

/** The name, and what concerns the session as a whole: undo, redo, link, export, help. */
export function createTopBar(bus: Bus, client: ApiClient, store: SessionStore): HTMLElement {
  const button = (name: IconName, label: string, key: string, action: () => void): HTMLButtonElement =>
    h(
      "button",
      {
        type: "button",
        class: "icon-button",
        aria: { label: `${label} (${key})` },
        data: { tip: label, key },
        onclick: action,
      },
      icon(name),
    );
  const undo = button("undo", "Undo", "Ctrl Z", () => void bus.invoke("edit.undo"));
  const redo = button("redo", "Redo", "Ctrl Y", () => void bus.invoke("edit.redo"));
  undo.dataset["action"] = "undo";
  redo.dataset["action"] = "redo";
  undo.disabled = true;
  redo.disabled = true;
  let edits = { undo: false, redo: false };
  let painting = { undo: false, redo: false };
  const refresh = (): void => {
    undo.disabled = !edits.undo && !painting.undo;
    redo.disabled = !edits.redo && !painting.redo;
  };
  bus.on("history.changed", ({ head, edits: { length } }) => {
    edits = { undo: head > 0, redo: head < length };
    refresh();
  });
  bus.on("painting.history", (next) => {
    painting = next;
    refresh();
  });
  const link = h(
    "button",
    {
      type: "button",
      class: "icon-button",
      aria: { label: "Copy the link to this view" },
      data: { tip: "Copy link" },
      onclick: () => void copyLink(bus),
    },
    icon("link"),
  );
  const share = h(
    "button",
    {
      type: "button",
      class: "button",
      onclick: async () => {
        try {
          await (await import("./share-dialog")).showShareDialog(bus, client, store);
        } catch (error) {
          reportError(bus, error, "The links cannot be shown");
        }
      },
    },
    "Share…",
  );
  const full = h(
    "button",
    {
      type: "button",
      class: "button",
      onclick: async () => {
        try {
          (await import("./jobs-dialog")).showJobsDialog(bus, client, store);
        } catch (error) {
          reportError(bus, error, "The jobs cannot be shown");
        }
      },
    },
    "Full resolution…",
  );
  const help = button("help", "Shortcuts", "?", () => bus.invoke("shortcuts.show"));
  return h(
    "header",
    { class: "top-bar" },
    h(
      "a",
      { class: "brand", href: "./", aria: { label: "Pointwright, all clouds" } },
      logo(),
      h("span", {}, "Pointwright"),
    ),
    h("span", { class: "divider", aria: { hidden: "true" } }),
    h("h1", { class: "session-name" }, store.document.name),
    h("span", { class: "spacer" }),
    h("div", { class: "top-group" }, undo, redo),
    h("span", { class: "divider", aria: { hidden: "true" } }),
    full,
    share,
    link,
    help,
    exportMenu(bus, client, store),
  );
}

async function copyLink(bus: Bus): Promise<void> {
  try {
    await navigator.clipboard.writeText(location.href);
    bus.fire("toast", { kind: "success", title: "Link copied" });
  } catch {
    bus.fire("toast", {
      kind: "info",
      title: "The link is in the address bar",
      lines: ["The browser did not let it be copied."],
    });
  }
}

/** Native disclosure, closed by a choice, by Escape and by a press elsewhere. */
function exportMenu(bus: Bus, client: ApiClient, store: SessionStore): HTMLElement {
  const name = store.document.name.replace(/\.[^.]+$/, "") || "cloud";
  const save = async (format: ExportFormat): Promise<void> => {
    try {
      saveFile(await client.file(client.exportUrl(store.id, format)), `${name}.${EXTENSIONS[format]}`);
    } catch (error) {
      reportError(bus, error, "The file cannot be fetched");
    }
  };
  const items = FORMATS.map(([format, title, hint]) =>
    h(
      "a",
      {
        class: "menu-item",
        href: client.exportUrl(store.id, format),
        download: `${name}.${EXTENSIONS[format]}`,
        data: { format },
        onclick: (event) => {
          menu.removeAttribute("open");
          if (client.token() === null) return;
          event.preventDefault();
          void save(format);
        },
      },
      h("strong", {}, title),
      h("small", {}, hint),
    ),
  );
  const menu: HTMLDetailsElement = h(
    "details",
    { class: "menu" },
    h("summary", { class: "button primary" }, icon("export"), "Export"),
    h("div", { class: "menu-list panel" }, ...items),
  );
  document.addEventListener("pointerdown", (event) => {
    if (event.target instanceof Node && !menu.contains(event.target)) menu.removeAttribute("open");
  });
  menu.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !menu.open) return;
    event.stopPropagation();
    menu.removeAttribute("open");
    menu.querySelector("summary")?.focus();
  });
  return menu;
}
