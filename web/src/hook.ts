import type { CameraState } from "./scene/camera-math";

/** What `window.pointwright` tells to whoever takes pictures or tests the viewer: described in web/README.md. */
export interface ViewerStatus {
  state: "home" | "building" | "ready" | "failed";
  loadedSamples: number;
  revision: number;
  /** Of the last frame that is on the screen whole; 0 where it shows the committed state. */
  lastSequence: number;
  /** Nothing is loading, waiting or left to draw. */
  idle: boolean;
}

export interface ViewerHook {
  readonly status: ViewerStatus;
  /** In model space. */
  camera: CameraState;
}

declare global {
  interface Window {
    pointwright?: ViewerHook;
  }
}

/** Makes the hook: the status can be read, the camera can be read and set, and nothing else. */
export function installHook(
  status: () => ViewerStatus,
  camera: { get(): CameraState; set(state: CameraState): void },
): void {
  const hook: ViewerHook = Object.freeze({
    get status() {
      return Object.freeze(status());
    },
    get camera() {
      return camera.get();
    },
    set camera(state: CameraState) {
      camera.set(state);
    },
  });
  Object.defineProperty(window, "pointwright", { value: hook, configurable: true });
}
