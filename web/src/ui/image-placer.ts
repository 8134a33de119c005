import type { Vec2 } from "../api/types";
import type { ScreenSize } from "../scene/view-matrix";
import { h } from "./dom";

export interface ImagePlacer {
  /** Where the image lies over the picture: its upper left corner and its size, in pixels. */
  readonly place: { corner: Vec2; size: ScreenSize };
  remove(): void;
}

const LEAST_PX = 16;
const STEP_PX = 8;
/** So much of the image stays within the picture, so that it can be taken hold of. */
export const KEPT_PX = 32;

/** The corner nearest to the wanted one that keeps some of the image within the room. */
export function keptWithin(corner: Vec2, size: ScreenSize, room: ScreenSize): Vec2 {
  const keep = (at: number, length: number, available: number): number => {
    const kept = Math.min(KEPT_PX, length, available);
    return Math.min(available - kept, Math.max(kept - length, at));
  };
  return [keep(corner[0], size.width, room.width), keep(corner[1], size.height, room.height)];
}

/** Lays a translucent image over the picture, to be moved by its face and sized by its corner, or by the arrow keys, + and -. */
export function createImagePlacer(stage: HTMLElement, image: ImageBitmap): ImagePlacer {
  const room = { width: stage.clientWidth, height: stage.clientHeight };
  const aspect = image.width / image.height;
  let width = Math.max(LEAST_PX, Math.min(0.5 * room.width, 0.5 * room.height * aspect));
  let corner: Vec2 = [(room.width - width) / 2, (room.height - width / aspect) / 2];
  const canvas = h("canvas", { width: image.width, height: image.height });
  canvas.getContext("2d")?.drawImage(image, 0, 0);
  const grip = h("span", { class: "placer-grip", aria: { hidden: "true" } });
  const element = h(
    "div",
    {
      class: "image-placer",
      tabIndex: 0,
      role: "group",
      aria: { label: "Image over the view. Arrow keys move it, plus and minus size it." },
    },
    canvas,
    grip,
  );
  const show = (): void => {
    corner = keptWithin(
      corner,
      { width, height: width / aspect },
      { width: stage.clientWidth, height: stage.clientHeight },
    );
    Object.assign(element.style, {
      left: `${corner[0]}px`,
      top: `${corner[1]}px`,
      width: `${width}px`,
      height: `${width / aspect}px`,
    });
  };
  const move = (x: number, y: number): void => {
    corner = [corner[0] + x, corner[1] + y];
    show();
  };
  /** About its upper left corner, or, with keys, about its middle. */
  const size = (next: number, aboutMiddle: boolean): void => {
    const wanted = Math.max(LEAST_PX, LEAST_PX * aspect, next);
    if (aboutMiddle) corner = [corner[0] + (width - wanted) / 2, corner[1] + (width - wanted) / aspect / 2];
    width = wanted;
    show();
  };
  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    element.focus({ preventScroll: true });
    element.setPointerCapture(event.pointerId);
    const sizing = event.target === grip;
    let last: Vec2 = [event.clientX, event.clientY];
    const drag = (to: PointerEvent): void => {
      if (to.pointerId !== event.pointerId) return;
      const by: Vec2 = [to.clientX - last[0], to.clientY - last[1]];
      last = [to.clientX, to.clientY];
      if (sizing) size(width + Math.max(by[0], by[1] * aspect), false);
      else move(...by);
    };
    const end = new AbortController();
    const { signal } = end;
    element.addEventListener("pointermove", drag, { signal });
    element.addEventListener("pointerup", () => end.abort(), { signal });
    element.addEventListener("pointercancel", () => end.abort(), { signal });
  });
  const keys: Record<string, () => void> = {
    ArrowLeft: () => move(-STEP_PX, 0),
    ArrowRight: () => move(STEP_PX, 0),
    ArrowUp: () => move(0, -STEP_PX),
    ArrowDown: () => move(0, STEP_PX),
    "+": () => size(width * 1.05, true),
    "-": () => size(width / 1.05, true),
  };
  element.addEventListener("keydown", (event) => {
    const act = keys[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  });
  show();
  stage.append(element);
  const resized = new ResizeObserver(show);
  resized.observe(stage);
  return {
    get place() {
      return { corner, size: { width, height: width / aspect } };
    },
    remove: () => {
      resized.disconnect();
      element.remove();
    },
  };
}
