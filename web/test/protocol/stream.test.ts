import { describe, expect, it } from "vitest";
import { encodeStreamRecord } from "../../src/protocol/frame-tools";
import { decodeFrame } from "../../src/protocol/frames";
import {
  readStreamRecords,
  StreamError,
  type StreamRecord,
  StreamRecordParser,
  streamRecordTypes,
} from "../../src/protocol/stream";
import { goldenBytes } from "./golden";

const stream = goldenBytes("vectors/stream.bin");

function bodyOf(
  bytes: Uint8Array,
  chunkLength: number,
): { body: ReadableStream<Uint8Array>; cancelled: () => boolean } {
  let at = 0;
  let cancelled = false;
  const body = new ReadableStream<Uint8Array>({
    pull(controller) {
      if (at >= bytes.length) return controller.close();
      controller.enqueue(bytes.subarray(at, at + chunkLength));
      at += chunkLength;
    },
    cancel() {
      cancelled = true;
    },
  });
  return { body, cancelled: () => cancelled };
}

function expectGoldenRecords(records: StreamRecord[]): void {
  expect(records.map((record) => record.type)).toEqual([2, 1, 77, 2, 2]);
  const text = (index: number): string => new TextDecoder().decode(records[index]?.payload);
  expect(JSON.parse(text(0))).toEqual({ event: "progress", phase: "normals", fraction: 0.25 });
  expect(decodeFrame(records[1]?.payload ?? new Uint8Array()).header.kind).toBe("delta");
  expect(text(2)).toBe("receivers skip this");
  expect(text(3)).toBe("");
  expect(JSON.parse(text(4))).toEqual({ event: "end", reason: "the session was deleted" });
}

describe("the stream of records", () => {
  it.each([1, 2, 3, 7, 8, 9, 64, 100_000])("comes whole out of chunks of %i bytes", async (length) => {
    const parser = new StreamRecordParser();
    const records: StreamRecord[] = [];
    for (let at = 0; at < stream.length; at += length)
      records.push(...parser.push(stream.subarray(at, at + length)));
    expect(parser.atRecordEnd).toBe(true);
    expectGoldenRecords(records);

    const read: StreamRecord[] = [];
    for await (const record of readStreamRecords(bodyOf(stream, length).body)) read.push(record);
    expectGoldenRecords(read);
  });

  it("gives each payload a buffer of its own, so that frames need no copy", () => {
    for (const record of new StreamRecordParser().push(stream)) {
      expect(record.payload.byteOffset).toBe(0);
      expect(record.payload.buffer.byteLength).toBe(record.payload.length);
    }
  });

  it("notices an end inside a record", async () => {
    const parser = new StreamRecordParser();
    parser.push(stream.subarray(0, 5));
    expect(parser.atRecordEnd).toBe(false);
    const read = async (): Promise<void> => {
      for await (const _ of readStreamRecords(bodyOf(stream.subarray(0, stream.length - 1), 50).body)) void _;
    };
    await expect(read()).rejects.toThrow(StreamError);
  });

  it("refuses a record beyond the limit before it keeps any of it", () => {
    const header = encodeStreamRecord(streamRecordTypes.frame, new Uint8Array()).slice();
    new DataView(header.buffer).setUint32(4, 0xffffffff, true);
    expect(() => new StreamRecordParser().push(header)).toThrow(StreamError);
    expect(() => new StreamRecordParser(10).push(stream)).toThrow(StreamError);
  });

  it("ends the transfer where the listener stops", async () => {
    const { body, cancelled } = bodyOf(stream, 10);
    for await (const record of readStreamRecords(body)) {
      expect(record.type).toBe(2);
      break;
    }
    expect(cancelled()).toBe(true);
  });
});
