import type { CloudDocument, SessionSummary } from "../api/types";
import { parsePreview, previewText } from "../edits/preview-size";
import { DEFAULT_SCALES, parseScales, scalesText } from "../edits/scales";
import { sessionUrl } from "../link";
import { confirmButton } from "./confirm-button";
import { h, setText } from "./dom";
import { textField } from "./fields";
import { formatAge, formatBytes, formatCount } from "./format";
import { icon } from "./icons";

export interface CloudCardOptions {
  cloud: CloudDocument;
  /** Newest first. */
  sessions: readonly SessionSummary[];
  /**
   * Starts a session whose base levels are smoothed at these parts of the diagonal, the coarsest first; on so many of the
   * samples, or on all.
   */
  start: (scales: number[], preview: number | undefined) => Promise<void>;
  removeCloud: () => Promise<void>;
  removeSession: (id: string) => Promise<void>;
}

/** A cloud with its sessions: reopen one, or begin another. */
export function createCloudCard(options: CloudCardOptions): HTMLElement {
  const { cloud, sessions } = options;
  const facts = [
    `${formatCount(cloud.sample_count)} samples`,
    formatBytes(cloud.bytes),
    [cloud.report.format.replace("-", " ").toUpperCase(), cloud.report.encoding].filter(Boolean).join(" "),
    formatAge(cloud.created),
  ];
  const notes = importNotes(cloud);
  return h(
    "article",
    { class: "cloud-card", data: { cloud: cloud.id }, aria: { label: cloud.name } },
    h(
      "div",
      { class: "cloud-head" },
      h(
        "div",
        { class: "cloud-text" },
        h("h3", {}, cloud.name),
        h("p", { class: "facts" }, facts.filter(Boolean).join(" · ")),
        notes && h("p", { class: "facts note" }, notes),
      ),
      startForm(options),
      confirmButton(`Delete ${cloud.name}`, () => void options.removeCloud()),
    ),
    sessions.length > 0 &&
      h("ul", { class: "session-list" }, ...sessions.map((session) => sessionRow(session, options))),
  );
}

/** What of the file is not as it was; nothing where all was taken. */
function importNotes(cloud: CloudDocument): string {
  const { dropped_non_finite: dropped, duplicate_count: duplicates, skipped, from_mesh: mesh } = cloud.report;
  const notes: string[] = [];
  if (mesh) notes.push("vertices of a mesh");
  if (dropped) notes.push(`${formatCount(dropped)} samples without finite coordinates left out`);
  if (duplicates) notes.push(`${formatCount(duplicates)} duplicates kept`);
  if (skipped && skipped.length > 0) notes.push(`not kept: ${skipped.join(", ")}`);
  return notes.join(" · ");
}

function startForm(options: CloudCardOptions): HTMLElement {
  const { sample_count: whole } = options.cloud;
  const field = textField("Scales", scalesText(DEFAULT_SCALES), "% of the diagonal");
  const samples = textField("Samples", previewText(whole), `of ${formatCount(whole)}`);
  const fault = h("p", { class: "hint obstacle start-fault", aria: { live: "polite" } });
  const button = h(
    "button",
    { type: "submit", class: "button primary", aria: { label: `New session of ${options.cloud.name}` } },
    icon("plus"),
    "New session",
  );
  const form = h(
    "form",
    {
      class: "start-form",
      onsubmit: (event) => {
        event.preventDefault();
        const scales = parseScales(field.input.value);
        const preview = parsePreview(samples.input.value, whole);
        const wrongScales = typeof scales === "string";
        const wrongSamples = typeof preview === "string";
        field.input.setAttribute("aria-invalid", String(wrongScales));
        samples.input.setAttribute("aria-invalid", String(wrongSamples));
        setText(fault, wrongScales ? scales : wrongSamples ? preview : "");
        if (wrongScales) return field.input.focus();
        if (wrongSamples) return samples.input.focus();
        button.disabled = true;
        void options.start(scales, preview).finally(() => {
          button.disabled = false;
        });
      },
    },
    field.element,
    samples.element,
    button,
    fault,
  );
  field.input.title =
    "A base level for each: what is finer than its scale rides along as detail. Coarsest first.";
  samples.input.inputMode = "numeric";
  samples.input.title =
    "How many samples to edit, evenly spread over the cloud. The session's recipe fits the whole cloud.";
  return form;
}

function sessionRow(session: SessionSummary, options: CloudCardOptions): HTMLElement {
  const revision = session.state === "ready" ? `revision ${session.revision ?? 0}` : session.state;
  const { preview } = session;
  const state = preview ? `${formatCount(preview.count)} samples · ${revision}` : revision;
  return h(
    "li",
    { class: "session-row" },
    h(
      "a",
      { href: sessionUrl(session.id), class: "session-link", data: { session: session.id } },
      h("span", { class: `state-dot ${session.state}`, aria: { hidden: "true" } }),
      h("span", {}, session.name || options.cloud.name),
      h("small", {}, `${state} · ${formatAge(session.created)}`),
    ),
    confirmButton(
      `Delete the session of ${formatAge(session.created)}`,
      () => void options.removeSession(session.id),
    ),
  );
}
