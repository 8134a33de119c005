import { expect, test } from "vitest";
import { ApiClient } from "../../src/api/client";
import { EventParser, type ServerEvent, wholeCharacters } from "../../src/api/event-stream";

interface Call {
  url: string;
  init: RequestInit | undefined;
}

function clientAnswering(
  answer: (url: string) => Response,
  token: string | null = null,
): { client: ApiClient; calls: Call[] } {
  const calls: Call[] = [];
  const fetch = async (url: string, init?: RequestInit): Promise<Response> => {
    calls.push({ url, init });
    return answer(url);
  };
  return { client: new ApiClient("http://host/sub/", fetch, () => token), calls };
}

const json = (body: unknown, status = 200): Response => new Response(JSON.stringify(body), { status });
const bodyOf = (call: Call | undefined): unknown => JSON.parse(String(call?.init?.body));

function pieces(text: string, size: number): Response {
  const bytes = new TextEncoder().encode(text);
  return new Response(
    new ReadableStream({
      start(controller) {
        for (let at = 0; at < bytes.length; at += size) controller.enqueue(bytes.slice(at, at + size));
        controller.close();
      },
    }),
  );
}

test("jobs are listed by status and number", async () => {
  const { client, calls } = clientAnswering(() => json({ jobs: [{ jobID: "j" }], links: [] }));
  expect(await client.jobs()).toEqual([{ jobID: "j" }]);
  await client.jobs({ status: "running", limit: 3 });
  expect(calls.map(({ url }) => url)).toEqual([
    "http://host/sub/v1/jobs",
    "http://host/sub/v1/jobs?status=running&limit=3",
  ]);
});

test("an estimate asks for what the job would ask for, and does not begin it", async () => {
  const estimate = { mode: "tiles", sample_count: 5, seconds: 2.5 };
  const { client, calls } = clientAnswering((url) =>
    url.endsWith("jobs") && calls.length === 1 ? json({ estimate }) : json({ jobID: "j" }, 202),
  );
  const asked = { session: "s", mode: "tiles", output: { format: "las" } } as const;
  expect(await client.validateJob(asked)).toEqual(estimate);
  expect(await client.createJob(asked)).toEqual({ jobID: "j" });
  expect(bodyOf(calls[0])).toEqual({ ...asked, validate: true });
  expect(bodyOf(calls[1])).toEqual(asked);
});

test("jobs are dismissed and started again below their own address", async () => {
  const { client, calls } = clientAnswering(() => json({ jobID: "j" }));
  await client.job("j");
  await client.dismissJob("j");
  await client.forgetJob("j");
  await client.restartJob("j");
  await client.jobResults("j");
  expect(calls.map(({ url, init }) => `${init?.method ?? "GET"} ${url}`)).toEqual([
    "GET http://host/sub/v1/jobs/j",
    "DELETE http://host/sub/v1/jobs/j?only=dismiss",
    "DELETE http://host/sub/v1/jobs/j?only=forget",
    "POST http://host/sub/v1/jobs/j/restart",
    "GET http://host/sub/v1/jobs/j/results",
  ]);
  expect(client.jobResultUrl("j", "result.ply")).toBe("http://host/sub/v1/jobs/j/results/result.ply");
});

test("a log goes on at the byte after its last whole character", async () => {
  const bytes = new TextEncoder().encode("höhe\n");
  const { client, calls } = clientAnswering(() => new Response(bytes.slice(0, 2)));
  expect(await client.jobLog("j")).toEqual({ text: "h", next: 1 });
  expect(calls[0]?.url).toBe("http://host/sub/v1/jobs/j/log?offset=0");
  const rest = clientAnswering(() => new Response(bytes.slice(1)));
  expect(await rest.client.jobLog("j", 1)).toEqual({ text: "öhe\n", next: bytes.length });
  expect(rest.calls[0]?.url).toBe("http://host/sub/v1/jobs/j/log?offset=1");
});

test("characters of any length are cut nowhere but between them", () => {
  const bytes = new TextEncoder().encode("aé€😀");
  const ends = Array.from(
    { length: bytes.length + 1 },
    (_, end) => wholeCharacters(bytes.slice(0, end)).length,
  );
  expect(ends).toEqual([0, 1, 1, 3, 3, 3, 6, 6, 6, 6, 10]);
});

for (const size of [1, 7, 10_000]) {
  test(`events in pieces of ${size} bytes are jobs, and comments are none`, async () => {
    const text = `: alive\n\nevent: job\ndata: {"event":"job","job":{"jobID":"j","message":"ö"}}\n\nevent: other\ndata: {}\n\nevent: job\ndata: {"event":"job","job":{"jobID":"k"}}\n\n`;
    const { client, calls } = clientAnswering(() => pieces(text, size), "pw_secret");
    const jobs: unknown[] = [];
    for await (const job of client.jobEvents("j")) jobs.push(job);
    expect(jobs).toEqual([{ jobID: "j", message: "ö" }, { jobID: "k" }]);
    expect(calls[0]?.url).toBe("http://host/sub/v1/jobs/j/events");
    expect(new Headers(calls[0]?.init?.headers).get("Authorization")).toBe("Bearer pw_secret");
  });
}

test("a reader that stops lets the connection go", async () => {
  let cancelled = false;
  const body = new ReadableStream({
    pull(controller) {
      controller.enqueue(new TextEncoder().encode('event: job\ndata: {"job":{"jobID":"j"}}\n\n'));
    },
    cancel() {
      cancelled = true;
    },
  });
  const { client } = clientAnswering(() => new Response(body));
  for await (const job of client.jobEvents("j")) {
    expect(job.jobID).toBe("j");
    break;
  }
  expect(cancelled).toBe(true);
});

test("lines end in any of the ways that the format allows, and data has several", () => {
  const parse = (...texts: string[]): ServerEvent[] => {
    const parser = new EventParser();
    return texts.flatMap((text) => [...parser.push(text)]);
  };
  const event = { event: "message", data: "one\ntwo" };
  expect(parse("data: one\r", "\ndata:two\r\n\r\n")).toEqual([event]);
  expect(parse("data: one\rdata: two\r\rid: 7")).toEqual([event]);
  expect(parse("event: nothing\n\n")).toEqual([]);
  expect(() => parse("x".repeat((1 << 20) + 1))).toThrow("mebibyte");
});
