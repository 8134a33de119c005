import { expect, test } from "vitest";
import { ApiClient } from "../../src/api/client";
import { ApiError, describeProblem, problemOf } from "../../src/api/problem";
import { mediaTypeOf } from "../../src/api/upload";

interface Call {
  url: string;
  init: RequestInit | undefined;
}

function clientAnswering(answer: () => Response | Promise<Response>): { client: ApiClient; calls: Call[] } {
  const calls: Call[] = [];
  const client = new ApiClient("http://host/sub/path/", async (url, init) => {
    calls.push({ url, init });
    return answer();
  });
  return { client, calls };
}

const json = (body: unknown, status = 200, headers: Record<string, string> = {}): Response =>
  new Response(JSON.stringify(body), { status, headers });

async function problemFrom(promise: Promise<unknown>): Promise<ApiError> {
  const error = await promise.then(
    () => null,
    (reason: unknown) => reason,
  );
  expect(error).toBeInstanceOf(ApiError);
  return error as ApiError;
}

test("requests go below the directory that the viewer was served from", async () => {
  const { client, calls } = clientAnswering(() => json({ clouds: [] }));
  expect(await client.clouds()).toEqual([]);
  expect(calls[0]?.url).toBe("http://host/sub/path/v1/clouds");
});

test("an edit is sent with the revision that it stands on", async () => {
  const { client, calls } = clientAnswering(() => json({ index: 1 }, 201));
  await client.commitEdit("abc", { level: 0, deformation: { type: "translation", vector: [1, 2, 3] } }, 7);
  const headers = new Headers(calls[0]?.init?.headers);
  expect(headers.get("If-Match")).toBe('"r7"');
  expect(headers.get("Content-Type")).toBe("application/json");
  expect(JSON.parse(String(calls[0]?.init?.body))).toEqual({
    level: 0,
    deformation: { type: "translation", vector: [1, 2, 3] },
  });
});

test("a preview carries its sequence number beside the edit", async () => {
  const { client, calls } = clientAnswering(() => new Response(null, { status: 204 }));
  await client.putPreview("abc", { level: 0, deformation: { type: "translation", vector: [0, 0, 1] } }, 41);
  expect(calls[0]?.init?.method).toBe("PUT");
  expect(JSON.parse(String(calls[0]?.init?.body)).sequence).toBe(41);
});

test("a session asks for scales only where some were chosen", async () => {
  const { client, calls } = clientAnswering(() => json({ id: "s" }, 202));
  await client.createSession("cloud");
  await client.createSession("cloud", { name: "n", scales: [0.03, 0.01] });
  expect(JSON.parse(String(calls[0]?.init?.body))).toEqual({ cloud: "cloud" });
  expect(JSON.parse(String(calls[1]?.init?.body))).toEqual({
    cloud: "cloud",
    name: "n",
    scales: [0.03, 0.01],
  });
});

test("a refusal becomes an error with all that the problem document says", async () => {
  const problem = {
    type: "/problems/too-large",
    title: "The upload is too large",
    status: 413,
    detail: "The body exceeds what this server takes.",
    request_id: "r-1",
    errors: [{ pointer: "/shape/radius", detail: "must be positive" }],
    limit: 1000,
    actual: 1234567,
  };
  const { client } = clientAnswering(() => json(problem, 413));
  const error = await problemFrom(client.info());
  expect(error.status).toBe(413);
  expect(error.problem).toEqual(problem);
  expect(describeProblem(error.problem)).toEqual([
    "The body exceeds what this server takes.",
    "/shape/radius: must be positive",
    "The limit is 1,000, this is 1,234,567",
  ]);
});

test("a problem is told without saying a thing twice", () => {
  const problem = { type: "about:blank", title: "Refused", status: 422 };
  const errors = [
    { pointer: "/radius", detail: "must be positive" },
    { pointer: "/radius", detail: "must be positive" },
  ];
  expect(describeProblem({ ...problem, detail: "Refused" })).toEqual([]);
  expect(describeProblem({ ...problem, detail: "must be positive", errors })).toEqual([
    "/radius: must be positive",
  ]);
});

test("a stale revision is told with the current one", async () => {
  const { client } = clientAnswering(() =>
    json({ type: "/problems/stale", title: "Stale", status: 412, revision: 9 }, 412),
  );
  const error = await problemFrom(
    client.commitEdit("s", { level: 0, deformation: { type: "translation", vector: [0, 0, 1] } }, 8),
  );
  expect(error.status).toBe(412);
  expect(error.problem.revision).toBe(9);
});

test("a refusal that is no problem document is told by its status", async () => {
  const { client } = clientAnswering(
    () => new Response("<html>Bad gateway</html>", { status: 502, statusText: "Bad Gateway" }),
  );
  const error = await problemFrom(client.info());
  expect(error.status).toBe(502);
  expect(error.problem.title).toBe("Bad Gateway");
});

test("how long to wait is taken from Retry-After", async () => {
  const { client } = clientAnswering(() => json({ title: "Busy", status: 503 }, 503, { "Retry-After": "2" }));
  expect((await problemFrom(client.info())).retryAfter).toBe(2);
});

test("a server that cannot be reached is a problem of status 0", async () => {
  const { client } = clientAnswering(() => Promise.reject(new TypeError("fetch failed")));
  const error = await problemFrom(client.sessions());
  expect(error.status).toBe(0);
  expect(error.problem.detail).toBe("fetch failed");
});

test("a request that was called off is no problem of the server", async () => {
  const { client } = clientAnswering(() => Promise.reject(new DOMException("stopped", "AbortError")));
  await expect(client.stream("s", new AbortController().signal)).rejects.toMatchObject({
    name: "AbortError",
  });
});

test("whatever is thrown can be shown as a problem", () => {
  expect(problemOf(new Error("odd")).detail).toBe("odd");
  expect(problemOf("text").detail).toBe("text");
});

test("files are sent as what their names say, and as bytes where they say nothing", () => {
  expect(mediaTypeOf("dragon.PLY")).toBe("application/x-ply");
  expect(mediaTypeOf("a.b.drc")).toBe("model/x-draco");
  expect(mediaTypeOf("points.xyz")).toBe("text/plain");
  expect(mediaTypeOf("yard.las")).toBe("application/vnd.las");
  expect(mediaTypeOf("mesh.obj")).toBe("model/obj");
  expect(mediaTypeOf("frame.pcd")).toBe("model/x-pcd");
  expect(mediaTypeOf("points")).toBe("application/octet-stream");
});
