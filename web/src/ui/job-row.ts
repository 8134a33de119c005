import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { Job, JobResults } from "../api/types";
import { isActive } from "../jobs/job-feed";
import { sessionUrl } from "../link";
import { confirmTextButton } from "./confirm-button";
import { freshId, h, replaceChildren, setText } from "./dom";
import { formatAge, formatBytes } from "./format";
import { icon } from "./icons";
import { JobLog } from "./job-log";
import { FORMAT_NAMES, jobName, reportText, STATUS_NAMES, standingText, termsText } from "./job-words";
import { problemCard } from "./problem-card";
import { saveFile } from "./save-file";

export interface JobActions {
  /** Ends a job that waits or runs. */
  dismiss(job: Job): Promise<void>;
  restart(job: Job): Promise<void>;
  /** Forgets a job that has ended, with its results. */
  forget(job: Job): Promise<void>;
}

export interface JobRow {
  element: HTMLElement;
  update(job: Job): void;
  /** Ends what it reads. */
  close(): void;
}

type ResultFile = JobResults["results"][number];

/** A job as it is now, with what can be done about it. `withSession`: beside others' jobs, where its session is. */
export function createJobRow(
  client: ApiClient,
  first: Job,
  actions: JobActions,
  withSession: boolean,
): JobRow {
  let job = first;
  const name = jobName(job);
  const dot = h("span", { class: "job-dot", aria: { hidden: "true" } });
  const status = h("span", { class: "job-status" });
  const terms = h("p", { class: "facts" });
  const bar = h("progress", { max: 100, aria: { label: `Progress of ${name}` } });
  const standing = h("p", { class: "job-standing" });
  const summary = h("div", { class: "job-summary" });
  const messages = h("div", { class: "job-messages", aria: { live: "polite" } });

  const guarded = async (what: string, action: () => Promise<void>): Promise<void> => {
    try {
      await action();
      replaceChildren(messages);
    } catch (error) {
      replaceChildren(messages, problemCard(what, problemOf(error)));
    }
  };
  const logId = freshId();
  const log = new JobLog(client, job.jobID, name, logId);
  log.element.hidden = true;
  const logButton = h(
    "button",
    {
      type: "button",
      class: "button quiet",
      aria: { expanded: "false", controls: logId, label: `Log of ${name}` },
      onclick: () => {
        const opens = log.element.hidden;
        log.element.hidden = !opens;
        logButton.setAttribute("aria-expanded", String(opens));
        if (opens) log.open(() => isActive(job));
        else log.close();
      },
    },
    "Log",
  );
  const dismiss = confirmTextButton("Dismiss", `Dismiss ${name}`, () => {
    void guarded("The job was not dismissed", () => actions.dismiss(job));
  });
  const restart = h(
    "button",
    {
      type: "button",
      class: "button",
      aria: { label: `Start again: ${name}` },
      onclick: () => void guarded("The job was not started", () => actions.restart(job)),
    },
    "Start again",
  );
  const forget = confirmTextButton("Forget", `Forget ${name} and its results`, () => {
    void guarded("The job was not forgotten", () => actions.forget(job));
  });
  const downloads = h("span", { class: "job-downloads" });
  const frames = h("div", { class: "job-frames", hidden: true });
  const session = job.request.session;
  const buttons = h(
    "div",
    { class: "job-actions" },
    downloads,
    restart,
    dismiss,
    withSession &&
      session !== undefined &&
      h(
        "a",
        { class: "button quiet", href: sessionUrl(session), aria: { label: `Session of ${name}` } },
        "Session",
      ),
    logButton,
    forget,
  );

  const download = (file: ResultFile): HTMLElement => {
    const url = client.jobResultUrl(job.jobID, file.name);
    const format = job.request.output?.format;
    // The clouds of an animation are numbered.
    const [, number = "", extension = ""] = /(_\d+)?(\.[^.]+)$/.exec(file.name) ?? [];
    const saved = `${job.request.name || "result"}${number}${extension}`;
    const plain = format ? `Download ${FORMAT_NAMES[format]}` : "Download";
    const words = number === "" ? plain : `No. ${Number(number.slice(1))}`;
    const size = h("span", { class: "job-size" }, formatBytes(file.bytes));
    const link = h(
      "a",
      {
        class: "button tinted",
        href: url,
        download: saved,
        title: saved,
        aria: { label: `${words} ${formatBytes(file.bytes)}, ${saved}` },
        onclick: (event) => {
          if (client.token() === null) return;
          // A link carries no token: the file is fetched, and then saved.
          event.preventDefault();
          if (link.getAttribute("aria-busy") === "true") return;
          link.setAttribute("aria-busy", "true");
          void guarded("The result cannot be fetched", async () =>
            saveFile(await client.file(url), saved),
          ).then(() => link.removeAttribute("aria-busy"));
        },
      },
      icon("download"),
      words,
      " ",
      size,
    );
    return link;
  };
  let isAsked = false;
  const listResults = async (): Promise<void> => {
    if (isAsked) return;
    isAsked = true;
    // Not with each news of the job: whoever reads why asks again.
    const again = h(
      "button",
      {
        type: "button",
        class: "button",
        aria: { label: `List the results of ${name} again` },
        onclick: () => {
          isAsked = false;
          void listResults();
        },
      },
      "List results",
    );
    replaceChildren(downloads, again);
    again.hidden = true;
    await guarded("The results cannot be listed", async () => {
      const { results } = await client.jobResults(job.jobID);
      const isAnimation = results.length > 1;
      frames.hidden = !isAnimation;
      replaceChildren(downloads);
      replaceChildren(isAnimation ? frames : downloads, ...results.map(download));
    });
    again.hidden = false;
  };

  const element = h(
    "li",
    { class: "job-row", data: { job: job.jobID } },
    h(
      "div",
      { class: "job-text" },
      h("div", { class: "job-head" }, dot, h("h3", { title: name }, name), status),
      terms,
    ),
    buttons,
    standing,
    summary,
    frames,
    bar,
    log.element,
    messages,
  );
  const update = (next: Job): void => {
    const focused = buttons.contains(document.activeElement);
    const wasActive = isActive(job);
    job = next;
    element.dataset["status"] = job.status;
    dot.className = `job-dot ${job.status}`;
    const part = job.status === "running" ? ` · ${job.progress} %` : "";
    setText(status, STATUS_NAMES[job.status] + part);
    const when = formatAge(job.finished ?? job.created);
    setText(terms, [termsText(job), when].filter(Boolean).join(" · "));
    bar.hidden = job.status !== "running";
    bar.value = job.progress;
    setText(standing, standingText(job));
    standing.hidden = standing.textContent === "";
    const ended = !isActive(job);
    dismiss.hidden = ended;
    restart.hidden = job.status !== "failed" && job.status !== "dismissed";
    forget.hidden = !ended;
    downloads.hidden = job.status !== "successful";
    showSummary();
    if (job.status === "successful") void listResults();
    if (!wasActive && !ended && !log.element.hidden) log.open(() => isActive(job));
    // A button that goes takes the focus with it.
    if (focused && !buttons.contains(document.activeElement)) logButton.focus();
  };
  let said = "";
  const showSummary = (): void => {
    const lines = job.status === "successful" && job.report ? reportText(job.report) : [];
    const reason = job.status === "failed" ? job.message : "";
    const all = JSON.stringify([reason, lines]);
    if (all === said) return;
    said = all;
    replaceChildren(
      summary,
      reason !== "" && h("p", { class: "job-failure" }, sentence(reason)),
      ...lines.map((line) => h("p", {}, line)),
    );
    summary.hidden = reason === "" && lines.length === 0;
  };
  summary.hidden = true;
  update(job);
  return { element, update, close: () => log.close() };
}

/** The server's words as a sentence. */
function sentence(text: string): string {
  const begun = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(begun) ? begun : `${begun}.`;
}
