import { expect, test } from "vitest";
import { ApiClient } from "../../src/api/client";
import type { EditBody, RegionName, RegionOperation } from "../../src/api/types";
import { CommandQueue } from "../../src/command-queue";
import { HistoryEditor } from "../../src/edits/history";
import { DEFAULT_PAINT, modeOf } from "../../src/edits/paint-settings";
import { RegionEditor } from "../../src/edits/regions";
import type { Notices, Questions } from "../../src/event-map";
import { Events } from "../../src/events";
import { SessionStore } from "../../src/session-store";
import { MockSession } from "../mock/session";

const EDIT = {
  level: 0,
  deformation: { type: "translation", vector: [0, 0, 1] },
} as const satisfies EditBody;

/** An editor over a row of ten samples along x, and the session behind it. */
function bench() {
  const count = 10;
  const session = new MockSession("session", "Name", {
    count,
    positions: Float32Array.from({ length: 3 * count }, (_, i) => (i % 3 === 0 ? i / 3 : 0)),
    normals: new Float32Array(3 * count),
    detail: new Float32Array(count),
  });
  /** Of puts: how many are accepted before one is refused. */
  const fault = { next: false, puts: Number.POSITIVE_INFINITY };
  const client = new ApiClient("http://host/", async (url, init) => {
    const [, , , , region, operations] = new URL(url).pathname.split("/");
    const name = region === "regions" ? (operations as RegionName) : "zero";
    const method = init?.method ?? "GET";
    if (fault.next)
      return new Response(JSON.stringify({ title: "No", type: "/problems/x", status: 422 }), { status: 422 });
    const answer = (body: unknown) => new Response(JSON.stringify(body));
    if (region === "edits") return answer({ head: session.head, edits: session.edits });
    if (region === "head") {
      session.head = JSON.parse(String(init?.body)).edit;
      session.revision += 1;
      return answer(session.document());
    }
    if (region === "recipe") {
      // Two edits and both regions, as one change.
      session.commit(EDIT);
      session.commit(EDIT);
      session.put("zero", [ball(0, 0.5)]);
      session.put("one", [ball(9, 0.5)]);
      session.revision = store.document.revision + 1;
      return answer(session.document());
    }
    if (method === "PUT" && fault.puts-- === 0)
      return new Response(JSON.stringify({ title: "Too large", type: "/problems/x", status: 413 }), {
        status: 413,
      });
    if (method === "GET") return answer({ operations: session.operations[name] });
    const body = init?.body ? JSON.parse(String(init.body)) : null;
    if (method === "POST") {
      const changed = session.paint(name, body as RegionOperation);
      return answer({ ...session.document(), changed });
    }
    session.put(name, (body?.operations ?? []) as RegionOperation[]);
    return answer(session.document());
  });
  const bus = new Events<Notices, Questions>();
  const toasts: string[] = [];
  let next = { undo: false, redo: false };
  bus.on("toast", ({ title }) => toasts.push(title));
  bus.on("painting.history", (told) => {
    next = told;
  });
  const store = new SessionStore(bus, session.document());
  const queue = new CommandQueue();
  const regions = new RegionEditor(bus, client, queue, store);
  new HistoryEditor(bus, client, queue, store, regions);
  /** What the transforms do at their end. */
  const edit = (): void => {
    const { head } = store.document.history;
    session.commit(EDIT);
    bus.fire("edit.recorded", head);
    store.update(session.document());
  };
  const marks = (): string => [...session.marks].join("");
  return { bus, session, store, regions, edit, marks, toasts, fault, next: () => next };
}

const ball = (x: number, radius: number, mode: "add" | "remove" = "add"): RegionOperation => ({
  mode,
  shape: { type: "sphere", center: [x, 0, 0], radius },
  ...(mode === "add" && { steal: true }),
});

