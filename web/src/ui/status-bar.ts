import { samplesBefore } from "../edits/resampling";
import type { LoadStatus } from "../event-map";
import type { Bus, SessionStore } from "../session-store";
import { h, setText } from "./dom";
import { formatCount, formatMs, formatRate } from "./format";

/** The line at the lower edge: what is on the screen and how fresh it is. */
export function createStatusBar(bus: Bus, store: SessionStore): HTMLElement {
  const samples = h("span", { class: "status-item", data: { status: "samples" } });
  const revision = h("span", { class: "status-item", data: { status: "revision" } });
  const timing = h("span", { class: "status-item", data: { status: "timing" } });
  const connection = h("span", { class: "status-item connection", data: { status: "connection" } });
  const badge = h("span", { class: "badge none", role: "status", data: { status: "badge" } });
  const animation = h("span", { class: "badge none", role: "status", data: { status: "animation" } });
  bus.on("animation.changed", ({ s }) => {
    animation.className = `badge ${s === null ? "none" : "waiting"}`;
    setText(animation, s === null ? "" : `Animation ${Math.round(100 * s)} %, not recorded · Esc leaves`);
  });
  const radius = h("span", { class: "status-item", data: { status: "spacing" } });

  /** Before all of the edits. */
  let first = store.document.sample_count;
  let load: LoadStatus = { loaded: first, total: first, complete: true };
  const showSamples = (): void => {
    const { loaded, total, complete } = load;
    const { preview } = store.document;
    const now = `${formatCount(total)} samples${preview ? `, a preview of ${formatCount(preview.of)}` : ""}`;
    if (!complete && loaded < total) setText(samples, `${formatCount(loaded)} of ${now}`);
    else setText(samples, total === first ? now : `${formatCount(first)} → ${now}`);
    samples.title = total === first ? "" : "As loaded, and as shown";
  };
  bus.on("load.changed", (status) => {
    load = status;
    showSamples();
  });
  bus.on("history.changed", ({ edits }) => {
    first = samplesBefore(edits, store.document.sample_count);
    showSamples();
  });
  const showSession = (): void => {
    const { document } = store;
    setText(revision, `revision ${document.revision}`);
    setText(radius, `spacing ${Number(document.spacing.toPrecision(3))}`);
  };
  bus.on("session.changed", showSession);
  bus.on("preview.changed", ({ state, resampled, latencyMs, samplesPerSecond }) => {
    badge.className = `badge ${state}`;
    badge.title = state === "waiting" ? "The picture shows what it can; the server computes the rest" : "";
    if (state === "preview") setText(badge, "Preview");
    else if (state === "waiting") setText(badge, "Waiting for the server");
    else if (state === "exact") {
      setText(badge, resampled ? "Resampled" : "Exact");
      if (resampled)
        badge.title = "The server's frame, with samples inserted; recording relaxes them further";
      setText(timing, `${formatMs(latencyMs)} · ${formatRate(samplesPerSecond)}`);
      timing.title = "From the hand to the exact frame on the screen, and samples a second at that pace";
    } else setText(badge, "");
  });
  bus.on("connection.changed", (state) => {
    connection.dataset["state"] = state;
    setText(
      connection,
      state === "live" ? "live" : state === "connecting" ? "connecting…" : "connection lost, trying again…",
    );
  });
  showSession();
  return h(
    "footer",
    { class: "status-bar", aria: { label: "Status" } },
    connection,
    samples,
    radius,
    h("span", { class: "spacer" }),
    animation,
    timing,
    badge,
    revision,
  );
}
