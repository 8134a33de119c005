import type { ApiClient } from "./client";
import { ApiError, isPassing, networkProblem } from "./problem";
import type { CloudDocument, ImportDocument } from "./types";
import type { UploadOptions } from "./upload";

/** What one request carries: little to send again where the connection breaks. */
const PIECE_BYTES = 8 << 20;
const MOST_TRIES = 8;
const VERSION = { "Tus-Resumable": "1.0.0" };

/** Where an unfinished upload of the very same file is remembered, over reloads too. */
export interface Memory {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
  removeItem(key: string): void;
}

export interface PieceOptions extends UploadOptions {
  memory?: Memory;
  /** Resolves after so many milliseconds. */
  pause?: Pause;
}

function base64(text: string): string {
  return btoa(String.fromCharCode(...new TextEncoder().encode(text)));
}

/** Milliseconds: ever more, and no less than the server asks for. */
function pauseBefore(tries: number, error: unknown): number {
  const asked = error instanceof ApiError ? (error.retryAfter ?? 0) : 0;
  return Math.max(Math.min(250 * 2 ** tries, 10_000), 1000 * Math.min(asked, 60));
}

type Pause = (ms: number) => Promise<void>;
const sleep: Pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const keyOf = (client: ApiClient, file: File): string =>
  `pointwright.upload ${client.url("")} ${file.name} ${file.size} ${file.lastModified}`;

/** Sends a file in pieces and imports it. */
export async function uploadInPieces(
  client: ApiClient,
  file: File,
  options: PieceOptions = {},
): Promise<CloudDocument> {
  const memory = options.memory ?? globalThis.localStorage;
  const upload = await sendInPieces(client, file, options);
  try {
    const cloud = await importAsked(client, upload, file.name, options, options.pause ?? sleep);
    memory.removeItem(keyOf(client, file));
    return cloud;
  } catch (error) {
    // A refused upload is there still: the next try is quick.
    if (options.signal?.aborted) memory.removeItem(keyOf(client, file));
    throw error;
  }
}

/**
 * Sends a file in pieces that outlive the connection (tus 1.0.0), from where the last try ended, and tells the upload's
 * id. It stays as it came until it is imported, or a job takes it.
 */
export async function sendInPieces(
  client: ApiClient,
  file: File,
  options: PieceOptions = {},
): Promise<string> {
  const memory = options.memory ?? globalThis.localStorage;
  const pause = options.pause ?? sleep;
  const signal = options.signal ? { signal: options.signal } : {};
  const key = keyOf(client, file);

  const offsetOf = async (upload: string): Promise<number> => {
    const head = await client.request(upload, { method: "HEAD", headers: VERSION, ...signal });
    return Number(head.headers.get("Upload-Offset"));
  };
  const begin = async (): Promise<string> => {
    const metadata = `filename ${base64(file.name)}`;
    const headers = { ...VERSION, "Upload-Length": String(file.size), "Upload-Metadata": metadata };
    const made = await client.request("v1/uploads", { method: "POST", headers, ...signal });
    const upload = (made.headers.get("Location") ?? "").replace(/^\//, "");
    memory.setItem(key, upload);
    return upload;
  };

  let upload = memory.getItem(key);
  let offset = 0;
  let tries = 0;
  while (upload === null || offset < file.size) {
    try {
      if (upload === null) {
        upload = await begin();
      } else if (offset === 0 || tries > 0) {
        offset = await offsetOf(upload);
      }
      options.onProgress?.(offset / file.size);
      if (offset >= file.size) break;
      const headers = {
        ...VERSION,
        "Content-Type": "application/offset+octet-stream",
        "Upload-Offset": String(offset),
      };
      const body = file.slice(offset, offset + PIECE_BYTES);
      const done = await client.request(upload, { method: "PATCH", headers, body, ...signal });
      offset = Number(done.headers.get("Upload-Offset"));
      tries = 0;
    } catch (error) {
      if (options.signal?.aborted && upload !== null) {
        // Given up by hand: nothing of it is kept.
        memory.removeItem(key);
        await client.request(upload, { method: "DELETE", headers: VERSION }).catch(() => undefined);
        throw error;
      }
      const status = error instanceof ApiError ? error.status : 0;
      if (status === 404 && upload !== null && tries === 0) {
        // It expired, or was imported meanwhile: from the start, once.
        memory.removeItem(key);
        upload = null;
        offset = 0;
        tries = 1;
        continue;
      }
      tries += 1;
      if (!(isPassing(error) || status === 409) || tries > MOST_TRIES) throw error;
      await pause(pauseBefore(tries, error));
    }
  }
  options.onProgress?.(1);
  return upload.split("/").pop() ?? "";
}

/** Makes a cloud of a complete upload, and tells how far that is. Given up by hand, it ends and the upload goes. */
async function importAsked(
  client: ApiClient,
  upload: string,
  name: string,
  options: PieceOptions,
  pause: Pause,
): Promise<CloudDocument> {
  const nonfinite = options.dropNonFinite ? "drop" : "reject";
  const begun = async (): Promise<ImportDocument> => {
    for (let tries = 1; ; ++tries) {
      try {
        return await client.importUpload({ upload, name, nonfinite });
      } catch (error) {
        // A request whose answer was lost may have begun it; a refused one has not.
        const isRefused = error instanceof ApiError && (error.status === 429 || error.status === 503);
        if (!(isRefused && isPassing(error)) || tries > MOST_TRIES || options.signal?.aborted) throw error;
        await pause(pauseBefore(tries, error));
      }
    }
  };
  let asked = await begun();
  let wait = 100;
  let failures = 0;
  for (;;) {
    if (options.signal?.aborted) {
      await client.deleteImport(asked.id).catch(() => undefined);
      await removeUpload(client, `v1/uploads/${upload}`, pause);
      throw new DOMException("The import was cancelled.", "AbortError");
    }
    options.onImport?.(asked.progress);
    if (asked.state === "successful" && asked.cloud) {
      await client.deleteImport(asked.id).catch(() => undefined);
      return asked.cloud;
    }
    if (asked.state === "failed") throw new ApiError(asked.problem ?? networkProblem("The import failed."));
    await pause(wait);
    wait = Math.min(1.5 * wait, 1000);
    try {
      asked = await client.import(asked.id);
      failures = 0;
    } catch (error) {
      failures += 1;
      if (!isPassing(error) || failures > MOST_TRIES) throw error;
      await pause(pauseBefore(failures, error));
    }
  }
}

/** Removes an upload that an ending import may have for a moment yet. */
async function removeUpload(client: ApiClient, upload: string, pause: Pause): Promise<void> {
  for (let tries = 0; tries < MOST_TRIES; ++tries) {
    try {
      await client.request(upload, { method: "DELETE", headers: VERSION });
      return;
    } catch (error) {
      if (!isPassing(error)) return;
      await pause(250);
    }
  }
}
