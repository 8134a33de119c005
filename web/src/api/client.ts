import { readEvents, wholeCharacters } from "./event-stream";
import { ApiError, networkProblem, problemFromBody } from "./problem";
import type {
  CloudDocument,
  EditBody,
  EditRecord,
  ExportFormat,
  History,
  ImageDocument,
  ImportDocument,
  Job,
  JobEstimate,
  JobEvent,
  JobRequest,
  JobResults,
  JobStatus,
  NamedRegion,
  NewShare,
  RecordedOperation,
  RegionOperation,
  ServiceInfo,
  SessionDocument,
  SessionSummary,
  Share,
  UploadDocument,
} from "./types";

export type Fetch = (input: string, init?: RequestInit) => Promise<Response>;

export const STREAM_ATTRIBUTES = "normal,t,detail,color,marks,radius";

const regionPath = (id: string, region: string): string =>
  `v1/sessions/${id}/regions/${encodeURIComponent(region)}`;

/** Seconds as `Retry-After` gives them; undefined where it gives none. */
function retryAfter(response: Response): number | undefined {
  const seconds = Number(response.headers.get("Retry-After") ?? Number.NaN);
  return Number.isFinite(seconds) ? seconds : undefined;
}

/**
 * The HTTP contract, one method a route. Every method throws ApiError where the server refuses or cannot be reached, and
 * nothing is tried again behind the caller's back.
 */
export class ApiClient {
  private readonly base_: string;
  private readonly fetch_: Fetch;
  /** The token that requests carry; null for none. */
  readonly token: () => string | null;

  /** `base` is the directory that the viewer was served from, with its slash. */
  constructor(
    base: string,
    fetch: Fetch = (input, init) => globalThis.fetch(input, init),
    token: () => string | null = () => null,
  ) {
    this.token = token;
    this.base_ = base.endsWith("/") ? base : `${base}/`;
    this.fetch_ = fetch;
  }

  url(path: string): string {
    return this.base_ + path;
  }

  async request(path: string, init: RequestInit = {}): Promise<Response> {
    let response: Response;
    const token = this.token();
    const headers = token === null ? init.headers : { ...init.headers, Authorization: `Bearer ${token}` };
    try {
      response = await this.fetch_(this.url(path), {
        cache: "no-store",
        ...init,
        ...(headers === undefined ? {} : { headers }),
      });
    } catch (error) {
      if (error instanceof DOMException && error.name === "AbortError") throw error;
      throw new ApiError(networkProblem(error instanceof Error ? error.message : String(error)));
    }
    if (response.ok) return response;
    const text = await response.text().catch(() => "");
    throw new ApiError(problemFromBody(response.status, response.statusText, text), retryAfter(response));
  }

  private async json<Body>(path: string, init?: RequestInit): Promise<Body> {
    return (await (await this.request(path, init)).json()) as Body;
  }

  private send<Body>(method: string, path: string, body: unknown, headers = {}): Promise<Body> {
    return this.json<Body>(path, {
      method,
      headers: { "Content-Type": "application/json", ...headers },
      body: JSON.stringify(body),
    });
  }

  info(): Promise<ServiceInfo> {
    return this.json("v1/info");
  }

  async clouds(): Promise<CloudDocument[]> {
    return (await this.json<{ clouds: CloudDocument[] }>("v1/clouds")).clouds;
  }

  /** Files that came in pieces and are no clouds yet, whole or not. */
  async uploads(): Promise<UploadDocument[]> {
    return (await this.json<{ uploads: UploadDocument[] }>("v1/uploads")).uploads;
  }

  async deleteCloud(id: string): Promise<void> {
    await this.request(`v1/clouds/${id}`, { method: "DELETE" });
  }

  /** Begins to make a cloud of a complete resumable upload; it is asked for how far it is. */
  importUpload(body: { upload: string; name?: string; nonfinite?: string }): Promise<ImportDocument> {
    return this.send("POST", "v1/clouds", body, { Prefer: "respond-async" });
  }

