import type { EditRecord, History } from "../api/types";
import { describeEdit } from "../edits/deformation";
import { describeSamples } from "../edits/resampling";
import type { Bus } from "../session-store";
import { h, replaceChildren, setText } from "./dom";
import { formatAge, formatCount } from "./format";
import { icon } from "./icons";
import { createSection } from "./section";

/** Every edit, with the state that is shown now; a click goes there. `playback`: what is done with all of them. */
export function createHistoryPanel(bus: Bus, playback: HTMLElement): HTMLElement {
  const section = createSection("History");
  const list = h("ol", { class: "history" });
  section.body.append(list, playback);

  const entry = (label: string, detail: string, edit: number, head: number): HTMLElement => {
    const state = edit === head ? "current" : edit > head ? "undone" : "done";
    const button = h(
      "button",
      {
        type: "button",
        class: `history-entry ${state}`,
        data: { edit: String(edit) },
        onclick: () => void bus.invoke("edit.jump", edit),
      },
      h("span", { class: "history-mark" }, edit === head ? icon("check") : null),
      h("span", { class: "history-text" }, label, h("small", {}, detail)),
    );
    if (edit === head) button.setAttribute("aria-current", "step");
    return h("li", {}, button);
  };
  const describe = (record: EditRecord): string =>
    [`${formatCount(record.moved_samples)} samples`, describeSamples(record), formatAge(record.created)]
      .filter(Boolean)
      .join(" · ");
  const show = (history: History): void => {
    const entries = history.edits.map((record) =>
      entry(describeEdit(record.edit), describe(record), record.index, history.head),
    );
    replaceChildren(list, entry("As loaded", "", 0, history.head), ...entries);
    setText(section.aside, history.edits.length === 0 ? "" : `${history.head} / ${history.edits.length}`);
    // Only the list scrolls to the current entry, never the panel.
    const current = list.querySelector<HTMLElement>(".current");
    if (current) list.scrollTop = current.offsetTop - list.clientHeight / 2;
  };
  bus.on("history.changed", show);
  show({ head: 0, edits: [] });
  return section.element;
}
