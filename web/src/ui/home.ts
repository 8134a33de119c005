import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { CloudDocument, ServiceInfo, SessionSummary } from "../api/types";
import { defaultPreview } from "../edits/preview-size";
import { DEFAULT_SCALES } from "../edits/scales";
import { sessionUrl } from "../link";
import { createCloudCard } from "./cloud-card";
import { h, replaceChildren, setText } from "./dom";
import { icon, logo } from "./icons";
import { createJobsSection } from "./jobs-section";
import { problemCard } from "./problem-card";
import { createUploader } from "./uploader";

/** The first page: what clouds the server holds, and how to bring another one. */
export async function showHome(root: HTMLElement, client: ApiClient, info: ServiceInfo): Promise<void> {
  const list = h("div", { class: "cloud-list", aria: { busy: "true" } });
  const count = h("span", { class: "section-aside" });
  const messages = h("div", { class: "home-messages", aria: { live: "polite" } });
  const uploader = createUploader(
    client,
    (cloud) => void open(cloud, DEFAULT_SCALES, defaultPreview(cloud.sample_count)),
  );

  const open = async (cloud: CloudDocument, scales: number[], preview?: number): Promise<void> => {
    try {
      const options = { name: cloud.name, scales, ...(preview === undefined ? {} : { preview }) };
      location.assign(sessionUrl((await client.createSession(cloud.id, options)).id));
    } catch (error) {
      replaceChildren(messages, problemCard("No session could be started", problemOf(error)));
    }
  };
  const act = async (what: string, action: () => Promise<void>): Promise<void> => {
    try {
      await action();
      replaceChildren(messages);
    } catch (error) {
      replaceChildren(messages, problemCard(what, problemOf(error)));
    }
    await refresh();
  };
  const refresh = async (): Promise<void> => {
    try {
      const [clouds, sessions] = await Promise.all([client.clouds(), client.sessions()]);
      setText(count, clouds.length === 1 ? "1 cloud" : `${clouds.length} clouds`);
      const newest = [...clouds].sort((a, b) => b.created.localeCompare(a.created));
      const cards = newest.map((cloud) =>
        createCloudCard({
          cloud,
          sessions: sessionsOf(cloud, sessions),
          start: (scales, preview) => open(cloud, scales, preview),
          removeCloud: () => act("The cloud was not deleted", () => client.deleteCloud(cloud.id)),
          removeSession: (id) => act("The session was not deleted", () => client.deleteSession(id)),
        }),
      );
      replaceChildren(list, ...(cards.length > 0 ? cards : [emptyNote()]));
    } catch (error) {
      replaceChildren(list, problemCard("The clouds cannot be listed", problemOf(error)));
    }
    list.setAttribute("aria-busy", "false");
  };

  replaceChildren(
    root,
    h(
      "div",
      { class: "home" },
      h("header", { class: "home-head" }, h("div", { class: "brand" }, logo(), h("span", {}, "Pointwright"))),
      h(
        "main",
        { class: "home-main" },
        h(
          "div",
          { class: "home-intro" },
          h("h1", {}, "Edit point clouds at several scales"),
          h(
            "p",
            {},
            "Paint what stays and what moves, drag, and the fine detail follows. The samples are the model: nothing is meshed.",
          ),
        ),
        uploader.element,
        messages,
        createJobsSection(client, info),
        h(
          "section",
          { class: "home-clouds", aria: { label: "Clouds on this server" } },
          h("div", { class: "home-title" }, h("h2", {}, "On this server"), count),
          list,
        ),
      ),
    ),
  );
  await refresh();
}

function sessionsOf(cloud: CloudDocument, sessions: readonly SessionSummary[]): SessionSummary[] {
  return sessions
    .filter((session) => session.cloud === cloud.id)
    .sort((a, b) => b.created.localeCompare(a.created));
}

function emptyNote(): HTMLElement {
  return h(
    "div",
    { class: "empty-note" },
    icon("upload"),
    h("p", {}, "No clouds yet. Drop a file above to begin."),
  );
}
