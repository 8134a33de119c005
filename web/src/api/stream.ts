import { type FrameBlock, FrameError, type FrameHeader } from "../protocol/frames";
import { streamRecordHeaderBytes, streamRecordTypes } from "../protocol/stream";
import { ByteQueue } from "./byte-queue";
import type { ApiClient } from "./client";
import { FrameReader } from "./frame-reader";
import type { SessionDocument } from "./types";

const MAX_EVENT_BYTES = 1 << 20;
const MAX_FRAME_BYTES = 2 ** 31;

export type StreamEvent =
  | ({ event: "session" } & SessionDocument)
  | { event: "progress"; progress?: { phase: string; fraction: number }; phase?: string; fraction?: number }
  | { event: "heartbeat" }
  | { event: "end"; reason?: string }
  | { event: "unknown" };

/** What a stream's listener is told. Blocks come while their frame is still on its way. */
export interface StreamSink {
  frameBegin(header: FrameHeader): void;
  frameBlock(block: FrameBlock, header: FrameHeader): void;
  frameEnd(header: FrameHeader): void;
  event(event: StreamEvent): void;
}

/**
 * Cuts a stream's bytes into records, and frames into blocks as soon as each is whole: a key frame covers the whole shape
 * long before its last byte. Throws FrameError on what FRAMES.md forbids.
 */
export class StreamParser {
  private readonly queue_ = new ByteQueue();
  private readonly sink_: StreamSink;
  private readonly head_ = new Uint8Array(streamRecordHeaderBytes);
  private frame_: FrameReader | null = null;
  private begun_ = false;
  private body_: Uint8Array | null = null;
  private bodyFilled_ = 0;
  private skip_ = 0;
  private type_ = 0;

  constructor(sink: StreamSink) {
    this.sink_ = sink;
  }

  push(chunk: Uint8Array): void {
    this.queue_.push(chunk);
    while (this.step()) {
      // Each step takes one part of a record.
    }
  }

  private step(): boolean {
    if (this.frame_) return this.readFrame(this.frame_);
    if (this.body_) return this.readEvent(this.body_);
    if (this.skip_ > 0) return this.skipBytes();
    if (this.queue_.size < streamRecordHeaderBytes) return false;
    this.queue_.takeInto(this.head_, 0, streamRecordHeaderBytes);
    const view = new DataView(this.head_.buffer);
    this.type_ = view.getUint32(0, true);
    const length = view.getUint32(4, true);
    if (this.type_ === streamRecordTypes.frame) {
      if (length > MAX_FRAME_BYTES) throw new FrameError("a frame of more than 2 GiB");
      this.frame_ = new FrameReader(length);
      this.begun_ = false;
    } else if (this.type_ === streamRecordTypes.event) {
      if (length > MAX_EVENT_BYTES) throw new FrameError("an event of more than 1 MiB");
      this.body_ = new Uint8Array(length);
      this.bodyFilled_ = 0;
    } else {
      this.skip_ = length;
    }
    return true;
  }

  private readFrame(frame: FrameReader): boolean {
    const before = frame.missing;
    frame.fill((into, at, want) => this.queue_.takeInto(into, at, want));
    const header = frame.header;
    if (!header) return false;
    if (!this.begun_) {
      this.begun_ = true;
      this.sink_.frameBegin(header);
    }
    for (let block = frame.next(); block; block = frame.next()) this.sink_.frameBlock(block, header);
    if (!frame.done) {
      if (frame.missing === 0) throw new FrameError("a frame ends before its blocks do");
      return before !== frame.missing && this.queue_.size > 0;
    }
    this.frame_ = null;
    this.sink_.frameEnd(header);
    return true;
  }

  private readEvent(body: Uint8Array): boolean {
    this.bodyFilled_ += this.queue_.takeInto(body, this.bodyFilled_, body.byteLength - this.bodyFilled_);
    if (this.bodyFilled_ < body.byteLength) return false;
    this.body_ = null;
    const event = JSON.parse(new TextDecoder().decode(body)) as StreamEvent;
    this.sink_.event(event);
    return true;
  }

  private skipBytes(): boolean {
    const scratch = new Uint8Array(Math.min(this.skip_, this.queue_.size));
    this.skip_ -= this.queue_.takeInto(scratch, 0, scratch.byteLength);
    return this.skip_ === 0;
  }
}

const RETRY_MS = [300, 800, 2000, 5000];
/** The server sends heartbeats, at least one a minute; a stream silent for longer than this is taken for dead. */
const SILENCE_MS = 75_000;

export interface StreamStatus {
  onState(state: "live" | "connecting" | "lost", error?: unknown): void;
  /** Whether to try again after this error. */
  mayRetry(error: unknown): boolean;
}

/** The session's stream, opened again when it breaks: each opening begins with a key frame. */
export class SessionStream {
  private readonly client_: ApiClient;
  private readonly session_: string;
  private readonly sink_: StreamSink;
  private readonly status_: StreamStatus;
  private controller_ = new AbortController();
  private stopped_ = true;

  constructor(client: ApiClient, session: string, sink: StreamSink, status: StreamStatus) {
    this.client_ = client;
    this.session_ = session;
    this.sink_ = sink;
    this.status_ = status;
  }

  start(): void {
    this.stop();
    this.stopped_ = false;
    this.controller_ = new AbortController();
    void this.run(this.controller_);
  }

  stop(): void {
    this.stopped_ = true;
    this.controller_.abort();
  }

  private async run(controller: AbortController): Promise<void> {
    for (let attempt = 0; !controller.signal.aborted; ++attempt) {
      this.status_.onState("connecting");
      try {
        const response = await this.client_.stream(this.session_, controller.signal);
        this.status_.onState("live");
        attempt = 0;
        await this.read(response, controller.signal);
      } catch (error) {
        if (controller.signal.aborted) return;
        this.status_.onState("lost", error);
        if (!this.status_.mayRetry(error)) return;
      }
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS[Math.min(attempt, RETRY_MS.length - 1)]));
    }
  }

  private async read(response: Response, signal: AbortSignal): Promise<void> {
    const reader = response.body?.getReader();
    if (!reader) throw new FrameError("the stream has no body");
    const parser = new StreamParser(this.sink_);
    let silence: ReturnType<typeof setTimeout> | undefined;
    try {
      while (!signal.aborted) {
        clearTimeout(silence);
        silence = setTimeout(() => void reader.cancel(), SILENCE_MS);
        const { done, value } = await reader.read();
        if (done) return;
        if (!this.stopped_ || !signal.aborted) parser.push(value);
      }
    } finally {
      clearTimeout(silence);
      await reader.cancel().catch(() => undefined);
    }
  }
}
