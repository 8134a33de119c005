import { h } from "./dom";
import { icon } from "./icons";

export interface Section {
  element: HTMLElement;
  body: HTMLElement;
  /** Beside the title. */
  aside: HTMLElement;
}

/** A part of the side panel that folds. */
export function createSection(title: string, open = true): Section {
  const body = h("div", { class: "section-body" });
  const aside = h("span", { class: "section-aside" });
  const details = h(
    "details",
    { class: "section", open },
    h("summary", {}, h("span", { class: "section-title" }, title), aside, icon("chevron")),
    body,
  );
  return { element: details, body, aside };
}
