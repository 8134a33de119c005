import { expect, test } from "vitest";
import type { Deformation } from "../../src/api/types";
import { translation } from "../../src/edits/deformation";
import { PreviewSender } from "../../src/edits/preview";
import type { Residual } from "../../src/edits/residual";

class Bench {
  readonly puts: { deformation: Deformation; sequence: number }[] = [];
  readonly residuals: (Residual | null)[] = [];
  readonly exact: number[] = [];
  readonly covered: boolean[] = [];
  readonly errors: unknown[] = [];
  ended = 0;
  now = 0;
  fail = false;
  private open_: (() => void)[] = [];
  readonly sender = new PreviewSender(
    {
      put: (deformation, sequence) => {
        this.puts.push({ deformation, sequence });
        return new Promise((resolve, reject) =>
          this.open_.push(() => (this.fail ? reject(new Error("refused")) : resolve())),
        );
      },
      end: async () => {
        this.ended += 1;
      },
    },
    {
      onLookAhead: ({ residual }) => this.residuals.push(residual),
      onExact: (latency) => this.exact.push(latency),
      onAhead: (covered) => this.covered.push(covered),
      onError: (error) => this.errors.push(error),
    },
    100,
    () => this.now,
  );

  async answer(): Promise<void> {
    this.open_.shift()?.();
    await new Promise((resolve) => setTimeout(resolve, 0));
  }
}

test("one request is in flight and the newest parameters win", async () => {
  const bench = new Bench();
  for (let x = 1; x <= 5; ++x) bench.sender.want(translation([x, 0, 0]));
  expect(bench.puts.map(({ sequence }) => sequence)).toEqual([101]);
  await bench.answer();
  expect(bench.puts.map(({ deformation }) => deformation)).toEqual([
    translation([1, 0, 0]),
    translation([5, 0, 0]),
  ]);
  await bench.answer();
  expect(bench.puts.map(({ sequence }) => sequence)).toEqual([101, 102]);
});

test("the residual is what the hand is ahead of the frame on the screen", async () => {
  const bench = new Bench();
  bench.sender.want(translation([1, 0, 0]));
  expect(bench.residuals.at(-1)).toEqual({ kind: "translation", vector: [1, 0, 0] });
  bench.sender.frameShown(101);
  expect(bench.residuals.at(-1)).toEqual({ kind: "translation", vector: [0, 0, 0] });
  bench.sender.want(translation([1.5, 0, 0]));
  expect(bench.residuals.at(-1)).toEqual({ kind: "translation", vector: [0.5, 0, 0] });
});

test("only the newest frame is exact, and tells how long it took", async () => {
  const bench = new Bench();
  bench.now = 10;
  bench.sender.want(translation([1, 0, 0]));
  bench.sender.want(translation([2, 0, 0]));
  bench.now = 30;
  await bench.answer();
  bench.sender.frameShown(101);
  expect(bench.exact).toEqual([]);
  bench.now = 55;
  bench.sender.frameShown(102);
  expect(bench.exact).toEqual([25]);
});

test("a drag that is dropped goes back at once and is then ended at the server", async () => {
  const bench = new Bench();
  bench.sender.want(translation([1, 0, 0]));
  bench.sender.frameShown(101);
  const done = bench.sender.cancel();
  expect(bench.residuals.at(-1)).toEqual({ kind: "translation", vector: [-1, 0, 0] });
  expect(bench.ended).toBe(0);
  await bench.answer();
  await done;
  expect(bench.ended).toBe(1);
  bench.sender.frameShown(0);
  expect(bench.residuals.at(-1)).toBeNull();
});

test("where nothing was dragged, nothing is ended", async () => {
  const bench = new Bench();
  await bench.sender.cancel();
  expect(bench.ended).toBe(0);
});

test("a recorded drag leaves no residual once the committed frame comes", () => {
  const bench = new Bench();
  bench.sender.want(translation([1, 0, 0]));
  bench.sender.settle();
  bench.sender.frameShown(0);
  expect(bench.residuals.at(-1)).toBeNull();
});

test("a refused preview is told once and not sent again", async () => {
  const bench = new Bench();
  bench.fail = true;
  bench.sender.want(translation([1, 0, 0]));
  bench.sender.want(translation([2, 0, 0]));
  await bench.answer();
  expect(bench.errors.length).toBe(1);
  expect(bench.puts.length).toBe(1);
});

test("what the picture cannot look ahead to is told", () => {
  const bench = new Bench();
  bench.sender.want(translation([1, 0, 0]), { blend: "cosine", gains: "" });
  bench.sender.want(translation([1, 0, 0]), { blend: "cosine", gains: "0.5" });
  expect(bench.covered).toEqual([true, false]);
  bench.sender.frameShown(101);
  bench.sender.want(translation([2, 0, 0]), { blend: "cosine", gains: "" });
  bench.sender.want(translation([2, 0, 0]), { blend: "cubic", gains: "" });
  expect(bench.covered.slice(2)).toEqual([true, false]);
});
