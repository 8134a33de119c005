import type { ApiClient } from "./client";
import { ApiError, networkProblem, problemFromBody } from "./problem";
import type { CloudDocument, ImportDocument } from "./types";

/** The media type to send a file as; what the name does not tell is left to the server, which looks at the bytes. */
export function mediaTypeOf(name: string): string {
  const extension = name.toLowerCase().split(".").pop() ?? "";
  if (extension === "drc") return "model/x-draco";
  if (extension === "ply") return "application/x-ply";
  if (extension === "xyz" || extension === "txt" || extension === "asc") return "text/plain";
  if (extension === "las") return "application/vnd.las";
  if (extension === "pcd") return "model/x-pcd";
  if (extension === "obj") return "model/obj";
  if (extension === "zip") return "application/zip";
  return "application/octet-stream";
}

/** Longer files go in pieces, which a broken connection does not undo. */
const LONG_BYTES = 32 << 20;

export interface UploadOptions {
  /** Keep the rest where some samples are not finite, instead of refusing the file. */
  dropNonFinite?: boolean;
  token?: string | null;
  signal?: AbortSignal;
  onProgress?: (fraction: number) => void;
  /** Once all of it was sent: what the server does with it, and how much of that is done. */
  onImport?: (progress: ImportDocument["progress"]) => void;
}

/** Sends a file as a new cloud. */
export async function uploadCloud(
  client: ApiClient,
  file: File,
  options: UploadOptions = {},
): Promise<CloudDocument> {
  if (file.size <= LONG_BYTES) return uploadWhole(client.url(""), file, options);
  const { uploadInPieces } = await import("./tus");
  return uploadInPieces(client, file, options);
}

/** In one request. XMLHttpRequest, since fetch tells no upload progress. */
function uploadWhole(base: string, file: File, options: UploadOptions): Promise<CloudDocument> {
  const query = new URLSearchParams({ name: file.name });
  if (options.dropNonFinite) query.set("nonfinite", "drop");
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `${base}v1/clouds?${query}`);
    request.setRequestHeader("Content-Type", mediaTypeOf(file.name));
    request.setRequestHeader("Accept", "application/json");
    if (options.token) request.setRequestHeader("Authorization", `Bearer ${options.token}`);
    request.upload.onprogress = (event) => {
      if (event.lengthComputable) options.onProgress?.(event.loaded / event.total);
    };
    request.onerror = () => reject(new ApiError(networkProblem("The upload broke off.")));
    request.onabort = () => reject(new DOMException("The upload was cancelled.", "AbortError"));
    request.onload = () => {
      if (request.status >= 200 && request.status < 300) {
        resolve(JSON.parse(request.responseText) as CloudDocument);
      } else {
        reject(new ApiError(problemFromBody(request.status, request.statusText, request.responseText)));
      }
    };
    options.signal?.addEventListener("abort", () => request.abort());
    request.send(file);
  });
}
