import type { ApiClient } from "./api/client";
import { FrameReader } from "./api/frame-reader";
import { ApiError } from "./api/problem";
import { SessionStream, type StreamEvent, type StreamSink } from "./api/stream";
import { reportError } from "./edits/errors";
import { type FrameBlock, type FrameHeader, hasAttribute } from "./protocol/frames";
import type { Viewport } from "./scene/viewport";
import type { Bus, SessionStore } from "./session-store";

/** A stream tells at most this often how much of a key frame has come. */
const TELL_MS = 80;

/**
 * Where the picture's samples come from: the session's stream, or one frame of a coarser level. Each block goes to the GPU
 * as it comes.
 */
export class FrameSource {
  /** What the screen last showed whole. */
  last: FrameHeader | null = null;

  private readonly bus_: Bus;
  private readonly client_: ApiClient;
  private readonly store_: SessionStore;
  private readonly viewport_: Viewport;
  private readonly stream_: SessionStream;
  private readonly onFirst_: (header: FrameHeader) => void;
  /** What is shown by part cannot be had. */
  private readonly onLost_: () => void;
  private level_: number | null = null;
  /** What part of the recorded edits is shown; null: all of them. */
  private part_: number | null = null;
  private abort_ = new AbortController();
  private loading_ = false;
  /** Of the stream's frames while a level is shown. */
  private newest_ = -1;
  private told_ = 0;

  constructor(
    bus: Bus,
    client: ApiClient,
    store: SessionStore,
    viewport: Viewport,
    onFirst: (header: FrameHeader) => void,
    onLost: () => void,
  ) {
    this.bus_ = bus;
    this.client_ = client;
    this.store_ = store;
    this.viewport_ = viewport;
    this.onFirst_ = onFirst;
    this.onLost_ = onLost;
    // While something else is shown, the stream's frames say only that there is something new to load.
    const sink: StreamSink = {
      frameBegin: (header) => this.live && this.frameBegin(header),
      frameBlock: (block, header) => this.live && this.frameBlock(block, header),
      frameEnd: (header) => (this.live ? this.frameEnd(header) : this.refreshLevel(header.revision)),
      event: (event) => this.event(event),
    };
    this.stream_ = new SessionStream(client, store.id, sink, {
      onState: (state) => bus.fire("connection.changed", state),
      mayRetry: (error) => {
        const status = error instanceof ApiError ? error.status : 0;
        const passing = status === 0 || status === 409 || status === 429 || status >= 500;
        if (!passing) reportError(bus, error, "The stream was refused");
        return passing;
      },
    });
  }

  start(): void {
    this.stream_.start();
  }

  /** Begins anew with a key frame, as after a lost context. */
  restart(): void {
    this.viewport_.clearSurface();
    if (this.last) this.tellLoad(this.last, false);
    this.showAgain();
  }

  /** What streams is what is shown. */
  private get live(): boolean {
    return this.level_ === null && this.part_ === null;
  }

  /** Shows the recorded edits part of the way; one load at a time, and the newest wins. Null: all of them, as they stream. */
  showPart(s: number | null): void {
    if (s === this.part_) return;
    this.part_ = s;
    if (s !== null && this.loading_) return;
    if (s === null) this.abort_.abort();
    this.showAgain();
  }

  private showAgain(): void {
    if (this.live) this.stream_.start();
    else void this.loadStill();
  }

  /** Shows a coarser level, or, with null, the whole surface as it streams. */
  showLevel(level: number | null): void {
    if (level === this.level_) return;
    this.level_ = level;
    this.abort_.abort();
    if (this.last) this.tellLoad(this.last, false);
    this.showAgain();
  }

  stop(): void {
    this.stream_.stop();
    this.abort_.abort();
  }

