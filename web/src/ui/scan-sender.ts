import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import { freshId, h, replaceChildren, setText } from "./dom";
import { formatBytes } from "./format";
import { problemCard } from "./problem-card";

/** Sends a scan to be read by jobs alone: as it is, of any size, and never as a cloud in memory. */
export function createScanSender(
  client: ApiClient,
  done: (upload: string, file: File) => void,
): { element: HTMLElement } {
  const id = freshId();
  const input = h("input", {
    type: "file",
    id,
    class: "visually-hidden",
    accept: ".ply,.las,.zip,.drc,.xyz",
  });
  const status = h("div", { class: "upload-status", aria: { live: "polite" } });
  const send = async (file: File): Promise<void> => {
    const controller = new AbortController();
    const bar = h("progress", { max: 1, value: 0, aria: { label: `Sending ${file.name}` } });
    const text = h("span", {}, `${file.name}, ${formatBytes(file.size)}`);
    const cancel = h(
      "button",
      { type: "button", class: "button quiet", onclick: () => controller.abort() },
      "Cancel",
    );
    replaceChildren(status, h("div", { class: "upload-row" }, text, cancel), bar);
    input.disabled = true;
    try {
      const { sendInPieces } = await import("../api/tus");
      const upload = await sendInPieces(client, file, {
        signal: controller.signal,
        onProgress: (fraction) => {
          bar.value = fraction;
          setText(text, `${file.name}, ${formatBytes(fraction * file.size)} of ${formatBytes(file.size)}`);
        },
      });
      replaceChildren(status);
      done(upload, file);
    } catch (error) {
      const aborted = controller.signal.aborted;
      replaceChildren(status, ...(aborted ? [] : [problemCard("The scan was not sent", problemOf(error))]));
    }
    input.disabled = false;
  };
  input.addEventListener("change", () => {
    const file = input.files?.[0];
    input.value = "";
    if (file) void send(file);
  });
  const element = h(
    "div",
    { class: "scan-sender" },
    h(
      "p",
      { class: "hint" },
      "Or ",
      h("label", { htmlFor: id, class: "file-label" }, "send the whole scan"),
      input,
      ", of any size",
    ),
    status,
  );
  return { element };
}
