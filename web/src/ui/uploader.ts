import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { CloudDocument } from "../api/types";
import { uploadCloud } from "../api/upload";
import { freshId, h, replaceChildren, setText } from "./dom";
import { formatBytes } from "./format";
import { icon } from "./icons";
import { problemCard } from "./problem-card";

/** What the server calls the parts of an import, as people read it. */
const PHASES: Record<string, string> = {
  waiting: "busy and will soon read",
  decoding: "reading",
  ordering: "ordering",
  hashing: "checking",
  storing: "storing",
};

/** Drop a file anywhere, or pick one: it is sent with progress, and refused with reasons. */
export function createUploader(
  client: ApiClient,
  done: (cloud: CloudDocument) => void,
): { element: HTMLElement } {
  const id = freshId();
  const input = h("input", {
    type: "file",
    id,
    class: "visually-hidden",
    accept: ".ply,.drc,.zip,.las,.pcd,.obj,.xyz,.txt,.asc",
  });
  const dropId = freshId();
  const drop = h("input", { type: "checkbox", id: dropId });
  const status = h("div", { class: "upload-status", aria: { live: "polite" } });
  const zone = h(
    "div",
    { class: "drop-zone" },
    icon("upload"),
    h(
      "p",
      { class: "drop-title" },
      "Drop a point cloud, or ",
      h("label", { htmlFor: id, class: "file-label" }, "choose a file"),
      input,
    ),
    h(
      "p",
      { class: "hint" },
      "PLY, LAS, PCD, OBJ, Draco or XYZ. The vertices of a mesh are taken as samples.",
    ),
    h(
      "p",
      { class: "drop-option" },
      drop,
      h("label", { htmlFor: dropId }, "Leave out samples without finite coordinates"),
    ),
    status,
  );

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
    zone.classList.add("busy");
    try {
      const cloud = await uploadCloud(client, file, {
        token: client.token(),
        dropNonFinite: drop.checked,
        signal: controller.signal,
        onProgress: (fraction) => {
          bar.value = fraction;
          if (fraction >= 1) {
            bar.removeAttribute("value");
            setText(text, `${file.name}: the server is reading it`);
          }
        },
        onImport: ({ phase, fraction }) => {
          bar.value = fraction;
          setText(text, `${file.name}: the server is ${PHASES[phase] ?? "reading"} it`);
        },
      });
      replaceChildren(status);
      done(cloud);
    } catch (error) {
      const aborted = error instanceof DOMException && error.name === "AbortError";
      if (aborted) replaceChildren(status, h("p", { class: "hint" }, "The upload was cancelled."));
      else replaceChildren(status, problemCard(`${file.name} was not taken`, problemOf(error)));
    } finally {
      zone.classList.remove("busy");
      input.value = "";
    }
  };

  const sendFirst = (files: FileList | null | undefined): void => {
    const file = files?.[0];
    if (file && !zone.classList.contains("busy")) void send(file);
  };
  input.addEventListener("change", () => sendFirst(input.files));
  let depth = 0;
  const hover = (on: boolean): void => {
    depth = Math.max(0, depth + (on ? 1 : -1));
    zone.classList.toggle("over", depth > 0);
  };
  window.addEventListener("dragenter", () => hover(true));
  window.addEventListener("dragleave", () => hover(false));
  window.addEventListener("dragover", (event) => event.preventDefault());
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    depth = 0;
    zone.classList.remove("over");
    sendFirst(event.dataTransfer?.files);
  });
  return { element: zone };
}
