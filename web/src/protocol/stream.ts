/** The records of a session's stream (protocol/FRAMES.md, "Streams"), put together from chunks that are cut anywhere. */

export const streamRecordTypes = { frame: 1, event: 2 } as const;
export const streamRecordHeaderBytes = 8;
/** Payload bytes that a record may have, unless told otherwise: a key frame of some 40,000,000 samples. */
export const defaultMaxPayloadBytes = 2 ** 30;

export interface StreamRecord {
  /** Receivers skip the types that they do not know. */
  type: number;
  /** A buffer of its own, so that frames decode without a copy. */
  payload: Uint8Array<ArrayBuffer>;
}

/** A stream that cannot go on: a record beyond the limit, or cut off by the end. */
export class StreamError extends Error {
  override readonly name = "StreamError";
}

/** Feed it chunks; it answers the records that are whole. A payload is copied once, into its own buffer. */
export class StreamRecordParser {
  private readonly header_ = new Uint8Array(streamRecordHeaderBytes);
  private headerFilled_ = 0;
  private payload_: Uint8Array<ArrayBuffer> | null = null;
  private payloadFilled_ = 0;
  private type_ = 0;

  constructor(private readonly maxPayloadBytes_: number = defaultMaxPayloadBytes) {}

  /** The records that this chunk completes, in order. Throws a StreamError; the parser is of no use afterwards. */
  push(chunk: Uint8Array): StreamRecord[] {
    const records: StreamRecord[] = [];
    let at = 0;
    while (at < chunk.length || this.payloadIsWhole()) {
      if (!this.payload_) {
        at += this.fillHeader(chunk.subarray(at));
        continue;
      }
      const part = chunk.subarray(at, at + this.payload_.length - this.payloadFilled_);
      this.payload_.set(part, this.payloadFilled_);
      this.payloadFilled_ += part.length;
      at += part.length;
      if (this.payloadIsWhole()) {
        records.push({ type: this.type_, payload: this.payload_ });
        this.payload_ = null;
        this.headerFilled_ = 0;
      }
    }
    return records;
  }

  /** Whether the stream may end here: no record is cut off. */
  get atRecordEnd(): boolean {
    return this.headerFilled_ === 0;
  }

  private payloadIsWhole(): boolean {
    return this.payload_ !== null && this.payloadFilled_ === this.payload_.length;
  }

  /** Takes what is missing of a header; returns how many bytes that were. */
  private fillHeader(bytes: Uint8Array): number {
    const part = bytes.subarray(0, streamRecordHeaderBytes - this.headerFilled_);
    this.header_.set(part, this.headerFilled_);
    this.headerFilled_ += part.length;
    if (this.headerFilled_ === streamRecordHeaderBytes) {
      const view = new DataView(this.header_.buffer);
      const length = view.getUint32(4, true);
      if (length > this.maxPayloadBytes_) {
        throw new StreamError(
          `a record announces ${length} bytes, beyond the limit of ${this.maxPayloadBytes_}`,
        );
      }
      this.type_ = view.getUint32(0, true);
      this.payload_ = new Uint8Array(length);
      this.payloadFilled_ = 0;
    }
    return part.length;
  }
}

/** The records of a whole response body. Throws a StreamError where the body ends inside a record. */
export async function* readStreamRecords(
  body: ReadableStream<Uint8Array>,
  maxPayloadBytes: number = defaultMaxPayloadBytes,
): AsyncGenerator<StreamRecord> {
  const parser = new StreamRecordParser(maxPayloadBytes);
  const reader = body.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      yield* parser.push(value);
    }
    if (!parser.atRecordEnd) throw new StreamError("the stream ended inside a record");
  } finally {
    // Whoever stops listening early also ends the transfer.
    await reader.cancel().catch(() => undefined);
  }
}
