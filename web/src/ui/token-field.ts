import { keepBearer } from "../api/token";
import { h } from "./dom";

/** Asks for a token where the server wants one, and opens the page again with it. */
export function createTokenField(reason: string): HTMLElement {
  const token = h("input", {
    type: "password",
    required: true,
    autocomplete: "current-password",
    aria: { label: "Token" },
    placeholder: "pw_…",
  });
  return h(
    "form",
    {
      class: "progress-card panel",
      onsubmit: (event) => {
        event.preventDefault();
        keepBearer(token.value.trim());
        location.reload();
      },
    },
    h("h2", {}, "This server asks for a token"),
    h("p", { class: "hint" }, reason),
    token,
    h("button", { type: "submit", class: "button primary" }, "Open"),
  );
}
