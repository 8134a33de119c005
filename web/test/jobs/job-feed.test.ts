import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { Job } from "../../src/api/types";
import { JobFeed } from "../../src/jobs/job-feed";

let clock = 0;

function job(id: string, members: Partial<Job> = {}): Job {
  clock += 1;
  const at = `2026-01-01T00:00:00.${String(clock).padStart(3, "0")}Z`;
  return {
    jobID: id,
    type: "process",
    processID: "edit",
    status: "running",
    message: "",
    progress: 0,
    phase: "",
    created: at,
    updated: at,
    attempts: 1,
    request: { neighbors: 10, s: 1, timing: "sequence", launcher: "local", priority: 5 },
    links: [],
    ...members,
  };
}

/** A service whose events are pushed by hand. */
class Service {
  list: Job[] = [];
  asked = 0;
  refuses: Error | null = null;
  hold: Promise<void> | null = null;
  readonly streams = new Map<string, { push(job: Job): void; end(): void; break(): void }>();
  closed: string[] = [];

  async jobs(): Promise<Job[]> {
    this.asked += 1;
    const { list, hold } = this;
    await hold;
    if (this.refuses) throw this.refuses;
    return list;
  }

  async *jobEvents(id: string, signal?: AbortSignal): AsyncGenerator<Job, void, undefined> {
    const queue: (Job | null | Error)[] = [];
    let wake = (): void => undefined;
    const add = (item: Job | null | Error): void => {
      queue.push(item);
      wake();
    };
    this.streams.set(id, {
      push: add,
      end: () => add(null),
      break: () => add(new Error("broken")),
    });
    signal?.addEventListener("abort", () => {
      this.closed.push(id);
      add(new DOMException("", "AbortError"));
    });
    for (;;) {
      const item = queue.shift();
      if (item === undefined) {
        await new Promise<void>((resolve) => {
          wake = resolve;
        });
        continue;
      }
      if (item === null) return;
      if (item instanceof Error || item instanceof DOMException) throw item;
      yield item;
    }
  }
}

let service: Service;
let told: Job[][];
let troubles: unknown[];
let feed: JobFeed;

function make(shows?: (job: Job) => boolean): JobFeed {
  return new JobFeed(
    service,
    { jobs: (jobs) => told.push([...jobs]), trouble: (error) => troubles.push(error) },
    shows,
  );
}

const shown = (): string[] => (told.at(-1) ?? []).map(({ jobID, status }) => `${jobID} ${status}`);
const settle = (ms = 0): Promise<unknown> => vi.advanceTimersByTimeAsync(ms);

beforeEach(() => {
  vi.useFakeTimers();
  service = new Service();
  told = [];
  troubles = [];
  feed = make();
});

afterEach(() => {
  feed.stop();
  vi.useRealTimers();
});

test("jobs come newest first, and those of others are left out", async () => {
  feed = make(({ request }) => request.session === "mine");
  const mine = (id: string): Job => {
    const made = job(id, { status: "successful" });
    return { ...made, request: { ...made.request, session: "mine" } };
  };
  service.list = [mine("a"), job("other"), mine("b")];
  feed.start();
  await settle();
  expect(shown()).toEqual(["b successful", "a successful"]);
  expect(service.streams.size).toBe(0);
});

test("a job that runs is followed by its events, and its end is followed by the list", async () => {
  const running = job("a");
  service.list = [running];
  feed.start();
  await settle();
  service.streams.get("a")?.push({ ...running, progress: 40, updated: job("").updated });
  await settle();
  expect(told.at(-1)?.[0]?.progress).toBe(40);
  const done = { ...running, status: "successful", updated: job("").updated } as const;
  service.list = [done];
  service.streams.get("a")?.push(done);
  service.streams.get("a")?.end();
  const before = service.asked;
  await settle();
  expect(shown()).toEqual(["a successful"]);
  expect(service.asked).toBe(before + 1);
});

test("a list that is older than an event changes nothing", async () => {
  const running = job("a");
  service.list = [running];
  feed.start();
  await settle();
  service.streams.get("a")?.push({ ...running, progress: 70, updated: job("").updated });
  await settle(5000);
  expect(service.asked).toBe(2);
  expect(told.at(-1)?.[0]?.progress).toBe(70);
});

test("only so many streams are open, those of running jobs first; the others are asked for", async () => {
  service.list = [
    job("w1", { status: "accepted", queue_place: 1 }),
    job("w2", { status: "accepted", queue_place: 2 }),
    job("r"),
  ];
  feed.start();
  await settle();
  expect([...service.streams.keys()]).toEqual(["r", "w1"]);
  await settle(1300);
  expect(service.asked).toBe(2);
});

test("where a stream breaks the job is polled, and followed again later", async () => {
  service.list = [job("a")];
  feed.start();
  await settle();
  service.streams.get("a")?.break();
  service.streams.clear();
  await settle();
  const asked = service.asked;
  await settle(4000);
  expect(service.asked).toBeGreaterThanOrEqual(asked + 3);
  expect(service.streams.size).toBe(0);
  await settle(15_000);
  expect([...service.streams.keys()]).toEqual(["a"]);
});

test("what was taken or removed while the list was on its way stays so", async () => {
  const old = job("old", { status: "failed" });
  service.list = [old];
  feed.start();
  await settle();
  let release = (): void => undefined;
  service.hold = new Promise((resolve) => {
    release = resolve;
  });
  void feed.read();
  await settle();
  feed.take(job("new", { status: "accepted" }));
  feed.remove("old");
  service.hold = null;
  release();
  await settle();
  expect(shown()).toEqual(["new accepted"]);
});

test("a list that cannot be read is told, and read again", async () => {
  service.refuses = new Error("away");
  feed.start();
  await settle();
  expect(troubles).toEqual([service.refuses]);
  service.refuses = null;
  await settle(10_100);
  expect(troubles.at(-1)).toBeUndefined();
});

test("stopping closes the streams and asks no more", async () => {
  service.list = [job("a"), job("b")];
  feed.start();
  await settle();
  const { asked } = service;
  feed.stop();
  expect(service.closed.sort()).toEqual(["a", "b"]);
  await settle(60_000);
  expect(service.asked).toBe(asked);
});
