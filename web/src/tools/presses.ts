/**
 * Hears presses on the way down to the canvas, so that one that paints never reaches the camera. What else a gesture wants to
 * hear takes the controller's signal: aborting it ends all.
 */
export function hearPresses(canvas: HTMLElement, down: (event: PointerEvent) => void): AbortController {
  const listeners = new AbortController();
  const holder = canvas.parentElement ?? canvas;
  holder.addEventListener("pointerdown", down, { signal: listeners.signal, capture: true });
  return listeners;
}
