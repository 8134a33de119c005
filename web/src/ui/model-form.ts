import type { ApiClient } from "../api/client";
import type { CloudDocument, RegionName } from "../api/types";
import { reportError } from "../edits/errors";
import type { RegionEditor } from "../edits/regions";
import { placement } from "../math/matrix";
import { isFiniteVec3 } from "../math/vec3";
import type { Bus, SessionStore } from "../session-store";
import { h, replaceChildren } from "./dom";
import { numberField, selectField, vectorField } from "./fields";
import { formatCount } from "./format";

/**
 * Regions by another cloud of the server: what is near its samples, once it is placed. The list of clouds is fetched anew
 * whenever the `holder` is opened.
 */
export function createModelForm(
  bus: Bus,
  client: ApiClient,
  store: SessionStore,
  regions: RegionEditor,
  holder: HTMLDetailsElement,
): HTMLElement {
  let region: RegionName = "one";
  const cloud = selectField("Model", [["", "…"]], "", () => undefined);
  const into = selectField(
    "Region",
    [
      ["zero", "Zero (stays)"],
      ["one", "One (moves)"],
    ],
    region,
    (value) => {
      region = value;
    },
  );
  const thickness = numberField("Thickness", 2 * store.document.spacing, { unit: "units" });
  const move = vectorField("Moved by", [0, 0, 0]);
  const turn = vectorField("Turned about x, y, z in degrees", [0, 0, 0]);
  const size = numberField("Scaled by", 1, { unit: "×" });
  const empty = h("p", { class: "hint", hidden: true }, "The server has no clouds to choose from.");
  const apply = h("button", { type: "submit", class: "button" }, "Apply model");
  const send = async (): Promise<void> => {
    const wrong = [thickness, size].find(({ value }) => !(value > 0)) ?? null;
    const vector = [move, turn].find(({ value }) => !isFiniteVec3(value)) ?? null;
    const fault = wrong?.input ?? vector?.fields.find(({ value }) => !Number.isFinite(value))?.input;
    if (fault) {
      fault.setAttribute("aria-invalid", "true");
      fault.focus();
      return;
    }
    const shape = {
      type: "model",
      cloud: cloud.select.value,
      matrix: placement(move.value, turn.value, size.value),
      thickness: thickness.value,
    } as const;
    const document = await regions.paint(region, [{ mode: "add", shape, steal: true }]);
    if (document?.changed === 0) bus.fire("toast", { kind: "info", title: "The model lies near nothing" });
  };
  const load = async (): Promise<void> => {
    try {
      const clouds = await client.clouds();
      const text = (each: CloudDocument): string =>
        `${each.name || "Unnamed"}, ${formatCount(each.sample_count)}${each.id === store.document.cloud ? " (this one)" : ""}`;
      replaceChildren(cloud.select, ...clouds.map((each) => h("option", { value: each.id }, text(each))));
      empty.hidden = clouds.length > 0;
      apply.disabled = clouds.length === 0;
    } catch (error) {
      reportError(bus, error, "The clouds cannot be listed");
    }
  };
  const form = h(
    "form",
    {
      class: "shape-form",
      onsubmit: (event) => {
        event.preventDefault();
        void send();
      },
    },
    cloud.element,
    empty,
    h("div", { class: "field-row" }, into.element, thickness.element),
    move.element,
    turn.element,
    size.element,
    apply,
  );
  holder.addEventListener("toggle", () => {
    if (holder.open) void load();
  });
  if (holder.open) void load();
  return form;
}
