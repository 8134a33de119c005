import type { ApiClient } from "../api/client";
import { reportError } from "../edits/errors";
import type { Bus, SessionStore } from "../session-store";
import { h, replaceChildren } from "./dom";
import { rangeField } from "./fields";
import { icon } from "./icons";
import { saveFile } from "./save-file";

/** The recorded edits as a whole: played part of the way, kept as a file, and taken from one. */
export function createPlayback(
  bus: Bus,
  client: ApiClient,
  store: SessionStore,
  apply: (file: File) => void,
): HTMLElement {
  const slider = rangeField(
    "Part of the way",
    { min: 0, max: 1, step: 0.01 },
    1,
    (s) => `${Math.round(100 * s)} %`,
    (s) => bus.invoke("animation.set", s),
  );
  const play = h(
    "button",
    {
      type: "button",
      class: "button quiet",
      aria: { label: "Play the edits" },
      onclick: () => bus.invoke("animation.play"),
    },
    icon("play"),
  );
  bus.on("animation.changed", ({ s, playing }) => {
    slider.set(s ?? 1);
    replaceChildren(play, icon(playing ? "pause" : "play"));
    play.setAttribute("aria-label", playing ? "Pause" : "Play the edits");
  });
  bus.on("transform.changed", () => {
    const pending = bus.invoke("edit.pending");
    play.disabled = pending;
    slider.input.disabled = pending;
    player.title = pending ? "Apply or cancel the edit first" : "";
  });
  const download = h(
    "a",
    {
      class: "button quiet",
      href: client.recipeUrl(store.id),
      // The server names the file.
      download: "",
      data: { action: "recipe" },
      onclick: async (event) => {
        if (client.token() === null) return;
        event.preventDefault();
        try {
          saveFile(await client.file(client.recipeUrl(store.id)), "recipe.json");
        } catch (error) {
          reportError(bus, error, "The recipe cannot be fetched");
        }
      },
    },
    icon("export"),
    "Download",
  );
  const input = h("input", {
    type: "file",
    accept: ".json,application/json",
    hidden: true,
    aria: { label: "Recipe file" },
    onchange: () => {
      const [file] = input.files ?? [];
      input.value = "";
      if (file) apply(file);
    },
  });
  const choose = h(
    "button",
    { type: "button", class: "button quiet", onclick: () => input.click() },
    icon("upload"),
    "Apply file…",
  );
  const player = h("div", { class: "player" }, play, slider.element);
  const none = h("p", { class: "hint" }, "Recorded edits can be played here, and kept as a recipe.");
  bus.on("history.changed", ({ head }) => {
    player.hidden = head === 0;
    none.hidden = head > 0;
    download.toggleAttribute("hidden", head === 0);
  });
  return h(
    "details",
    { class: "sub" },
    h("summary", {}, h("span", { class: "sub-title" }, "Playback and recipe"), icon("chevron")),
    h(
      "div",
      { class: "shape-form" },
      player,
      none,
      h("div", { class: "button-row" }, download, choose),
      input,
    ),
  );
}