  import(id: string): Promise<ImportDocument> {
    return this.json(`v1/imports/${id}`);
  }

  /** Ends an import, or forgets one that has ended. */
  async deleteImport(id: string): Promise<void> {
    await this.request(`v1/imports/${id}`, { method: "DELETE" });
  }

  async sessions(): Promise<SessionSummary[]> {
    return (await this.json<{ sessions: SessionSummary[] }>("v1/sessions")).sessions;
  }

  session(id: string): Promise<SessionDocument> {
    return this.json(`v1/sessions/${id}`);
  }

  /** `preview`: on so many of the cloud's samples. */
  createSession(
    cloud: string,
    options: { name?: string; scales?: number[]; preview?: number } = {},
  ): Promise<SessionDocument> {
    const body: Record<string, unknown> = { cloud };
    if (options.preview !== undefined) body["preview"] = { count: options.preview };
    if (options.name !== undefined) body["name"] = options.name;
    if (options.scales !== undefined) body["scales"] = options.scales;
    return this.send("POST", "v1/sessions", body);
  }

  async deleteSession(id: string): Promise<void> {
    await this.request(`v1/sessions/${id}`, { method: "DELETE" });
  }

  /** All regions, in short: zero, one, and the named ones. */
  async regions(id: string): Promise<NamedRegion[]> {
    return (await this.json<{ regions: NamedRegion[] }>(`v1/sessions/${id}/regions`)).regions;
  }

  async regionOperations(id: string, region: string): Promise<RecordedOperation[]> {
    return (await this.json<{ operations: RecordedOperation[] }>(regionPath(id, region))).operations;
  }

  addOperation(
    id: string,
    region: string,
    operation: RegionOperation,
  ): Promise<SessionDocument & { changed: number }> {
    return this.send("POST", `${regionPath(id, region)}/operations`, operation);
  }

  putOperations(
    id: string,
    region: string,
    operations: readonly RecordedOperation[],
  ): Promise<SessionDocument> {
    return this.send("PUT", regionPath(id, region), { operations });
  }

  /** Clears the zero- or the one-region; deletes another one. */
  clearRegion(id: string, region: string): Promise<SessionDocument> {
    return this.json(regionPath(id, region), { method: "DELETE" });
  }

