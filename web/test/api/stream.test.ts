import { expect, test } from "vitest";
import { type StreamEvent, StreamParser, type StreamSink } from "../../src/api/stream";
import { encodeFrame, encodeStreamRecord } from "../../src/protocol/frame-tools";
import { decodeFrame, type FrameBlock, FrameError, type FrameHeader } from "../../src/protocol/frames";
import { MockSession } from "../mock/session";
import { bumpySphere } from "../mock/shapes";

class Recorder implements StreamSink {
  log: string[] = [];
  blocks: FrameBlock[] = [];
  events: StreamEvent[] = [];
  frameBegin(header: FrameHeader): void {
    this.log.push(`begin ${header.presentBlocks}`);
  }
  frameBlock(block: FrameBlock): void {
    this.log.push(`block ${block.number}`);
    this.blocks.push(block);
  }
  frameEnd(): void {
    this.log.push("end");
  }
  event(event: StreamEvent): void {
    this.log.push(event.event);
    this.events.push(event);
  }
}

const frame = new MockSession("s", "sphere", bumpySphere(9000)).frame(null, 5);

function concat(...parts: Uint8Array[]): Uint8Array {
  const whole = new Uint8Array(parts.reduce((sum, part) => sum + part.byteLength, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.byteLength;
  }
  return whole;
}

function feed(bytes: Uint8Array, size: number): Recorder {
  const recorder = new Recorder();
  const parser = new StreamParser(recorder);
  for (let at = 0; at < bytes.byteLength; at += size) parser.push(bytes.slice(at, at + size));
  return recorder;
}

const event = (body: unknown): Uint8Array =>
  encodeStreamRecord(2, new TextEncoder().encode(JSON.stringify(body)));

for (const size of [7, 1000, 65_536, 10_000_000]) {
  test(`a stream cut into pieces of ${size} bytes tells the same`, () => {
    const bytes = concat(
      event({ event: "heartbeat" }),
      encodeStreamRecord(1, frame),
      encodeStreamRecord(99, new Uint8Array(123)),
      encodeStreamRecord(2, new TextEncoder().encode('{"event":"end","reason":"done"}')),
    );
    const recorder = feed(bytes, size);
    const whole = decodeFrame(frame);
    expect(recorder.log).toEqual([
      "heartbeat",
      `begin ${whole.header.presentBlocks}`,
      ...whole.blocks.map((block) => `block ${block.number}`),
      "end",
      "end",
    ]);
    expect(recorder.blocks).toEqual(whole.blocks);
  });
}

test("blocks come out while their frame is still on its way", () => {
  const recorder = new Recorder();
  const parser = new StreamParser(recorder);
  const bytes = encodeStreamRecord(1, frame);
  parser.push(bytes.slice(0, Math.floor(bytes.byteLength / 2)));
  expect(recorder.blocks.length).toBeGreaterThan(0);
  expect(recorder.log).not.toContain("end");
  parser.push(bytes.slice(Math.floor(bytes.byteLength / 2)));
  expect(recorder.log.at(-1)).toBe("end");
});

test("records that hold nothing are passed over", () => {
  const recorder = feed(concat(encodeStreamRecord(77, new Uint8Array(0)), event({ event: "heartbeat" })), 3);
  expect(recorder.log).toEqual(["heartbeat"]);
});

test("hostile frames are refused", () => {
  const damaged = (change: (bytes: Uint8Array, view: DataView) => void): Uint8Array => {
    const bytes = frame.slice();
    change(bytes, new DataView(bytes.buffer));
    return encodeStreamRecord(1, bytes);
  };
  const refused = [
    damaged((bytes) => bytes.set([0], 0)),
    damaged((_, view) => view.setUint32(8, 5, true)),
    damaged((_, view) => view.setUint32(96, 1 << 30, true)),
    damaged((_, view) => view.setUint32(100, 0, true)),
    damaged((_, view) => view.setUint32(100, 70_000, true)),
    damaged((_, view) => view.setFloat32(104, Number.NaN, true)),
    damaged((_, view) => view.setFloat32(116, -1, true)),
    encodeStreamRecord(1, frame.slice(0, 40)),
    encodeStreamRecord(1, new Uint8Array(concat(frame, new Uint8Array(4)))),
  ];
  for (const bytes of refused) expect(() => feed(bytes, 4096)).toThrow(FrameError);
});

test("a key frame that repeats a block is refused", () => {
  const whole = decodeFrame(frame);
  const [first, , ...rest] = whole.blocks;
  if (!first) throw new Error("the frame has no block");
  const bytes = encodeFrame({ header: whole.header, blocks: [first, first, ...rest] });
  expect(() => feed(encodeStreamRecord(1, bytes), 4096)).toThrow(FrameError);
});