test("strokes are undone and redone one by one, what they stole included", async () => {
  const { regions, marks, next } = bench();
  expect(next()).toEqual({ undo: false, redo: false });
  await regions.paint("zero", [ball(2, 2.5)]);
  await regions.paint("one", [ball(5, 1.5)]);
  expect(marks()).toBe("1111222000");
  await regions.paint("zero", [ball(4, 0.5)]);
  expect(marks()).toBe("1111122000");
  expect(next()).toEqual({ undo: true, redo: false });
  expect(await regions.step(-1)).toBe(true);
  expect(marks()).toBe("1111222000");
  expect(await regions.step(-1)).toBe(true);
  expect(marks()).toBe("1111100000");
  expect(next()).toEqual({ undo: true, redo: true });
  expect(await regions.step(1)).toBe(true);
  expect(marks()).toBe("1111222000");
  expect(await regions.step(-1)).toBe(true);
  expect(await regions.step(-1)).toBe(true);
  expect(marks()).toBe("0000000000");
  expect(await regions.step(-1)).toBe(false);
});

test("commands on a whole region are undone", async () => {
  const { regions, marks } = bench();
  await regions.paint("one", [ball(2, 1.5)]);
  await regions.command("one", "grow", 1);
  expect(marks()).toBe("2222200000");
  await regions.command("one", "shrink", 1);
  expect(marks()).toBe("2222000000");
  await regions.command("one", "invert", 0);
  expect(marks()).toBe("0000222222");
  await regions.command("one", "clear", 0);
  expect(marks()).toBe("0000000000");
  await regions.command("one", "all", 0);
  expect(marks()).toBe("2222222222");
  for (const expected of ["0000000000", "0000222222", "2222000000", "2222200000", "0222000000"]) {
    expect(await regions.step(-1)).toBe(true);
    expect(marks()).toBe(expected);
  }
});

test("the eraser and a change of both regions are one step each", async () => {
  const { regions, marks } = bench();
  await regions.paintEach([
    ["zero", ball(1, 1.5)],
    ["one", ball(8, 1.5)],
  ]);
  const painted = "1110000222";
  expect(marks()).toBe(painted);
  const erased = await regions.paint("erase", [ball(5, 3.5, "remove")]);
  expect(marks()).toBe("1100000002");
  expect(erased?.changed).toBe(3);
  await regions.step(-1);
  expect(marks()).toBe(painted);
  await regions.step(-1);
  expect(marks()).toBe("0000000000");
});

test("what others paint meanwhile ends the undo rather than being painted over", async () => {
  const { session, store, regions, marks, toasts, next } = bench();
  await regions.paint("one", [ball(2, 1.5)]);
  session.paint("zero", ball(8, 1.5));
  // The stream tells.
  store.update(session.document());
  expect(await regions.step(-1)).toBe(true);
  expect(toasts).toEqual(["The painting has changed meanwhile"]);
  expect(marks()).toBe("0222000111");
  await regions.paint("one", [ball(5, 0.5)]);
  expect(next().undo).toBe(true);
  session.paint("zero", ball(7, 0.5, "remove"));
  // Not told yet when the next change is made.
  await regions.paint("one", [ball(4, 0.5)]);
  expect(next()).toEqual({ undo: false, redo: false });
  expect(await regions.step(-1)).toBe(false);
  expect(marks()).toBe("0222220011");
});

test("a refused change is told and leaves nothing to undo", async () => {
  const { regions, toasts, fault, next } = bench();
  fault.next = true;
  expect(await regions.paint("one", [ball(2, 1.5)])).toBeNull();
  expect(await regions.command("one", "clear", 0)).toBeNull();
  expect(toasts).toEqual(["The painting was refused: No", "The region was not cleared: No"]);
  expect(next().undo).toBe(false);
});

