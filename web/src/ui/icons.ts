/** The viewer's own icons: strokes on a grid of 20. */
const PATHS = {
  orbit: [
    "M10 16.5a6.5 6.5 0 1 0 0-13 6.5 6.5 0 0 0 0 13Z",
    "M3.5 10c0 1.5 2.9 2.6 6.5 2.6s6.5-1.1 6.5-2.6M10 3.5c-1.5 0-2.6 2.9-2.6 6.5s1.1 6.5 2.6 6.5",
  ],
  brush: [
    "M16.8 3.2c-2.6.9-6.4 4.2-8.3 7.1l1.6 1.6c2.9-1.9 5.9-5.9 6.7-8.7Z",
    "M7.4 11.6c-1.7-.1-2.9.9-3.2 2.6-.2 1.1-.7 1.8-1.7 2.2 2.9 1.2 6 .3 6.3-2.7",
  ],
  anchor: [
    "M10 6.5v10.5M4 11.5c0 3.3 2.7 5.5 6 5.5s6-2.2 6-5.5M7 9.5h6",
    "M10 6.5a1.9 1.9 0 1 0 0-3.8 1.9 1.9 0 0 0 0 3.8Z",
  ],
  eraser: [
    "M8 16.5 3.6 12.1a1.5 1.5 0 0 1 0-2.1l6.4-6.4a1.5 1.5 0 0 1 2.1 0l4.3 4.3a1.5 1.5 0 0 1 0 2.1L9.9 16.5H8ZM6.8 6.8l6.4 6.4M8 16.5h9",
  ],
  move: [
    "M10 3v14M10 3 7.5 5.5M10 3l2.5 2.5M3 10h14",
    "M17 10l-2.5-2.5M17 10l-2.5 2.5M3 10l2.5-2.5M3 10l2.5 2.5M10 17l-2.5-2.5M10 17l2.5-2.5",
  ],
  rotate: ["M16.5 10a6.5 6.5 0 1 1-2-4.7L16.5 7.2", "M16.5 3v4.2h-4.2"],
  scale: ["M3.5 11v5.5H9V11H3.5Z", "M6 8V3.5h10.5V14H12", "M11 9l3-3M11.2 6H14v2.8"],
  twist: [
    "M6 3c0 4 8 5 8 9.5 0 2-1 3.4-2.5 4.5",
    "M14 3c0 4-8 5-8 9.5 0 2 1 3.4 2.5 4.5",
    "M7.4 6h5.2M7.2 13h5.6",
  ],
  normal: ["M3 16c2-5 12-5 14 0", "M10 12V3M10 3 7.5 5.5M10 3l2.5 2.5M5.4 12.6 3 8.5M14.6 12.6 17 8.5"],
  frame: ["M3 7V3h4M13 3h4v4M17 13v4h-4M7 17H3v-4", "M10 12.2a2.2 2.2 0 1 0 0-4.4 2.2 2.2 0 0 0 0 4.4Z"],
  toward: [
    "M10 12.2a2.2 2.2 0 1 0 0-4.4 2.2 2.2 0 0 0 0 4.4Z",
    "M3 3l4 4M7 4v3H4M17 17l-4-4M13 16v-3h3M17 3l-4 4M13 4v3h3M3 17l4-4M4 13h3v3",
  ],
  lasso: [
    "M7 13.2C4.6 12.5 3 10.8 3 8.8 3 6 6.1 3.7 10 3.7S17 6 17 8.8 13.9 13.9 10 13.9c-.5 0-.9 0-1.4-.1",
    "M7.2 14.8a1.6 1.6 0 1 0 0-3.2 1.6 1.6 0 0 0 0 3.2ZM6.8 14.8c.3 1.3-.2 2.1-1.3 2.7",
  ],
  polygon: ["M4 7.5 10.5 3.5 16.5 8 14 16H6Z", "M4 7.5v.01M10.5 3.5v.01M16.5 8v.01M14 16v.01M6 16v.01"],
  rectangle: ["M3.5 5h13v10h-13Z"],
  ellipse: ["M10 15.5c3.9 0 7-2.5 7-5.5s-3.1-5.5-7-5.5S3 7 3 10s3.1 5.5 7 5.5Z"],
  line: [
    "M4 16 16 4",
    "M4 17.3a1.3 1.3 0 1 0 0-2.6 1.3 1.3 0 0 0 0 2.6ZM16 5.3a1.3 1.3 0 1 0 0-2.6 1.3 1.3 0 0 0 0 2.6Z",
  ],
  flood: [
    "M8.5 3.5 15.5 10.5 9 16.5 3.5 11Z",
    "M8.5 3.5 6.5 2M3.5 11h11.5",
    "M17 13.5c-.9 1.2-1.3 1.9-1.3 2.5a1.3 1.3 0 0 0 2.6 0c0-.6-.4-1.3-1.3-2.5Z",
  ],
  minus: ["M4 10h12"],
  keep: ["M7.5 14.5a4.5 4.5 0 1 0 0-9 4.5 4.5 0 0 0 0 9ZM12.5 14.5a4.5 4.5 0 1 0 0-9 4.5 4.5 0 0 0 0 9Z"],
  visible: [
    "M2.5 10c1.6-3 4.3-4.8 7.5-4.8s5.9 1.8 7.5 4.8c-1.6 3-4.3 4.8-7.5 4.8S4.1 13 2.5 10Z",
    "M10 12.2a2.2 2.2 0 1 0 0-4.4 2.2 2.2 0 0 0 0 4.4Z",
  ],
  more: ["M4.5 10v.01M10 10v.01M15.5 10v.01"],
  up: ["M6 12l4-4 4 4"],
  play: ["M6.5 4.5v11l9-5.5Z"],
  pause: ["M7 4.5v11M13 4.5v11"],
  undo: ["M7 4 3.5 7.5 7 11", "M3.5 7.5H12a4.5 4.5 0 0 1 0 9H8"],
  redo: ["M13 4l3.5 3.5L13 11", "M16.5 7.5H8a4.5 4.5 0 0 0 0 9h4"],
  link: [
    "M8.3 11.7a3.3 3.3 0 0 0 4.7 0l2.6-2.6a3.3 3.3 0 0 0-4.7-4.7l-.9.9",
    "M11.7 8.3a3.3 3.3 0 0 0-4.7 0l-2.6 2.6a3.3 3.3 0 0 0 4.7 4.7l.9-.9",
  ],
  export: [
    "M10 3v9.5M10 3 6.5 6.5M10 3l3.5 3.5",
    "M3.5 12.5v3a1.5 1.5 0 0 0 1.5 1.5h10a1.5 1.5 0 0 0 1.5-1.5v-3",
  ],
  download: [
    "M10 3v9.5M10 12.5 6.5 9M10 12.5 13.5 9",
    "M3.5 13v2.5A1.5 1.5 0 0 0 5 17h10a1.5 1.5 0 0 0 1.5-1.5V13",
  ],
  upload: ["M10 13.5V4M10 4 6 8M10 4l4 4", "M3.5 13v2.5A1.5 1.5 0 0 0 5 17h10a1.5 1.5 0 0 0 1.5-1.5V13"],
  help: [
    "M7.7 7.6a2.4 2.4 0 1 1 3.5 2.1c-.8.4-1.2.9-1.2 1.8",
    "M10 14.2v.2",
    "M10 17.5a7.5 7.5 0 1 0 0-15 7.5 7.5 0 0 0 0 15Z",
  ],
  close: ["M5 5l10 10M15 5 5 15"],
  check: ["M4 10.5 8 14.5 16 6"],
  trash: ["M4 6h12M8 6V4h4v2M5.5 6l.7 10.5h7.6L14.5 6M8.5 9v5M11.5 9v5"],
  plus: ["M10 4v12M4 10h12"],
  chevron: ["M6 8l4 4 4-4"],
  pivot: ["M10 3v4M10 13v4M3 10h4M13 10h4", "M10 12.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5Z"],
} as const;

export type IconName = keyof typeof PATHS;

const SVG = "http://www.w3.org/2000/svg";

export function icon(name: IconName): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 20 20");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  for (const d of PATHS[name]) {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("d", d);
    svg.append(path);
  }
  return svg;
}

/** The mark: samples of a surface, one of them lifted. */
export function logo(): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("class", "logo");
  svg.setAttribute("aria-hidden", "true");
  const dots: [number, number, number, string][] = [
    [3.5, 17.5, 1.6, "logo-dot"],
    [8, 15.8, 1.7, "logo-dot"],
    [12, 11, 1.9, "logo-dot"],
    [16, 15.8, 1.7, "logo-dot"],
    [20.5, 17.5, 1.6, "logo-dot"],
    [12, 4.6, 2.3, "logo-lift"],
  ];
  for (const [cx, cy, r, name] of dots) {
    const dot = document.createElementNS(SVG, "circle");
    dot.setAttribute("cx", String(cx));
    dot.setAttribute("cy", String(cy));
    dot.setAttribute("r", String(r));
    dot.setAttribute("class", name);
    svg.append(dot);
  }
  return svg;
}
