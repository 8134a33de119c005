import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { Job } from "../api/types";
import { isActive, JobFeed } from "../jobs/job-feed";
import { h, replaceChildren, setText } from "./dom";
import { createJobRow, type JobActions, type JobRow } from "./job-row";
import { jobName, STATUS_NAMES } from "./job-words";
import { problemCard } from "./problem-card";

export interface JobListOptions {
  /** Only the jobs of this session; of all where it is absent. */
  session?: string;
  /** So many rows at first, with a button for the others; jobs under way are always shown. */
  most: number;
  /** Told after each change. */
  onJobs?: (jobs: readonly Job[]) => void;
}

export interface JobList {
  element: HTMLElement;
  /** A job that was just started. */
  take(job: Job): void;
  start(): void;
  stop(): void;
}

/** Jobs, newest first, as they are now. */
export function createJobList(client: ApiClient, options: JobListOptions): JobList {
  const { session } = options;
  const list = h("ul", { class: "job-list" });
  const rest = h("button", { type: "button", class: "button quiet job-rest", hidden: true });
  const trouble = h("div", { class: "job-trouble", aria: { live: "polite" } });
  // Changes of state are spoken; progress would never end.
  const news = h("p", { class: "visually-hidden", aria: { live: "polite" } });
  const element = h("div", { class: "job-area" }, list, rest, trouble, news);

  const rows = new Map<string, JobRow>();
  const states = new Map<string, string>();
  let all: readonly Job[] = [];
  let showsAll = false;
  const feed = new JobFeed(
    client,
    {
      jobs: (jobs) => {
        all = jobs;
        show();
        options.onJobs?.(jobs);
      },
      trouble: (error) =>
        replaceChildren(
          trouble,
          error === undefined ? null : problemCard("The jobs cannot be listed", problemOf(error)),
        ),
    },
    ({ request }) => session === undefined || request.session === session,
  );
  const actions: JobActions = {
    dismiss: async ({ jobID }) => feed.take(await client.dismissJob(jobID)),
    restart: async ({ jobID }) => feed.take(await client.restartJob(jobID)),
    forget: async ({ jobID }) => {
      await client.forgetJob(jobID);
      feed.remove(jobID);
    },
  };
  rest.addEventListener("click", () => {
    showsAll = true;
    const next = list.children.length;
    show();
    list.children[next]?.querySelector<HTMLElement>("button")?.focus();
  });

  const show = (): void => {
    const shown = all.filter((job, index) => showsAll || index < options.most || isActive(job));
    const ids = new Set(shown.map(({ jobID }) => jobID));
    for (const [id, row] of rows) if (!ids.has(id)) removeRow(id, row);
    for (const [index, job] of shown.entries()) {
      announce(job);
      let row = rows.get(job.jobID);
      if (row) row.update(job);
      else {
        row = createJobRow(client, job, actions, session === undefined);
        rows.set(job.jobID, row);
      }
      // What stands where it belongs is not moved: it may have the focus.
      if (list.children[index] !== row.element) list.insertBefore(row.element, list.children[index] ?? null);
    }
    rest.hidden = shown.length === all.length;
    setText(rest, `Show all ${all.length}`);
  };
  const removeRow = (id: string, row: JobRow): void => {
    const focused = row.element.contains(document.activeElement);
    const next = row.element.nextElementSibling ?? row.element.previousElementSibling;
    row.close();
    row.element.remove();
    rows.delete(id);
    if (focused) next?.querySelector<HTMLElement>("button:not([hidden])")?.focus();
  };
  const announce = (job: Job): void => {
    const before = states.get(job.jobID);
    states.set(job.jobID, job.status);
    if (before === undefined || before === job.status) return;
    const why = job.status === "failed" ? `, ${job.message}` : "";
    setText(news, `${jobName(job)}: ${STATUS_NAMES[job.status].toLowerCase()}${why}`);
  };
  return {
    element,
    take: (job) => {
      feed.take(job);
      setText(news, `${jobName(job)} was started`);
    },
    start: () => feed.start(),
    stop: () => {
      feed.stop();
      for (const row of rows.values()) row.close();
    },
  };
}