test("held keys go before the buttons, and only outlines keep", () => {
  const lasso = { ...DEFAULT_PAINT, method: "lasso" } as const;
  const none = { shiftKey: false, altKey: false };
  expect(modeOf(lasso, "zero", none)).toBe("add");
  expect(modeOf(lasso, "zero", { ...none, shiftKey: true })).toBe("remove");
  expect(modeOf(lasso, "zero", { ...none, altKey: true })).toBe("intersect");
  expect(modeOf({ ...lasso, mode: "intersect" }, "one", none)).toBe("intersect");
  expect(modeOf({ ...DEFAULT_PAINT, mode: "intersect" }, "one", none)).toBe("add");
  expect(modeOf({ ...DEFAULT_PAINT, mode: "remove" }, "one", none)).toBe("remove");
  expect(modeOf(DEFAULT_PAINT, "one", { ...none, altKey: true })).toBe("add");
  expect(modeOf(lasso, "erase", { ...none, altKey: true })).toBe("remove");
});

test("edit, paint, jump to the start, other edit: undo takes the edit back, then the painting", async () => {
  const { bus, session, regions, edit, marks, toasts } = bench();
  await regions.paint("zero", [ball(8, 0.5)]);
  edit();
  await regions.paint("one", [ball(2, 1.5)]);
  await bus.invoke("edit.jump", 0);
  edit();
  const painted = marks();
  await bus.invoke("edit.undo");
  expect([session.head, marks()]).toEqual([0, painted]);
  // What was painted under the edit that is gone stands in its place, and goes before what was painted earlier.
  await bus.invoke("edit.undo");
  expect(marks()).toBe("0000000010");
  await bus.invoke("edit.undo");
  expect(marks()).toBe("0000000000");
  for (const expected of ["0000000010", painted]) {
    await bus.invoke("edit.redo");
    expect([session.head, marks()]).toEqual([0, expected]);
  }
  await bus.invoke("edit.redo");
  expect([session.head, marks()]).toEqual([1, painted]);
  expect(toasts).toEqual([]);
});

test("edit, paint, undo, undo, other edit: nothing is left to redo", async () => {
  const { bus, session, regions, edit, marks, next } = bench();
  edit();
  await regions.paint("one", [ball(2, 1.5)]);
  await bus.invoke("edit.undo");
  await bus.invoke("edit.undo");
  expect([session.head, marks()]).toEqual([0, "0000000000"]);
  edit();
  expect(next()).toEqual({ undo: false, redo: false });
  await bus.invoke("edit.redo");
  expect([session.head, marks()]).toEqual([1, "0000000000"]);
});

test("a recipe is undone and redone as a whole, its regions with its edits", async () => {
  const { bus, session, regions, edit, marks, toasts, next } = bench();
  edit();
  await regions.paint("one", [ball(2, 1.5)]);
  await regions.applyRecipe({});
  expect([session.head, marks()]).toEqual([3, "1000000002"]);
  expect(next()).toEqual({ undo: true, redo: false });
  await bus.invoke("edit.undo");
  expect([session.head, marks()]).toEqual([1, "0222000000"]);
  await bus.invoke("edit.redo");
  expect([session.head, marks()]).toEqual([3, "1000000002"]);
  await bus.invoke("edit.undo");
  await bus.invoke("edit.undo");
  expect([session.head, marks()]).toEqual([1, "0000000000"]);
  await bus.invoke("edit.undo");
  expect(session.head).toBe(0);
  expect(toasts).toEqual([]);
});

test("an undo whose second half is refused changes nothing, says why, and can be tried again", async () => {
  const { bus, regions, fault, marks, toasts, next } = bench();
  await regions.paint("one", [ball(2, 1.5)]);
  await regions.paint("zero", [ball(3, 1.5)]);
  expect(marks()).toBe("0211100000");
  fault.puts = 1;
  await bus.invoke("edit.undo");
  expect(marks()).toBe("0211100000");
  expect(toasts).toEqual(["The painting was not undone: Too large"]);
  expect(next().undo).toBe(true);
  await bus.invoke("edit.undo");
  expect(marks()).toBe("0222000000");
  fault.puts = 1;
  await bus.invoke("edit.redo");
  expect(marks()).toBe("0222000000");
  await bus.invoke("edit.redo");
  expect(marks()).toBe("0211100000");
  expect(toasts.length).toBe(2);
});
