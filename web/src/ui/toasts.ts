import type { Toast } from "../event-map";
import type { Bus } from "../session-store";
import { h } from "./dom";
import { icon } from "./icons";

const SHOW_MS = { info: 4000, success: 2600, error: 12_000 } as const;
const MAX_TOASTS = 4;

/** Short notices at the lower edge; errors stay longer and are announced at once. */
export function createToasts(bus: Bus): HTMLElement {
  const holder = h("div", { class: "toasts", role: "status", aria: { live: "polite" } });
  const urgent = h("div", { class: "toasts-urgent", role: "alert" });
  const list = h("div", { class: "toast-area" }, urgent, holder);

  const show = (toast: Toast): void => {
    const close = h(
      "button",
      { class: "icon-button small", type: "button", title: "Dismiss", aria: { label: "Dismiss" } },
      icon("close"),
    );
    const lines = (toast.lines ?? []).map((line) => h("p", {}, line));
    const element = h(
      "div",
      { class: `toast ${toast.kind}` },
      h("div", { class: "toast-text" }, h("strong", {}, toast.title), ...lines),
      close,
    );
    const parent = toast.kind === "error" ? urgent : holder;
    const timer = window.setTimeout(() => element.remove(), SHOW_MS[toast.kind]);
    close.addEventListener("click", () => {
      clearTimeout(timer);
      element.remove();
    });
    parent.append(element);
    while (parent.children.length > MAX_TOASTS) parent.firstElementChild?.remove();
  };
  bus.on("toast", show);
  return list;
}
