import type { Vec2 } from "../api/types";

const SVG = "http://www.w3.org/2000/svg";

/** What is drawn over the picture, in its pixels. */
export type ScreenCurve =
  | { kind: "path"; points: readonly Vec2[]; closed: boolean; corners?: boolean }
  | { kind: "ellipse"; center: Vec2; halfAxes: Vec2 }
  | { kind: "band"; points: readonly Vec2[]; width: number };

export type CurveTone = "zero" | "one" | "remove" | "intersect";

const text = (value: number): string => value.toFixed(1);

/** The commands of an SVG path. */
export function pathOf(curve: ScreenCurve): string {
  if (curve.kind === "ellipse") {
    const [x, y] = curve.center;
    const [a, b] = curve.halfAxes;
    const arc = `A${text(a)} ${text(b)} 0 1 0`;
    return `M${text(x - a)} ${text(y)}${arc} ${text(x + a)} ${text(y)}${arc} ${text(x - a)} ${text(y)}Z`;
  }
  const line = curve.points.map(([x, y], i) => `${i === 0 ? "M" : "L"}${text(x)} ${text(y)}`).join("");
  return curve.kind === "path" && curve.closed && curve.points.length > 0 ? `${line}Z` : line;
}

/** The outline that the hand draws, over the picture: two strokes, so that it shows on dark and on light. */
export class OutlineLayer {
  private readonly svg_ = document.createElementNS(SVG, "svg");
  private readonly area_ = document.createElementNS(SVG, "path");
  private readonly under_ = document.createElementNS(SVG, "path");
  private readonly over_ = document.createElementNS(SVG, "path");
  private readonly corners_ = document.createElementNS(SVG, "path");
  private frameRevision_ = 0;
  private until_: number | null = null;

  constructor(container: HTMLElement) {
    this.svg_.setAttribute("class", "outline-layer");
    this.svg_.setAttribute("aria-hidden", "true");
    this.area_.setAttribute("class", "outline-area");
    this.under_.setAttribute("class", "outline-under");
    this.over_.setAttribute("class", "outline-over");
    this.corners_.setAttribute("class", "outline-corners");
    this.svg_.append(this.area_, this.under_, this.over_, this.corners_);
    container.append(this.svg_);
    this.clear();
  }

  draw(curve: ScreenCurve, tone: CurveTone): void {
    this.until_ = null;
    const d = pathOf(curve);
    this.svg_.dataset["tone"] = tone;
    this.svg_.classList.remove("sent");
    this.svg_.toggleAttribute("hidden", false);
    for (const path of [this.area_, this.under_, this.over_]) path.setAttribute("d", d);
    const band = curve.kind === "band";
    this.area_.classList.toggle("band", band);
    this.area_.setAttribute("stroke-width", band ? text(Math.max(1, curve.width)) : "0");
    const corners = curve.kind === "path" && curve.corners ? curve.points.slice(0, -1) : [];
    this.corners_.setAttribute(
      "d",
      corners.map(([x, y]) => `M${text(x - 3)} ${text(y - 3)}h6v6h-6Z`).join(""),
    );
  }

  /** The outline rests until a frame of `revision` or later is on the screen. */
  clearAtRevision(revision: number): void {
    this.until_ = revision;
    this.frameShown(this.frameRevision_);
  }

  /** The hand has lifted: what was drawn waits for the server. */
  rest(): void {
    this.svg_.classList.add("sent");
  }

  frameShown(revision: number): void {
    this.frameRevision_ = revision;
    if (this.until_ !== null && revision >= this.until_) this.clear();
  }

  clear(): void {
    this.until_ = null;
    this.svg_.toggleAttribute("hidden", true);
    for (const path of [this.area_, this.under_, this.over_, this.corners_]) path.setAttribute("d", "");
  }
}