  async putPreview(id: string, edit: EditBody, sequence: number): Promise<void> {
    await this.request(`v1/sessions/${id}/preview`, {
      method: "PUT",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ ...edit, sequence }),
    });
  }

  async endPreview(id: string): Promise<void> {
    await this.request(`v1/sessions/${id}/preview`, { method: "DELETE" });
  }

  /** Records an edit on top of `revision`; 412 where the session has moved on. */
  commitEdit(id: string, edit: EditBody, revision: number): Promise<EditRecord> {
    return this.send("POST", `v1/sessions/${id}/edits`, edit, { "If-Match": `"r${revision}"` });
  }

  history(id: string): Promise<History> {
    return this.json(`v1/sessions/${id}/edits`);
  }

  putHead(id: string, edit: number, revision: number): Promise<SessionDocument> {
    return this.send("PUT", `v1/sessions/${id}/head`, { edit }, { "If-Match": `"r${revision}"` });
  }

  async shares(id: string): Promise<Share[]> {
    return (await this.json<{ shares: Share[] }>(`v1/sessions/${id}/shares`)).shares;
  }

  /** A link to the session; its capability is told this once. */
  createShare(id: string, scope: "view" | "edit"): Promise<NewShare> {
    return this.send("POST", `v1/sessions/${id}/shares`, { scope });
  }

  async revokeShare(id: string, share: string): Promise<void> {
    await this.request(`v1/sessions/${id}/shares/${share}`, { method: "DELETE" });
  }

  /** A file of the server's: what its URL names, with the token that a link cannot carry. */
  async file(url: string): Promise<Blob> {
    return (await this.request(url.slice(this.base_.length))).blob();
  }

  exportUrl(id: string, format: ExportFormat): string {
    return this.url(`v1/sessions/${id}/samples?format=${format}`);
  }

  /** One key frame of a level, as bytes; with `s`, of the recorded edits done by that part. */
  frame(id: string, level: number, signal: AbortSignal, s?: number): Promise<Response> {
    const part = s === undefined ? "" : `&s=${s}`;
    return this.request(
      `v1/sessions/${id}/samples?format=frame&level=${level}&attributes=${STREAM_ATTRIBUTES}${part}`,
      { signal },
    );
  }

  recipeUrl(id: string): string {
    return this.url(`v1/sessions/${id}/recipe`);
  }

  /** Applies a recipe, whole, on top of `revision`. */
  applyRecipe(id: string, recipe: unknown, revision: number): Promise<SessionDocument> {
    const body = { recipe, s: 1, timing: "sequence" };
    return this.send("POST", `v1/sessions/${id}/recipe`, body, { "If-Match": `"r${revision}"` });
  }

  uploadImage(image: Blob): Promise<ImageDocument> {
    return this.json("v1/images", {
      method: "POST",
      headers: { "Content-Type": "image/png" },
      body: image,
    });
  }

  /** Newest first. */
  async jobs(filter: { status?: JobStatus; limit?: number } = {}): Promise<Job[]> {
    const query = new URLSearchParams();
    if (filter.status !== undefined) query.set("status", filter.status);
    if (filter.limit !== undefined) query.set("limit", String(filter.limit));
    const text = query.toString();
    return (await this.json<{ jobs: Job[] }>(text ? `v1/jobs?${text}` : "v1/jobs")).jobs;
  }

  job(id: string): Promise<Job> {
    return this.json(`v1/jobs/${id}`);
  }

  createJob(job: JobRequest): Promise<Job> {
    return this.send("POST", "v1/jobs", job);
  }

  /** What a job would take; refused as the job itself would be. */
  async validateJob(job: JobRequest): Promise<JobEstimate> {
    const body = { ...job, validate: true };
    return (await this.send<{ estimate: JobEstimate }>("POST", "v1/jobs", body)).estimate;
  }

  /** Ends a job that waits or runs; refused (409) where it has ended. */
  dismissJob(id: string): Promise<Job> {
    return this.json(`v1/jobs/${id}?only=dismiss`, { method: "DELETE" });
  }

  /** Forgets a job that has ended, and its results; refused (409) where it has not. */
  forgetJob(id: string): Promise<Job> {
    return this.json(`v1/jobs/${id}?only=forget`, { method: "DELETE" });
  }

  restartJob(id: string): Promise<Job> {
    return this.json(`v1/jobs/${id}/restart`, { method: "POST" });
  }

  /** A job's log from a byte on, and the byte to go on from; at most a mebibyte at once. */
  async jobLog(id: string, offset = 0, signal?: AbortSignal): Promise<{ text: string; next: number }> {
    const response = await this.request(`v1/jobs/${id}/log?offset=${offset}`, signal ? { signal } : {});
    const bytes = wholeCharacters(new Uint8Array(await response.arrayBuffer()));
    return { text: new TextDecoder().decode(bytes), next: offset + bytes.byteLength };
  }

  jobResults(id: string): Promise<JobResults> {
    return this.json(`v1/jobs/${id}/results`);
  }

  jobResultUrl(id: string, name: string): string {
    return this.url(`v1/jobs/${id}/results/${encodeURIComponent(name)}`);
  }

  /** A job as it is and at each change, until it has ended; throws AbortError where the signal ends it. */
  async *jobEvents(id: string, signal?: AbortSignal): AsyncGenerator<Job, void, undefined> {
    const response = await this.request(`v1/jobs/${id}/events`, signal ? { signal } : {});
    for await (const { event, data } of readEvents(response))
      if (event === "job") yield (JSON.parse(data) as JobEvent).job;
  }

  stream(id: string, signal: AbortSignal): Promise<Response> {
    return this.request(`v1/sessions/${id}/stream?attributes=${STREAM_ATTRIBUTES}`, { signal });
  }
}
