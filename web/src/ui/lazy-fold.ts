import { reportError } from "../edits/errors";
import type { Bus } from "../session-store";
import { h, replaceChildren } from "./dom";
import { icon } from "./icons";

/**
 * A fold whose content is fetched when it is first opened: the page loads without what not everybody uses. `make` is asked
 * again at the next opening where it failed.
 */
export function createLazyFold(
  bus: Bus,
  title: string,
  make: (holder: HTMLDetailsElement) => Promise<HTMLElement>,
): HTMLDetailsElement {
  const body = h("div", { class: "lazy-body", aria: { live: "polite" } });
  let state: "none" | "coming" | "there" = "none";
  const fetchContent = async (): Promise<void> => {
    state = "coming";
    replaceChildren(body, h("p", { class: "hint" }, "Loading…"));
    try {
      replaceChildren(body, await make(holder));
      state = "there";
    } catch (error) {
      state = "none";
      holder.open = false;
      reportError(bus, error, `${title} cannot be loaded`);
    }
  };
  const holder: HTMLDetailsElement = h(
    "details",
    {
      class: "sub",
      ontoggle: () => {
        if (holder.open && state === "none") void fetchContent();
      },
    },
    h("summary", {}, h("span", { class: "sub-title" }, title), icon("chevron")),
    body,
  );
  return holder;
}
