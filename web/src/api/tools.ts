/** What programs want of the service beside the viewer's own requests: tokens, uploads of bytes, waiting. */
import type { ApiClient, Fetch } from "./client";
import type { CloudDocument, SessionDocument } from "./types";
import { mediaTypeOf } from "./upload";

/** A fetch that sends a token with every request. */
export function withToken(
  token: string,
  fetch: Fetch = (input, init) => globalThis.fetch(input, init),
): Fetch {
  return (input, init = {}) => {
    const headers = new Headers(init.headers);
    headers.set("Authorization", `Bearer ${token}`);
    return fetch(input, { ...init, headers });
  };
}

export interface UploadBytesOptions {
  /** Keep the rest where some samples are not finite, instead of refusing the file. */
  dropNonFinite?: boolean;
  signal?: AbortSignal;
}

/** Sends a file's bytes as a new cloud; the name's extension tells the format, or the server looks. */
export async function uploadBytes(
  client: ApiClient,
  name: string,
  bytes: Blob | Uint8Array<ArrayBuffer>,
  options: UploadBytesOptions = {},
): Promise<CloudDocument> {
  const query = new URLSearchParams({ name });
  if (options.dropNonFinite) query.set("nonfinite", "drop");
  const init: RequestInit = { method: "POST", headers: { "Content-Type": mediaTypeOf(name) }, body: bytes };
  if (options.signal) init.signal = options.signal;
  return (await (await client.request(`v1/clouds?${query}`, init)).json()) as CloudDocument;
}

export interface WaitOptions {
  signal?: AbortSignal;
  onProgress?: (phase: string, fraction: number) => void;
}

/** Waits until a session is built; throws where it could not be. */
export async function waitForSession(
  client: ApiClient,
  id: string,
  options: WaitOptions = {},
): Promise<SessionDocument> {
  for (let pause = 20; ; pause = Math.min(1000, 1.5 * pause)) {
    options.signal?.throwIfAborted();
    const session = await client.session(id);
    options.onProgress?.(session.progress.phase, session.progress.fraction);
    if (session.state === "ready") return session;
    if (session.state === "failed")
      throw new Error(session.error?.detail ?? "the session could not be built");
    await new Promise((resolve) => setTimeout(resolve, pause));
  }
}
