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
  let range = 0;
  let settings = first;

  const draw = (): void => {
    const name = colormapOf(settings);
    bar.hidden = name === null;
    if (!name) return;
    const context = canvas.getContext("2d");
    const texels = new Uint8ClampedArray(colormapTexels(name, STEPS));
    context?.putImageData(new ImageData(texels, STEPS, 1), 0, 0);
    const isDetail = settings.mode === "detail";
    setText(title, isDetail ? "Detail, model units" : "Scale parameter t");
    const labels = isDetail ? [formatScalar(-range), "0", formatScalar(range)] : ["0", "0.5", "1"];
    replaceChildren(ticks, ...labels.map((label) => h("span", {}, label)));
    bar.setAttribute(
      "aria-label",
      `Colours: ${isDetail ? "detail" : "scale parameter t"} from ${labels[0]} to ${labels[2]}`,
    );
  };
  bus.on("display.changed", (next) => {
    settings = next;
    draw();
  });
  bus.on("detail.range", (next) => {
    range = next;
    draw();
  });
  draw();
  return bar;
}
