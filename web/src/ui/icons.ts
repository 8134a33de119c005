/** The viewer's own icons: strokes on a grid of 20. */
const PATHS = {
  orbit: ["M10 2.5v15M10 2.5 7.8 4.7M10 2.5l2.2 2.2M10 17.5l-2.2-2.2M10 17.5l2.2-2.2M2.5 10h15M2.5 10l2.2-2.2M2.5 10l2.2 2.2M17.5 10l-2.2-2.2M17.5 10l-2.2 2.2"],
  brush: ["M16.8 3.2c-2.6.9-6.400 4.200-8.300 7.100l1.600 1.600c2.900-1.900 5.900-5.900 6.700-8.700Z", "M7.400 11.600c-1.700-.1-2.900.9-3.200 2.600-.2 1.100-.7 1.800-1.700 2.200 2.900 1.200 6 .3 6.300-2.700"],
  anchor: ["M10 6.500v10.500M4 11.500c0 3.300 2.700 5.500 6 5.500s6-2.200 6-5.500M7 9.500h6", "M10 6.500a1.900 1.900 0 1 0 0-3.800 1.900 1.900 0 0 0 0 3.800Z"],
  eraser: ["M8 16.500 3.600 12.100a1.500 1.500 0 0 1 0-2.100l6.400-6.400a1.500 1.500 0 0 1 2.100 0l4.300 4.300a1.500 1.500 0 0 1 0 2.100L9.900 16.500H8ZM6.800 6.800l6.400 6.400M8 16.500h9"],
  move: ["M10 3v14M10 3 7.500 5.500M10 3l2.500 2.500M3 10h14", "M17 10l-2.500-2.500M17 10l-2.500 2.500M3 10l2.500-2.500M3 10l2.500 2.500M10 17l-2.500-2.500M10 17l2.500-2.500"],
  rotate: ["M16.500 10a6.500 6.500 0 1 1-2-4.700L16.500 7.200", "M16.500 3v4.200h-4.200"],
  frame: ["M3 7V3h4M13 3h4v4M17 13v4h-4M7 17H3v-4", "M10 12.200a2.200 2.200 0 1 0 0-4.400 2.200 2.200 0 0 0 0 4.400Z"],
  undo: ["M7 4 3.500 7.500 7 11", "M3.500 7.500H12a4.500 4.500 0 0 1 0 9H8"],
  redo: ["M13 4l3.500 3.500L13 11", "M16.500 7.500H8a4.500 4.500 0 0 0 0 9h4"],
  link: ["M8.300 11.700a3.300 3.300 0 0 0 4.700 0l2.600-2.600a3.300 3.300 0 0 0-4.700-4.700l-.9.9", "M11.700 8.300a3.300 3.300 0 0 0-4.700 0l-2.600 2.600a3.300 3.300 0 0 0 4.700 4.700l.9-.9"],
  export: ["M10 3v9.500M10 3 6.500 6.500M10 3l3.500 3.500", "M3.500 12.500v3a1.500 1.500 0 0 0 1.500 1.500h10a1.500 1.500 0 0 0 1.500-1.500v-3"],
  upload: ["M10 13.500V4M10 4 6 8M10 4l4 4", "M3.500 13v2.500A1.500 1.500 0 0 0 5 17h10a1.500 1.500 0 0 0 1.500-1.500V13"],
  help: ["M7.700 7.600a2.400 2.400 0 1 1 3.500 2.100c-.8.4-1.200.9-1.200 1.800", "M10 14.200v.2", "M10 17.500a7.500 7.500 0 1 0 0-15 7.500 7.500 0 0 0 0 15Z"],
  close: ["M5 5l10 10M15 5 5 15"],
  check: ["M4 10.500 8 14.500 16 6"],
  trash: ["M4 6h12M8 6V4h4v2M5.500 6l.7 10.500h7.600L14.500 6M8.500 9v5M11.500 9v5"],
  plus: ["M10 4v12M4 10h12"],
  chevron: ["M6 8l4 4 4-4"],
  pivot: ["M10 3v4M10 13v4M3 10h4M13 10h4", "M10 12.500a2.500 2.500 0 1 0 0-5 2.500 2.500 0 0 0 0 5Z"],
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
    [3.5, 17.5, 1.6, "logo-dot"], [8, 15.8, 1.7, "logo-dot"], [12, 11, 1.9, "logo-dot"], [16, 15.8, 1.7, "logo-dot"],
    [20.5, 17.5, 1.6, "logo-dot"], [12, 4.600, 2.3, "logo-lift"],
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
