import type { Job, JobEstimate, JobFormat, JobMode, JobReport, JobStatus } from "../api/types";
import { formatBytes, formatCount } from "./format";

/** Jobs in words for the person who waits for them. */
export const STATUS_NAMES: Record<JobStatus, string> = {
  accepted: "Waiting",
  running: "Running",
  successful: "Finished",
  failed: "Failed",
  dismissed: "Dismissed",
};

export const FORMAT_NAMES: Record<JobFormat, string> = {
  ply: "PLY",
  las: "LAS",
  draco: "Draco",
  "draco-tiles": "Draco tiles",
  xyz: "XYZ",
};

export const MODE_NAMES: Record<JobMode, string> = {
  tiles: "In tiles",
  memory: "In memory",
  direct: "Direct",
};

const PHASES: Record<string, string> = {
  reading: "Reading the scan",
  unpacking: "Unpacking the scan",
  survey: "Looking through the scan",
  preview: "Playing the edits on the preview",
  tiles: "Sorting the samples into tiles",
  edits: "Making the edits",
  result: "Writing the result",
  writing: "Writing the result",
  packing: "Packing the result as Draco tiles",
  done: "Finishing",
};

/** Of a spacing: what is less cannot be seen. */
const LEAST_PART = 0.001;

export function jobName(job: Job): string {
  return job.request.name || "Untitled job";
}

export function phaseText(phase: string): string {
  const tile = /^tile (\d+) of (\d+)$/.exec(phase);
  if (tile) return `Editing tile ${formatCount(Number(tile[1]))} of ${formatCount(Number(tile[2]))}`;
  return PHASES[phase] ?? phase.charAt(0).toUpperCase() + phase.slice(1);
}

/** 437.5 → "7 min 18 s". */
export function durationText(seconds: number): string {
  if (seconds < 1) return "less than a second";
  if (seconds < 10) return `${Number(seconds.toFixed(1))} s`;
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 600) {
    const rest = whole % 60;
    return `${Math.floor(whole / 60)} min${rest > 0 ? ` ${rest} s` : ""}`;
  }
  const minutes = Math.round(whole / 60);
  if (minutes < 60) return `${minutes} min`;
  if (minutes < 2880) {
    const rest = minutes % 60;
    return `${Math.floor(minutes / 60)} h${rest > 0 ? ` ${rest} min` : ""}`;
  }
  return `${Math.round(minutes / 1440)} days`;
}

/** What a job does at this moment, and how long that may take; empty where it has ended. */
export function standingText(job: Job): string {
  if (job.status === "accepted") {
    const place = job.queue_place ?? 0;
    const waits = place === 1 ? "Next in the queue" : place > 1 ? `Place ${place} in the queue` : "Waiting";
    return job.attempts > 0 ? `${waits}, to go on where it was` : waits;
  }
  if (job.status !== "running") return "";
  const left =
    job.eta_s === undefined ? "" : ` · about ${durationText(Math.max(1, Math.round(job.eta_s)))} left`;
  // A worker that has not said a word yet.
  const isNew = job.phase === "waiting" || job.phase === "";
  return (isNew ? "Starting" : phaseText(job.phase)) + left;
}

/** What a job is: its format, its way where it was chosen, its priority where that is unusual. */
export function termsText({ request, report }: Job): string {
  const format = request.output?.format;
  const mode = report?.mode ?? request.mode;
  return [
    format && FORMAT_NAMES[format],
    mode && MODE_NAMES[mode].toLowerCase(),
    request.priority !== 5 && `priority ${request.priority}`,
    request.launcher !== "local" && request.launcher,
  ]
    .filter(Boolean)
    .join(" · ");
}

/** How far the preview was from the result, in spacings; undefined where the two could not be compared. */
export function previewError({ preview, spacing }: JobReport): string | undefined {
  if (preview.matched === 0 || !(spacing > 0)) return undefined;
  const part = preview.rms_difference / spacing;
  const most = preview.max_difference / spacing;
  if (most === 0) return "The preview showed exactly this";
  if (most < LEAST_PART) return `The preview showed it within ${LEAST_PART} of a spacing everywhere`;
  const number = (value: number): string => String(Number(Math.max(value, LEAST_PART).toPrecision(2)));
  return `The preview showed it within ${number(part)} of a spacing, and within ${number(most)} at its worst sample`;
}

/** A report in sentences. */
export function reportText(report: JobReport): string[] {
  const { sample_count: samples, moved, inserted, removed, tiles, tiles_kept: kept } = report;
  const lines = [
    `${formatCount(moved)} of ${formatCount(samples)} samples moved in ${durationText(report.seconds)}.`,
  ];
  if (inserted > 0) lines.push(`${formatCount(inserted)} samples were inserted.`);
  if (removed > 0) lines.push(`${formatCount(removed)} samples were removed where they stood too close.`);
  if (kept > 0)
    lines.push(`${formatCount(kept)} of ${formatCount(tiles)} tiles were done before an interruption.`);
  const error = previewError(report);
  if (error !== undefined) lines.push(`${error}.`);
  return lines;
}

/** An estimate as names and values. */
export function estimateFacts(estimate: JobEstimate): [string, string][] {
  return [
    ["Samples", formatCount(estimate.sample_count)],
    ["Time", (estimate.seconds < 1 ? "" : "about ") + durationText(estimate.seconds)],
    ["Memory", formatBytes(estimate.memory_bytes)],
    ["Disk", `${formatBytes(estimate.disk_bytes)} of ${formatBytes(estimate.free_disk_bytes)} free`],
    ["Way", MODE_NAMES[estimate.mode]],
  ];
}