  private frameBegin(header: FrameHeader): void {
    const key = header.kind === "key";
    this.viewport_.beginFrame(
      {
        sampleCount: header.sampleCount,
        blockSize: header.blockSize,
        blockCount: header.blockCount,
        hasNormals: hasAttribute(header, "normal"),
        hasDetail: hasAttribute(header, "detail"),
        hasColor: hasAttribute(header, "color"),
        hasMarks: hasAttribute(header, "marks"),
        hasRadius: hasAttribute(header, "radius"),
        stretchRange: header.stretchRange,
      },
      key,
    );
    this.viewport_.setBounds(header.bounds.center, header.bounds.radius);
    if (this.last === null) this.onFirst_(header);
    if (this.last?.detailRange !== header.detailRange) this.bus_.fire("detail.range", header.detailRange);
    if (this.last?.stretchRange !== header.stretchRange) this.bus_.fire("stretch.range", header.stretchRange);
    if (this.last === null) this.last = header;
    if (this.tellsOf(header)) this.tellLoad(header, false);
  }

  private frameBlock(block: FrameBlock, header: FrameHeader): void {
    this.viewport_.putBlock({
      index: block.number,
      count: block.count,
      minimum: block.minimum,
      extent: block.extent,
      positions: block.positionT,
      normals: block.normal,
      detail: block.detailStretch,
      color: block.color,
      marks: block.marks,
      radius: block.radius,
    });
    if (this.tellsOf(header) && performance.now() - this.told_ > TELL_MS) this.tellLoad(header, false);
  }

  private frameEnd(header: FrameHeader): void {
    this.last = header;
    const { sequence, revision, sampleCount } = header;
    this.viewport_.endFrame(revision, sequence !== 0);
    this.tellLoad(header, true);
    this.bus_.fire("frame.applied", { sequence, revision, samples: sampleCount });
  }

  /** Whether it is told how much has come: not of each frame of a drag, which the hand is ahead of anyway. */
  private tellsOf(header: FrameHeader): boolean {
    return header.kind === "key" && (header.sequence === 0 || !this.viewport_.whole);
  }

  private event(event: StreamEvent): void {
    if (event.event !== "session") return;
    const { event: _, ...document } = event;
    this.store_.update(document);
  }

  private tellLoad(header: FrameHeader, complete: boolean): void {
    this.told_ = performance.now();
    this.bus_.fire("load.changed", {
      loaded: this.viewport_.arrivedSamples,
      total: header.sampleCount,
      complete,
    });
  }

  /** Loads the level that is shown again, once the session has moved on; one load at a time. */
  private refreshLevel(revision: number): void {
    this.newest_ = Math.max(this.newest_, revision);
    if (!this.live && !this.loading_ && this.newest_ > (this.last?.revision ?? -1)) void this.loadStill();
  }

  /** One frame by itself, as a response body: of the level and of the part that are shown. */
  private async loadStill(): Promise<void> {
    const level = this.level_ ?? this.store_.document.levels.length - 1;
    const part = this.part_;
    const abort = new AbortController();
    const { signal } = abort;
    this.abort_ = abort;
    this.loading_ = true;
    let failed = false;
    try {
      const response = await this.client_.frame(this.store_.id, level, signal, part ?? undefined);
      const bytes = new Uint8Array(await response.arrayBuffer());
      if (signal.aborted) return;
      const frame = new FrameReader(bytes.byteLength);
      frame.fill((into) => {
        into.set(bytes);
        return bytes.byteLength;
      });
      const { header } = frame;
      if (!header) return;
      this.frameBegin(header);
      for (let block = frame.next(); block; block = frame.next()) this.frameBlock(block, header);
      this.frameEnd(header);
    } catch (error) {
      if (!signal.aborted)
        reportError(this.bus_, error, part === null ? "This level could not be shown" : "No animation");
      this.newest_ = -1;
      // Where it was left on purpose, another part may be wanted already.
      failed = !signal.aborted;
    } finally {
      if (this.abort_ === abort) {
        this.loading_ = false;
        // The hand has moved on meanwhile.
        if (failed && part !== null) this.onLost_();
        else if (this.part_ !== part && this.part_ !== null) void this.loadStill();
        else this.refreshLevel(-1);
      }
    }
  }
}
