import { type CameraState, decodeCamera, encodeCamera } from "./scene/camera-math";
import { type DisplaySettings, displayOfUrlMode, urlModeOf } from "./scene/display";

/** What a link to a view holds: the session in the query, the camera and the display in the hash. */
export interface LinkState {
  session: string | null;
  /** False for the bare picture. */
  ui: boolean;
  camera: CameraState | null;
  mode: string | null;
}

const ID = /^[A-Za-z0-9_-]{22}$/;

export function readLink(search: string, hash: string): LinkState {
  const query = new URLSearchParams(search);
  const view = new URLSearchParams(hash.replace(/^#/, ""));
  const session = query.get("session");
  const camera = view.get("cam");
  return {
    session: session !== null && ID.test(session) ? session : null,
    ui: query.get("ui") !== "0",
    camera: camera === null ? null : decodeCamera(camera),
    mode: view.get("mode"),
  };
}

/** Where a session's link leads. */
export function sessionUrl(id: string): string {
  return `./?session=${encodeURIComponent(id)}`;
}

/** The hash of a view. */
export function viewHash(camera: CameraState, display: DisplaySettings): string {
  return `#cam=${encodeCamera(camera)}&mode=${urlModeOf(display)}`;
}

export function displayFromLink(mode: string | null, base: DisplaySettings): DisplaySettings {
  return mode === null ? base : (displayOfUrlMode(mode, base) ?? base);
}
