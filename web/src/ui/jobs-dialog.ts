import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { ServiceInfo } from "../api/types";
import type { Bus, SessionStore } from "../session-store";
import { h, replaceChildren, setText } from "./dom";
import { icon } from "./icons";
import { createJobForm } from "./job-form";
import { createJobList, type JobList } from "./job-list";
import { problemCard } from "./problem-card";

/** Why this service takes no jobs of this caller; nothing where it does. */
function refusal({ features, caller }: ServiceInfo): string {
  if (!features.includes("jobs")) return "This server makes no jobs.";
  if (caller.session !== undefined)
    return "A share link opens this session alone. Jobs are started by who has a token of the server.";
  return "";
}

/** The session's edits on a whole scan: what that takes, its start, and the jobs that there are. */
export function showJobsDialog(bus: Bus, client: ApiClient, store: SessionStore): void {
  const body = h(
    "div",
    { class: "jobs-body", aria: { busy: "true" } },
    h("p", { class: "hint" }, "Loading…"),
  );
  const ends: (() => void)[] = [];
  let open = true;
  const dialog = h(
    "dialog",
    {
      class: "sheet jobs-sheet",
      aria: { label: "Full resolution" },
      onclose: () => {
        open = false;
        for (const end of ends) end();
        dialog.remove();
      },
    },
    h(
      "div",
      { class: "sheet-head" },
      h("h2", {}, "Full resolution"),
      h(
        "button",
        { type: "button", class: "icon-button", aria: { label: "Close" }, onclick: () => dialog.close() },
        icon("close"),
      ),
    ),
    body,
  );
  const fill = async (): Promise<void> => {
    const [info, clouds, uploads] = await Promise.all([
      client.info(),
      client.clouds().catch(() => []),
      client.uploads().catch(() => []),
    ]);
    if (!open) return;
    const refused = refusal(info);
    if (refused !== "") {
      replaceChildren(body, h("p", { class: "jobs-intro" }, refused));
      return;
    }
    const intro = h("p", { class: "jobs-intro" });
    const empty = h("p", { class: "hint" }, "None yet. They go on when this window is closed.");
    const list: JobList = createJobList(client, {
      session: store.id,
      most: 5,
      onJobs: (jobs) => {
        empty.hidden = jobs.length > 0;
      },
    });
    const form = createJobForm(
      client,
      store.document,
      { clouds, uploads, launchers: info.launchers },
      (job) => list.take(job),
    );
    const refresh = (): void => {
      const { head } = store.document.history;
      const edits = head === 1 ? "The edit of this session is" : `The ${head} edits of this session are`;
      setText(
        intro,
        head === 0
          ? "The edits of this session can be made on every sample of a scan."
          : `${edits} made on every sample of the scan, with all of its fine detail. Nothing in the session changes.`,
      );
      const mayNot = info.caller.scope === "view" ? "Your token may look at jobs, not start them." : "";
      form.setObstacle(head === 0 ? "There is no edit yet: move something and apply it first." : mayNot);
    };
    ends.push(bus.on("session.changed", refresh), () => list.stop());
    refresh();
    replaceChildren(
      body,
      intro,
      form.element,
      h(
        "section",
        { class: "jobs-section", aria: { label: "Jobs of this session" } },
        h("h3", {}, "Jobs of this session"),
        empty,
        list.element,
      ),
    );
    list.start();
  };
  document.body.append(dialog);
  dialog.showModal();
  fill()
    .catch((error: unknown) =>
      replaceChildren(body, problemCard("The jobs cannot be shown", problemOf(error))),
    )
    .finally(() => body.setAttribute("aria-busy", "false"));
}
