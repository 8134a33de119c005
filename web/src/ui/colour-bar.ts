import { colormapTexels, formatScalar } from "../scene/colormaps";
import { colormapOf, type DisplaySettings } from "../scene/display";
import type { Bus } from "../session-store";
import { h, replaceChildren, setText } from "./dom";

const STEPS = 128;

/** What the colours of a map mean, with their numbers; hidden where colours mean nothing. */
export function createColourBar(bus: Bus, first: DisplaySettings): HTMLElement {
  const canvas = h("canvas", { width: STEPS, height: 1, class: "colour-strip" });
  const title = h("span", { class: "colour-title" });
  const ticks = h("div", { class: "colour-ticks" });
  const bar = h("div", { class: "colour-bar panel", role: "img", hidden: true }, title, canvas, ticks);
  let detail = 0;
  let stretch = 0;
  let settings = first;

  /** What the map is of, and what its ticks say. */
  const legend = (): [string, string[]] => {
    if (settings.mode === "detail")
      return ["Detail, model units", [formatScalar(-detail), "0", formatScalar(detail)]];
    if (settings.mode === "stretch")
      return [
        stretch > 0 ? "Stretch of the samples' cells" : "Stretch: no edit has resampled yet",
        ["1×", "2×", "4× and more"],
      ];
    return ["Scale parameter t", ["0", "0.5", "1"]];
  };
  const draw = (): void => {
    const name = colormapOf(settings);
    bar.hidden = name === null;
    if (!name) return;
    const context = canvas.getContext("2d");
    const texels = new Uint8ClampedArray(colormapTexels(name, STEPS));
    context?.putImageData(new ImageData(texels, STEPS, 1), 0, 0);
    const [what, labels] = legend();
    setText(title, what);
    replaceChildren(ticks, ...labels.map((label) => h("span", {}, label)));
    bar.setAttribute("aria-label", `Colours: ${what}, from ${labels[0]} to ${labels[2]}`);
  };
  bus.on("display.changed", (next) => {
    settings = next;
    draw();
  });
  bus.on("detail.range", (next) => {
    detail = next;
    draw();
  });
  bus.on("stretch.range", (next) => {
    stretch = next;
    draw();
  });
  draw();
  return bar;
}
