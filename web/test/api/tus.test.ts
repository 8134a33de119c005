import { File as NodeFile } from "node:buffer";
import { describe, expect, it } from "vitest";
import { ApiClient } from "../../src/api/client";
import { uploadInPieces } from "../../src/api/tus";

const ID = "u7k8l9m0n1o2p-q_r3s4t5";
const PIECE = 8 << 20;

/** A server of one upload; `breaks` requests in a row lose their answer. */
function stand(breaks: number[] = [], states: unknown[] = [{ state: "successful", cloud: { id: "cloud" } }]) {
  const log: string[] = [];
  let offset = 0;
  let length = -1;
  let count = 0;
  const fetch = async (url: string, init: RequestInit = {}): Promise<Response> => {
    const headers = new Headers(init.headers);
    const path = url.replace("http://host/", "");
    log.push(`${init.method ?? "GET"} ${path} ${headers.get("Upload-Offset") ?? ""}`.trim());
    const told = path.startsWith("v1/imports");
    if (path !== "v1/clouds" && !told) expect(headers.get("Tus-Resumable")).toBe("1.0.0");
    const missing = () => new Response("{}", { status: 404 });
    count += 1;
    if (init.method === "POST" && path === "v1/uploads") {
      length = Number(headers.get("Upload-Length"));
      offset = 0;
      return new Response(null, { status: 201, headers: { Location: `/v1/uploads/${ID}` } });
    }
    if (path === "v1/clouds") {
      expect(JSON.parse(String(init.body))).toEqual({ upload: ID, name: "ö.las", nonfinite: "drop" });
      expect(offset).toBe(length);
      expect(headers.get("Prefer")).toBe("respond-async");
      const progress = { phase: "waiting", fraction: 0 };
      return new Response(JSON.stringify({ id: "import", state: "accepted", progress }), { status: 202 });
    }
    if (told && init.method === "DELETE") return new Response(null, { status: 204 });
    if (told) {
      const state = states.length > 1 ? states.shift() : states[0];
      if (state instanceof Error) throw state;
      return new Response(
        JSON.stringify({ id: "import", progress: { phase: "x", fraction: 0.5 }, ...(state as object) }),
      );
    }
    if (length < 0) return missing();
    if (init.method === "PATCH") {
      if (Number(headers.get("Upload-Offset")) !== offset) return new Response("{}", { status: 409 });
      const size = (init.body as Blob).size;
      // Half a piece is on the disk when the connection breaks.
      if (breaks.includes(count)) {
        offset += size / 2;
        throw new TypeError("connection lost");
      }
      offset += size;
      return new Response(null, { status: 204, headers: { "Upload-Offset": String(offset) } });
    }
    if (init.method === "DELETE") return new Response(null, { status: 204 });
    return new Response(null, { headers: { "Upload-Offset": String(offset) } });
  };
  return { client: new ApiClient("http://host/", fetch), fetch, log, at: () => offset };
}

function memory(): Storage & { all: Map<string, string> } {
  const all = new Map<string, string>();
  return {
    all,
    getItem: (key: string) => all.get(key) ?? null,
    setItem: (key: string, value: string) => void all.set(key, value),
    removeItem: (key: string) => void all.delete(key),
  } as unknown as Storage & { all: Map<string, string> };
}

// Node 18 knows no File by itself.
const file = () =>
  new NodeFile([new Uint8Array(2.5 * PIECE)], "ö.las", { lastModified: 5 }) as unknown as File;
const pause = async () => undefined;

