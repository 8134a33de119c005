import { ApiClient } from "./api/client";
import { problemOf } from "./api/problem";
import { bearer, keepBearer, takeCapability } from "./api/token";
import type { SessionDocument } from "./api/types";
import type { Notices, Questions } from "./event-map";
import { Events } from "./events";
import { installHook, type ViewerStatus } from "./hook";
import { readLink } from "./link";
import type { Vec3 } from "./math/vec3";
import type { CameraState } from "./scene/camera-math";
import { createProgress } from "./ui/progress";
import { createToasts } from "./ui/toasts";

const POLL_MS = 350;
const NO_CAMERA = { position: [0, 0, 1], target: [0, 0, 0], up: [0, 1, 0] } as const;

/** Composition root: the page of the clouds, or the editor of the session in the link. */
async function main(): Promise<void> {
  const root = document.getElementById("app");
  if (!root) throw new Error("the page has no place for the viewer");
  const { href, capability } = takeCapability(location.href);
  if (href !== location.href) history.replaceState(null, "", href);
  if (capability !== null) keepBearer(capability);
  const client = new ApiClient(new URL("./", location.href).href, undefined, bearer);
  const link = readLink(location.search, location.hash);
  const bare: ViewerStatus = { state: "home", loadedSamples: 0, revision: 0, lastSequence: 0, idle: true };
  if (link.session === null) {
    installHook(() => bare, { get: () => NO_CAMERA, set: () => undefined });
    try {
      const { showHome } = await import("./ui/home");
      await showHome(root, client, await client.info());
    } catch (error) {
      if (await asksForToken(root, error)) return;
      const failure = createProgress();
      root.append(failure.element);
      failure.fail(problemOf(error));
    }
    return;
  }

  const bus = new Events<Notices, Questions>();
  root.classList.add("editor");
  const progress = createProgress();
  root.append(createToasts(bus), progress.element);
  let state: ViewerStatus["state"] = "building";
  installHook(() => ({ ...bare, state, idle: false }), { get: () => NO_CAMERA, set: () => undefined });

  let session: SessionDocument;
  try {
    session = await whenReady(client, link.session, progress.show);
  } catch (error) {
    state = "failed";
    if (!(await asksForToken(progress.element, error))) progress.fail(problemOf(error));
    return;
  }
  if (session.state === "failed") {
    state = "failed";
    progress.fail(
      session.error ?? { type: "about:blank", title: "The session could not be prepared", status: 0 },
    );
    return;
  }
  document.title = `${session.name || "Session"} – Pointwright`;
  if (session.name === "") session = { ...session, name: "Untitled session" };
  try {
    const { createEditor } = await import("./editor");
    const editor = createEditor(root, bus, client, session, link);
    progress.hide();
    installHook(
      () => ({
        state: "ready",
        loadedSamples: editor.viewport.loadedSamples,
        revision: editor.store.document.revision,
        lastSequence: editor.source.last?.sequence ?? 0,
        idle: editor.loaded() && editor.queue.length === 0 && editor.viewport.idle,
      }),
      {
        get: () => mapCamera(editor.viewport.rig.state, (point) => editor.store.toModel(point)),
        set: (camera) =>
          editor.viewport.rig.setState(mapCamera(camera, (point) => editor.store.toScene(point))),
      },
    );
  } catch (error) {
    state = "failed";
    progress.fail({ ...problemOf(error), title: "This browser cannot draw the surface" });
  }
}

/** Whether the server refused for want of a token: then the place has a field for one. */
async function asksForToken(place: HTMLElement, error: unknown): Promise<boolean> {
  const { status, detail, title } = problemOf(error);
  if (status !== 401) return false;
  const { createTokenField } = await import("./ui/token-field");
  place.replaceChildren(createTokenField(detail ?? title));
  place.hidden = false;
  return true;
}

/** A camera in other coordinates that differ by a translation. */
function mapCamera(camera: CameraState, map: (point: Vec3) => Vec3): CameraState {
  return { position: map(camera.position), target: map(camera.target), up: camera.up };
}

/** Waits while the session is being built; the server tells how far it is. */
async function whenReady(
  client: ApiClient,
  id: string,
  show: (document: SessionDocument) => void,
): Promise<SessionDocument> {
  for (;;) {
    const session = await client.session(id);
    if (session.state !== "building") return session;
    show(session);
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
  }
}

void main();
