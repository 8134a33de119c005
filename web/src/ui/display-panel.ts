import type { SessionDocument } from "../api/types";
import { levelName } from "../edits/scales";
import { DEFAULT_DISPLAY, type DisplayMode, type DisplaySettings } from "../scene/display";
import type { Bus } from "../session-store";
import { append, h } from "./dom";
import { checkField, rangeField, selectField } from "./fields";
import { createSection } from "./section";

export interface DisplayPanelOptions {
  settings: DisplaySettings;
  hasColor: () => boolean;
  up: "y" | "z";
  onUp: (up: "y" | "z") => void;
}

/** What is shown and how. */
export function createDisplayPanel(
  bus: Bus,
  session: SessionDocument,
  options: DisplayPanelOptions,
): HTMLElement {
  const section = createSection("Display");
  let settings = options.settings;
  const change = (part: Partial<DisplaySettings>): void => {
    settings = { ...settings, ...part };
    bus.fire("display.changed", settings);
  };
  const mode = selectField<DisplayMode>(
    "Show",
    [
      ["shaded", "Shaded"],
      ["color", "Colours"],
      ["normals", "Normals"],
      ["t", "Scale t"],
      ["detail", "Signed detail"],
      ["stretch", "Stretch"],
    ],
    settings.mode,
    (value) => change({ mode: value }),
  );
  const levels = [
    ["full", "Full surface"] as const,
    ...session.levels
      .slice(0, -1)
      .map((level) => [String(level.level), levelName(level, session.diagonal)] as const),
  ];
  const level = selectField<string>(
    "Level",
    levels,
    settings.level === null ? "full" : String(settings.level),
    (value) => change({ level: value === "full" ? null : Number(value) }),
  );
  const size = rangeField(
    "Splat size",
    { min: 0.4, max: 2.5, step: 0.05 },
    settings.splatSize,
    (value) => `${Math.round(value * 100)} %`,
    (splatSize) => change({ splatSize }),
  );
  const up = selectField(
    "Up axis",
    [
      ["y", "Y"],
      ["z", "Z"],
    ],
    options.up,
    options.onUp,
  );
  const tint = checkField("Tint the regions", settings.tintRegions, (tintRegions) => change({ tintRegions }));
  const cues = checkField("Depth cues", settings.depthCues, (depthCues) => change({ depthCues }));
  const safe = checkField("Colour-blind-safe maps", settings.colorBlindSafe, (colorBlindSafe) =>
    change({ colorBlindSafe }),
  );
  append(section.body, [
    h("div", { class: "field-row" }, mode.element, level.element),
    size.element,
    tint.element,
    cues.element,
    safe.element,
    up.element,
  ]);
  bus.on("display.changed", (next) => {
    settings = next;
    mode.select.value = next.mode;
    level.select.value = next.level === null ? "full" : String(next.level);
    tint.input.checked = next.tintRegions;
    cues.input.checked = next.depthCues;
    safe.input.checked = next.colorBlindSafe;
    if (Number(size.input.value) !== next.splatSize) size.set(next.splatSize);
  });
  bus.on("load.changed", () => {
    const colors = mode.select.querySelector<HTMLOptionElement>('option[value="color"]');
    if (colors) colors.disabled = !options.hasColor();
  });
  return section.element;
}

const STORE_KEY = "pointwright.display";

/** The display of the last visit; what cannot be read is left at its default. */
export function loadDisplay(): DisplaySettings {
  try {
    const kept = JSON.parse(localStorage.getItem(STORE_KEY) ?? "{}") as Partial<DisplaySettings>;
    return {
      ...DEFAULT_DISPLAY,
      colorBlindSafe: kept.colorBlindSafe === true,
      depthCues: kept.depthCues !== false,
      splatSize:
        typeof kept.splatSize === "number" && kept.splatSize >= 0.4 && kept.splatSize <= 2.5
          ? kept.splatSize
          : 1,
    };
  } catch {
    return DEFAULT_DISPLAY;
  }
}

export function saveDisplay({ colorBlindSafe, depthCues, splatSize }: DisplaySettings): void {
  try {
    localStorage.setItem(STORE_KEY, JSON.stringify({ colorBlindSafe, depthCues, splatSize }));
  } catch {
    // Storage is a comfort, not a need.
  }
}
