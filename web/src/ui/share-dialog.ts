import type { ApiClient } from "../api/client";
import { shareUrl } from "../api/token";
import type { Share } from "../api/types";
import { reportError } from "../edits/errors";
import type { Bus, SessionStore } from "../session-store";
import { h, replaceChildren } from "./dom";
import { icon } from "./icons";

const SCOPES = { view: "may look", edit: "may edit" } as const;

/** Links that open this session to whoever has them: made, copied, revoked. */
export async function showShareDialog(bus: Bus, client: ApiClient, store: SessionStore): Promise<void> {
  const list = h("div", { class: "sheet-body", aria: { live: "polite" } });
  const guarded = async (action: () => Promise<void>): Promise<void> => {
    try {
      await action();
    } catch (error) {
      reportError(bus, error, "The links cannot be changed");
    }
  };
  const made = new Map<string, string>();
  const copy = async (url: string): Promise<void> => {
    await navigator.clipboard.writeText(url);
    bus.fire("toast", { kind: "success", title: "Link copied" });
  };
  const row = (share: Share): HTMLElement => {
    const url = made.get(share.id);
    const made_at = new Date(share.created).toLocaleString("en");
    return h(
      "div",
      { class: "share-row" },
      h("span", {}, `Whoever has it ${SCOPES[share.scope]}; made ${made_at}`),
      // A capability is told once: older links can only be revoked.
      ...(url === undefined
        ? []
        : [
            h("input", { readOnly: true, value: url, aria: { label: "The link" } }),
            h(
              "button",
              { type: "button", class: "button", onclick: () => void guarded(() => copy(url)) },
              "Copy",
            ),
          ]),
      h(
        "button",
        {
          type: "button",
          class: "button",
          onclick: () =>
            void guarded(async () => {
              await client.revokeShare(store.id, share.id);
              await refresh();
            }),
        },
        "Revoke",
      ),
    );
  };
  const refresh = async (): Promise<void> => {
    const shares = await client.shares(store.id);
    replaceChildren(
      list,
      ...(shares.length > 0 ? shares.map(row) : [h("p", { class: "hint" }, "No link was made yet.")]),
    );
  };
  const make = (scope: "view" | "edit", label: string): HTMLElement =>
    h(
      "button",
      {
        type: "button",
        class: "button primary",
        data: { scope },
        onclick: () =>
          void guarded(async () => {
            const share = await client.createShare(store.id, scope);
            made.set(share.id, shareUrl(client.url(""), store.id, share.capability));
            await refresh();
          }),
      },
      label,
    );
  const dialog = h(
    "dialog",
    { class: "sheet share-sheet", aria: { label: "Share this session" }, onclose: () => dialog.remove() },
    h(
      "div",
      { class: "sheet-head" },
      h("h2", {}, "Share this session"),
      h(
        "button",
        { type: "button", class: "icon-button", aria: { label: "Close" }, onclick: () => dialog.close() },
        icon("close"),
      ),
    ),
    h("div", { class: "share-make" }, make("view", "Link to look"), make("edit", "Link to edit")),
    list,
  );
  document.body.append(dialog);
  dialog.showModal();
  await guarded(refresh);
}
