import type { ApiClient } from "../api/client";
import type { ServiceInfo } from "../api/types";
import { isActive } from "../jobs/job-feed";
import { h, setText } from "./dom";
import { createJobList } from "./job-list";

/** The jobs of all sessions; hidden while there are none, and where they are not for this caller. */
export function createJobsSection(client: ApiClient, { features, caller }: ServiceInfo): HTMLElement {
  const aside = h("span", { class: "section-aside" });
  const list = createJobList(client, {
    most: 3,
    onJobs: (jobs) => {
      section.hidden = jobs.length === 0;
      const active = jobs.filter(isActive).length;
      const all = jobs.length === 1 ? "1 job" : `${jobs.length} jobs`;
      setText(aside, active > 0 ? `${all}, ${active} under way` : all);
    },
  });
  const section = h(
    "section",
    { class: "home-jobs", hidden: true, aria: { label: "Jobs" } },
    h("div", { class: "home-title" }, h("h2", {}, "Jobs"), aside),
    list.element,
  );
  if (!features.includes("jobs") || caller.session !== undefined) return section;
  list.start();
  // A page that is kept for the way back holds no streams meanwhile.
  addEventListener("pagehide", () => list.stop());
  addEventListener("pageshow", ({ persisted }) => persisted && list.start());
  return section;
}
