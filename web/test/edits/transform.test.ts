import { expect, test } from "vitest";
import { ApiClient } from "../../src/api/client";
import type { SessionDocument } from "../../src/api/types";
import { CommandQueue } from "../../src/command-queue";
import { alongNormal, rotation, scaling, translation, twisting } from "../../src/edits/deformation";
import { TransformEditor } from "../../src/edits/transform";
import type { Notices, Questions } from "../../src/event-map";
import { Events } from "../../src/events";
import { SessionStore } from "../../src/session-store";
import { MockSession } from "../mock/session";

/** An editor over two bands of detail, and what it sends. */
function bench(painted = true, refusal?: () => object | null) {
  const shape = {
    count: 2,
    positions: new Float32Array([0, 0, 0, 1, 1, 1]),
    normals: new Float32Array([0, 0, 1, 0, 0, 1]),
    detail: new Float32Array(2),
  };
  const samples = painted ? 1 : 0;
  const document: SessionDocument = {
    ...new MockSession("session", "Name", shape).document(),
    levels: [0.04, 0.02, 0].map((scale, level) => ({ level, scale })),
    regions: { zero: { samples, operations: 1 }, one: { samples, operations: 1 }, named: [] },
  };
  const sent: { method: string; path: string; body: Record<string, unknown> }[] = [];
  const toasts: string[] = [];
  const client = new ApiClient("http://host/", async (url, init) => {
    const method = init?.method ?? "GET";
    if (method !== "GET")
      sent.push({
        method,
        path: new URL(String(url)).pathname,
        body: JSON.parse(String(init?.body ?? "{}")),
      });
    const refused = method === "GET" ? null : refusal?.();
    if (refused) return new Response(JSON.stringify(refused), { status: 413 });
    return new Response(JSON.stringify(document), { headers: { "Content-Type": "application/json" } });
  });
  const bus = new Events<Notices, Questions>();
  bus.on("toast", ({ title }) => toasts.push(title));
  const editor = new TransformEditor(
    bus,
    client,
    new CommandQueue(),
    new SessionStore(bus, document),
    () => {},
  );
  const posted = (): Record<string, unknown>[] =>
    sent.filter(({ method }) => method === "POST").map(({ body }) => body);
  return { editor, bus, sent, posted, toasts };
}

test("an edit is sent with its level, blend and deformation; detail only where it changes", async () => {
  const { editor, posted, toasts } = bench();
  const twist = twisting([0, 0, 0], [0, 1, 0], 90, 0.5);
  editor.setBlend("quintic");
  editor.setLevel(1);
  editor.set(twist);
  await editor.commit();
  expect(posted()).toEqual([{ level: 1, blend: "quintic", deformation: twist }]);
  expect(toasts).toEqual(["Twisted 90°"]);
  expect(editor.pending).toBe(false);
});

test("the detail alone is an edit, of the bands that are rebuilt, and starts over with the next one", async () => {
  const { editor, posted } = bench();
  editor.setGain(1, 1.5);
  expect(editor.pending).toBe(true);
  expect(editor.description).toBe("Detail 1, 1.5×");
  await editor.commit();
  expect(posted()).toEqual([
    { level: 0, blend: "quartic", deformation: translation([0, 0, 0]), gains: [1, 1.5] },
  ]);
  expect(editor.state.gains).toEqual([1, 1]);
  editor.setLevel(2);
  editor.setGain(0, 0);
  expect(editor.pending).toBe(false);
  await editor.commit();
  expect(posted().length).toBe(1);
  editor.setLevel(0);
  expect(editor.pending).toBe(true);
  editor.cancel();
  expect(editor.state.gains).toEqual([1, 1]);
  expect(editor.description).toBe("");
});

test("resampling goes with previews and edits, and stays for the next one", async () => {
  const { editor, sent, posted } = bench();
  const pull = translation([0, 0, 1]);
  const resampling = { bound: 2, min_spacing: 0, shear_aware: false, collect: 0 };
  editor.set(pull);
  await editor.preview.idle();
  editor.setResampling({ on: true, bound: 2 });
  await editor.preview.idle();
  expect(sent.map(({ body }) => body["resampling"])).toEqual([undefined, resampling]);
  await editor.commit();
  editor.set(pull);
  await editor.commit();
  expect(posted()).toEqual(Array(2).fill({ level: 0, blend: "quartic", deformation: pull, resampling }));
  editor.setResampling({ on: false });
  editor.set(pull);
  await editor.commit();
  expect(posted()[2]).not.toHaveProperty("resampling");
});

test("too many samples are told at the field until something changes, and the edit stays pending", async () => {
  let refusal: object | null = {
    title: "Too large",
    status: 413,
    limit: 300_000,
    actual: 412_345,
    errors: [{ pointer: "/resampling/max_samples", detail: "too many samples" }],
  };
  const { editor, toasts } = bench(true, () => refusal);
  editor.setResampling({ on: true });
  editor.set(translation([0, 0, 1]));
  await editor.preview.idle();
  expect(toasts).toEqual([]);
  expect(editor.state.resamplingFault?.text).toMatch(/412,345 .* 300,000 /);
  await editor.commit();
  expect(toasts).toEqual(["The edit was not recorded: Too large"]);
  expect(editor.state.resamplingFault).not.toBeNull();
  expect(editor.pending).toBe(true);
  refusal = null;
  editor.setResampling({ bound: 3 });
  expect(editor.state.resamplingFault).toBeNull();
  await editor.commit();
  expect(editor.pending).toBe(false);
});

