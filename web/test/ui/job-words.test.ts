import { expect, test } from "vitest";
import type { Job, JobReport } from "../../src/api/types";
import {
  durationText,
  estimateFacts,
  phaseText,
  previewError,
  reportText,
  standingText,
  termsText,
} from "../../src/ui/job-words";

const job = (members: Partial<Job>): Job => ({
  jobID: "j",
  type: "process",
  processID: "edit",
  status: "running",
  message: "is at work",
  progress: 62,
  phase: "tiles",
  created: "",
  updated: "",
  attempts: 1,
  request: { neighbors: 10, s: 1, timing: "sequence", launcher: "local", priority: 5 },
  links: [],
  ...members,
});

const report: JobReport = {
  mode: "tiles",
  sample_count: 257_413_000,
  moved: 31_000_000,
  inserted: 0,
  removed: 0,
  tiles: 412,
  tiles_kept: 0,
  preview: { sample_count: 100_000, matched: 99_871, rms_difference: 0.000125, max_difference: 0.00175 },
  spacing: 0.00625,
  seconds: 437.5,
};

test("durations are as exact as one wants to know them", () => {
  const seconds = [0.2, 3.14, 9.99, 59.7, 61, 120, 437.5, 599.6, 3599, 3600, 5400, 90_000, 400_000];
  expect(seconds.map(durationText)).toEqual([
    "less than a second",
    "3.1 s",
    "10 s",
    "1 min",
    "1 min 1 s",
    "2 min",
    "7 min 18 s",
    "10 min",
    "1 h",
    "1 h",
    "1 h 30 min",
    "25 h",
    "5 days",
  ]);
});

test("where a job stands says its phase and the time left, or its place", () => {
  expect(standingText(job({ phase: "tile 3 of 1200", eta_s: 90.5 }))).toBe(
    "Editing tile 3 of 1,200 · about 1 min 31 s left",
  );
  expect(standingText(job({ phase: "survey" }))).toBe("Looking through the scan");
  const waits = { status: "accepted", attempts: 0 } as const;
  expect(standingText(job({ ...waits, queue_place: 1 }))).toBe("Next in the queue");
  expect(standingText(job({ ...waits, queue_place: 4 }))).toBe("Place 4 in the queue");
  expect(standingText(job({ ...waits, queue_place: 1, attempts: 1 }))).toContain("go on where it was");
  expect(standingText(job({ status: "failed" }))).toBe("");
  expect(standingText(job({ phase: "waiting" }))).toBe("Starting");
  expect(phaseText("something new")).toBe("Something new");
});

test("a report says what moved, in which time, and how well the preview showed it", () => {
  expect(reportText(report)).toEqual([
    "31,000,000 of 257,413,000 samples moved in 7 min 18 s.",
    "The preview showed it within 0.02 of a spacing, and within 0.28 at its worst sample.",
  ]);
  const more = reportText({ ...report, inserted: 1200, removed: 30, tiles_kept: 40 });
  expect(more).toContain("30 samples were removed where they stood too close.");
  expect(more).toContain("1,200 samples were inserted.");
  expect(more).toContain("40 of 412 tiles were done before an interruption.");
  const exact = { ...report.preview, rms_difference: 0, max_difference: 0 };
  expect(previewError({ ...report, preview: exact })).toBe("The preview showed exactly this");
  const fine = { ...report.preview, rms_difference: 1e-9, max_difference: 2e-9 };
  expect(previewError({ ...report, preview: fine })).toBe(
    "The preview showed it within 0.001 of a spacing everywhere",
  );
  expect(previewError({ ...report, preview: { ...exact, matched: 0 } })).toBeUndefined();
  expect(previewError({ ...report, spacing: 0 })).toBeUndefined();
});

test("terms name what is not the usual", () => {
  const { request } = job({});
  expect(termsText(job({ request: { ...request, output: { format: "las" } } }))).toBe("LAS");
  expect(
    termsText(
      job({ report, request: { ...request, output: { format: "ply" }, priority: 8, launcher: "two" } }),
    ),
  ).toBe("PLY · in tiles · priority 8 · two");
});

test("an estimate sets the disk against what is free", () => {
  const facts = new Map(
    estimateFacts({
      mode: "memory",
      sample_count: 12_000,
      memory_bytes: 34_000_000,
      disk_bytes: 1_200_000,
      free_disk_bytes: 81e9,
      seconds: 2.5,
    }),
  );
  expect(facts.get("Disk")).toBe("1.2 MB of 81.0 GB free");
  expect(facts.get("Time")).toBe("about 2.5 s");
  expect(facts.get("Way")).toBe("In memory");
});