describe("an upload in pieces", () => {
  it("sends them in order, tells how far it is, imports, and forgets", async () => {
    const { client, log } = stand();
    const store = memory();
    const told: number[] = [];
    const options = { memory: store, pause, dropNonFinite: true, onProgress: (f: number) => told.push(f) };
    expect(await uploadInPieces(client, file(), options)).toEqual({ id: "cloud" });
    expect(log).toEqual([
      "POST v1/uploads",
      `PATCH v1/uploads/${ID} 0`,
      `PATCH v1/uploads/${ID} ${PIECE}`,
      `PATCH v1/uploads/${ID} ${2 * PIECE}`,
      "POST v1/clouds",
      "GET v1/imports/import",
      "DELETE v1/imports/import",
    ]);
    expect(told).toEqual([0, 0.4, 0.8, 1]);
    expect(store.all.size).toBe(0);
  });

  it("goes on from what the server has after a broken connection", async () => {
    const { client, log } = stand([3]);
    await uploadInPieces(client, file(), { memory: memory(), pause, dropNonFinite: true });
    expect(log).toContain(`HEAD v1/uploads/${ID}`);
    expect(log).toContain(`PATCH v1/uploads/${ID} ${1.5 * PIECE}`);
  });

  it("waits where the server says when to come again, and gives up where time lifts nothing", async () => {
    const refusing = (refused: string, headers: Record<string, string>) => {
      const server = stand();
      let left = 2;
      const client = new ApiClient("http://host/", async (url, init = {}) => {
        if (`${init.method} ${url}`.startsWith(refused) && left-- > 0)
          return new Response('{"title":"Too many","status":429}', { status: 429, headers });
        return await server.fetch(String(url), init);
      });
      return { ...server, client };
    };
    for (const refused of [
      "POST http://host/v1/uploads",
      "PATCH http://host/",
      "POST http://host/v1/clouds",
    ]) {
      const waits: number[] = [];
      const options = {
        memory: memory(),
        dropNonFinite: true,
        pause: async (ms: number) => void waits.push(ms),
      };
      const passing = refusing(refused, { "Retry-After": "7" });
      expect(await uploadInPieces(passing.client, file(), options)).toEqual({ id: "cloud" });
      expect(waits.filter((ms) => ms === 7000).length).toBe(2);
      expect(passing.log.filter((line) => line === "POST v1/clouds").length).toBe(1);
      const full = refusing(refused, {});
      await expect(uploadInPieces(full.client, file(), options)).rejects.toThrow("Too many");
      expect(full.log).not.toContain("POST v1/clouds");
    }
  });

  it("goes on after a reload, and starts anew where the upload is gone", async () => {
    const broken = stand([3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20]);
    const store = memory();
    await expect(
      uploadInPieces(broken.client, file(), { memory: store, pause, dropNonFinite: true }),
    ).rejects.toThrow();
    expect([...store.all.values()]).toEqual([`v1/uploads/${ID}`]);
    const elsewhere = stand();
    await uploadInPieces(elsewhere.client, file(), { memory: store, pause, dropNonFinite: true });
    expect(elsewhere.log.slice(0, 3)).toEqual([
      `HEAD v1/uploads/${ID}`,
      "POST v1/uploads",
      `PATCH v1/uploads/${ID} 0`,
    ]);
  });

  it("asks how far the import is, over a lost answer, until there is a cloud", async () => {
    const running = { state: "running", progress: { phase: "ordering", fraction: 0.6 } };
    const { client } = stand(
      [],
      [running, new TypeError("lost"), { state: "successful", cloud: { id: "c" } }],
    );
    const told: string[] = [];
    const onImport = ({ phase, fraction }: { phase: string; fraction: number }) =>
      told.push(`${phase} ${fraction}`);
    const options = { memory: memory(), pause, dropNonFinite: true, onImport };
    expect(await uploadInPieces(client, file(), options)).toEqual({ id: "c" });
    expect(told).toEqual(["waiting 0", "ordering 0.6", "ordering 0.6", "x 0.5"]);
  });

  it("throws the problem of an import, and remembers the upload for the next try", async () => {
    const problem = { type: "/problems/malformed-cloud", title: "The cloud is malformed", status: 422 };
    const { client } = stand([], [{ state: "failed", problem }]);
    const store = memory();
    const sending = uploadInPieces(client, file(), { memory: store, pause, dropNonFinite: true });
    await expect(sending).rejects.toThrow("malformed");
    expect(store.all.size).toBe(1);
  });

  it("ends the import and removes the upload where it is cancelled while the server reads", async () => {
    const { client, log } = stand([], [{ state: "running" }]);
    const store = memory();
    const controller = new AbortController();
    const onImport = ({ phase }: { phase: string }) => {
      if (phase === "x") controller.abort();
    };
    const options = { memory: store, pause, dropNonFinite: true, onImport, signal: controller.signal };
    await expect(uploadInPieces(client, file(), options)).rejects.toThrow("cancelled");
    expect(log.slice(-2)).toEqual(["DELETE v1/imports/import", `DELETE v1/uploads/${ID}`]);
    expect(store.all.size).toBe(0);
  });

  it("is removed where it is cancelled", async () => {
    const { client, log } = stand();
    const store = memory();
    const controller = new AbortController();
    const onProgress = (fraction: number) => {
      if (fraction > 0) controller.abort();
    };
    const stopping = new ApiClient("http://host/", (url, init) => {
      if (init?.signal?.aborted) return Promise.reject(new DOMException("cancelled", "AbortError"));
      return client.request(url.replace("http://host/", ""), init);
    });
    const sending = uploadInPieces(stopping, file(), {
      memory: store,
      pause,
      onProgress,
      signal: controller.signal,
    });
    await expect(sending).rejects.toThrow("cancelled");
    expect(log.at(-1)).toBe(`DELETE v1/uploads/${ID}`);
    expect(store.all.size).toBe(0);
  });
});