test("a frame with other samples than the committed ones is told as resampled", async () => {
  const { editor, bus, sent } = bench();
  const states: string[] = [];
  bus.on("preview.changed", ({ state, resampled }) => states.push(resampled ? `${state}, resampled` : state));
  editor.setResampling({ on: true });
  editor.set(translation([0, 0, 1]));
  await editor.preview.idle();
  const sequence = editor.preview.lastSequence;
  bus.fire("frame.applied", { sequence, revision: 1, samples: 3 });
  bus.fire("frame.applied", { sequence, revision: 1, samples: 2 });
  expect(states).toEqual(["preview", "exact, resampled", "exact"]);
  expect(sent.length).toBe(1);
});

test("previews say the same as the edit that follows, and a number", async () => {
  const { editor, sent } = bench();
  editor.setGain(0, 0.5);
  await editor.preview.idle();
  editor.set(alongNormal(-0.25));
  await editor.preview.idle();
  const { method, path, body } = sent.at(-1) ?? {};
  expect([method, path]).toEqual(["PUT", "/v1/sessions/session/preview"]);
  expect(body).toMatchObject({ level: 0, deformation: alongNormal(-0.25), gains: [0.5, 1] });
  expect(body?.["sequence"]).toBe(editor.preview.lastSequence);
});

test("the pivot, the axis and the length carry a deformation along", () => {
  const { editor } = bench();
  editor.set(scaling([0, 0, 0], [2, 2, 2]));
  editor.setPivot([1, 2, 3]);
  expect(editor.state.deformation).toEqual(scaling([1, 2, 3], [2, 2, 2]));
  editor.set(twisting([0, 0, 0], [0, 1, 0], 30, 1));
  editor.setPivot([4, 5, 6]);
  editor.setAxis("x");
  expect(editor.state.deformation).toEqual(twisting([4, 5, 6], [1, 0, 0], 30, 1));
  editor.setTwist({ direction: [0, 0, 1], length: 2 });
  expect(editor.state.deformation).toEqual(twisting([4, 5, 6], [0, 0, 1], 30, 2));
});

test("nothing is made without both regions, or of what the server refuses", async () => {
  const { editor, sent } = bench(false);
  editor.set(alongNormal(1));
  editor.setGain(0, 0);
  expect(editor.state.deformation).toBeNull();
  const ready = bench().editor;
  ready.set(scaling([0, 0, 0], [0, 1, 1]));
  expect(ready.state.deformation).toBeNull();
  await editor.commit();
  expect(sent).toEqual([]);
});

test("steps are recorded as one edit, in their order", async () => {
  const { editor, posted } = bench();
  const [move, turn] = [translation([1, 0, 0]), rotation([0, 0, 0], [0, 1, 0], 30)];
  expect(editor.addStep()).toBe(false);
  editor.set(move);
  expect(editor.composing).toBe(false);
  expect(editor.keeps("rotate")).toBe(false);
  expect(editor.addStep()).toBe(true);
  expect(editor.composing).toBe(true);
  expect(editor.keeps("rotate")).toBe(true);
  expect(editor.keeps("orbit")).toBe(false);
  editor.begin("rotate");
  editor.set(turn);
  expect(editor.chooseStep(0)).toBe("move");
  expect(editor.state.deformation).toEqual(move);
  editor.swapSteps(0);
  await editor.commit();
  expect(posted()[0]).toMatchObject({ deformation: { type: "sequence", steps: [turn, move] } });
  expect(editor.state.steps).toEqual([null]);
});

test("along the normal goes first, and once", async () => {
  const { editor, posted } = bench();
  editor.set(translation([1, 0, 0]));
  editor.addStep();
  editor.begin("normal");
  editor.set(alongNormal(0.5));
  expect(editor.state.steps).toEqual([alongNormal(0.5), translation([1, 0, 0])]);
  editor.begin("scale");
  editor.set(scaling([0, 0, 0], [2, 2, 2]));
  editor.begin("normal");
  expect(editor.state.step).toBe(0);
  editor.set(alongNormal(0.25));
  await editor.commit();
  expect(posted()[0]).toMatchObject({
    deformation: {
      type: "sequence",
      steps: [alongNormal(0.25), translation([1, 0, 0]), scaling([0, 0, 0], [2, 2, 2])],
    },
  });
});

test("where there is no room for another step it is said, and none is lost", () => {
  const { editor } = bench();
  for (let i = 1; i < 8; ++i) {
    editor.set(translation([i, 0, 0]));
    expect(editor.addStep()).toBe(true);
  }
  editor.set(translation([8, 0, 0]));
  editor.begin("rotate");
  expect(editor.state.obstacle).toMatch(/at most 8 steps/);
  editor.set(rotation([0, 0, 0], [0, 1, 0], 30));
  expect(editor.state.steps).toHaveLength(8);
  expect(editor.state.steps.at(-1)).toEqual(translation([8, 0, 0]));
  expect(editor.removeStep(7)).toBe("move");
  expect(editor.state.obstacle).toBeNull();
  expect(editor.state.steps).toHaveLength(7);
});
