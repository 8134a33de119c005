import { expect, test } from "vitest";
import type { SurfaceBlock, SurfaceLayout } from "../../src/scene/sample-surface";
import { SurfaceStage } from "../../src/scene/surface-stage";

const BLOCK = 100;

function layoutOf(sampleCount: number, changes: Partial<SurfaceLayout> = {}): SurfaceLayout {
  return {
    sampleCount,
    blockSize: BLOCK,
    blockCount: Math.ceil(sampleCount / BLOCK),
    hasNormals: true,
    hasDetail: true,
    hasColor: false,
    hasMarks: true,
    hasRadius: true,
    stretchRange: 0,
    ...changes,
  };
}

const blockOf = (index: number): SurfaceBlock => ({ index }) as SurfaceBlock;

/** A stage whose surfaces keep the numbers of their blocks. */
function bench() {
  const made: { room: number; blocks: number[]; disposed: boolean }[] = [];
  const stage = new SurfaceStage((first, room) => {
    let layout = first;
    const surface = {
      room,
      blocks: [] as number[],
      disposed: false,
      get layout() {
        return layout;
      },
      begin(next: SurfaceLayout): boolean {
        if (next.hasColor !== layout.hasColor || next.blockCount > room) return false;
        layout = next;
        surface.blocks.length = 0;
        return true;
      },
      put: (block: SurfaceBlock) => void surface.blocks.push(block.index),
      dispose: () => {
        surface.disposed = true;
      },
    };
    made.push(surface);
    return surface;
  });
  const frame = (samples: number, last = false): void => {
    const layout = layoutOf(samples);
    stage.begin(layout, true);
    for (let i = 0; i < layout.blockCount; ++i) stage.put(blockOf(i));
    stage.end(last);
  };
  return { stage, made, frame };
}

test("the first frame shows while it comes, a later key frame once it is whole", () => {
  const { stage, made } = bench();
  stage.begin(layoutOf(250), true);
  expect(stage.front).toBe(made[0]);
  expect(stage.whole).toBe(false);
  for (const i of [0, 1, 2]) expect(stage.put(blockOf(i))).toBe(true);
  stage.end(true);
  expect(stage.whole).toBe(true);

  stage.begin(layoutOf(430), true);
  stage.put(blockOf(0));
  expect(stage.front).toBe(made[0]);
  expect(stage.front?.layout.sampleCount).toBe(250);
  expect(made[0]?.blocks).toEqual([0, 1, 2]);
  for (const i of [1, 2, 3, 4]) stage.put(blockOf(i));
  stage.end(false);
  expect(stage.front).toBe(made[1]);
  expect(stage.front?.layout.sampleCount).toBe(430);
  expect(made[1]?.blocks).toEqual([0, 1, 2, 3, 4]);
});

test("frames of a drag whose counts differ take turns in two sets of buffers, which grow by half", () => {
  const { stage, made, frame } = bench();
  frame(1000, true);
  for (let samples = 1010; samples <= 2200; samples += 10) frame(samples);
  expect(stage.front?.layout.sampleCount).toBe(2200);
  // 10 blocks, then 15, 22.5 of each of the two: 120 frames make room a handful of times.
  expect(made.map(({ room }) => room)).toEqual([10, 15, 15, 23, 23]);
  expect(made.filter(({ disposed }) => !disposed).length).toBe(2);
  for (let samples = 2200; samples >= 1000; samples -= 50) frame(samples);
  expect(made.length).toBe(5);
  // The recorded edit needs one set only.
  frame(1700, true);
  expect(made.filter(({ disposed }) => !disposed)).toEqual([stage.front]);
});

test("room that a large preview took goes back once frames are small again", () => {
  const { stage, made, frame } = bench();
  frame(500);
  frame(50_000);
  frame(40_000);
  frame(500);
  frame(500, true);
  expect(stage.front?.room).toBe(5);
  expect(made.filter(({ disposed }) => !disposed)).toEqual([stage.front]);
});

test("a delta goes to the frame on the screen, and to no other one", () => {
  const { stage, made, frame } = bench();
  frame(300, true);
  // Deltas have no radii.
  stage.begin(layoutOf(300, { hasRadius: false }), false);
  expect(stage.put(blockOf(1))).toBe(true);
  stage.end(false);
  expect(made[0]?.blocks).toEqual([0, 1, 2, 1]);
  for (const other of [layoutOf(301), layoutOf(300, { stretchRange: 2 })]) {
    stage.begin(other, false);
    expect(stage.put(blockOf(0))).toBe(false);
    stage.end(false);
  }
  expect(made[0]?.blocks.length).toBe(4);
  expect(stage.front?.layout.stretchRange).toBe(0);
});

test("a key frame that breaks off leaves the picture, and the next one begins anew", () => {
  const { stage, made, frame } = bench();
  frame(300, true);
  stage.begin(layoutOf(500), true);
  stage.put(blockOf(0));
  frame(400);
  expect(stage.front?.layout.sampleCount).toBe(400);
  expect(made[1]?.blocks).toEqual([0, 1, 2, 3]);
});

test("other attributes need other buffers, and what is cleared is given back", () => {
  const { stage, made, frame } = bench();
  frame(300, true);
  stage.begin(layoutOf(300, { hasColor: true }), true);
  stage.end(true);
  expect(stage.front).toBe(made[1]);
  expect(made[0]?.disposed).toBe(true);
  stage.clear();
  expect(stage.front).toBeNull();
  expect(stage.whole).toBe(false);
  expect(made[1]?.disposed).toBe(true);
});
