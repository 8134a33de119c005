import type { SurfaceBlock, SurfaceLayout } from "./sample-surface";

/** How much more room is made than a frame needs that is larger than all before it. */
const GROWTH = 1.5;
/** Room that is so many times what a frame needs goes back: a large preview must not keep its memory for ever. */
const MOST_SLACK = 4;

/** Buffers that one frame at a time is kept in. */
export interface StagedSurface {
  readonly layout: SurfaceLayout;
  /** Blocks that there is room for. */
  readonly room: number;
  /** Takes up another frame: its blocks are all to come. False where it does not fit the buffers. */
  begin(layout: SurfaceLayout): boolean;
  put(block: SurfaceBlock): void;
  dispose(): void;
}

/** Whether a delta of layout `delta` belongs to the frame; radii are never in a delta, and stay as they are. */
const continues = (frame: SurfaceLayout, delta: SurfaceLayout): boolean =>
  (Object.keys(frame) as (keyof SurfaceLayout)[]).every(
    (key) => key === "hasRadius" || frame[key] === delta[key],
  );

/**
 * The frame on the screen, and the next one while it comes. Key frames may hold other samples in other blocks, as each frame
 * of a drag with resampling does: they fill buffers of their own and take the screen when they are whole. Only the first
 * frame shows while it comes. Two sets of buffers take turns, and grow by half where a frame needs more.
 */
export class SurfaceStage<Surface extends StagedSurface> {
  private readonly make_: (layout: SurfaceLayout, room: number) => Surface;
  private front_: Surface | null = null;
  private back_: Surface | null = null;
  private coming_: Surface | null = null;
  private whole_ = false;

  constructor(make: (layout: SurfaceLayout, room: number) => Surface) {
    this.make_ = make;
  }

  /** What is drawn. */
  get front(): Surface | null {
    return this.front_;
  }

  /** What blocks go to; outside of a frame what is drawn. */
  get coming(): Surface | null {
    return this.coming_ ?? this.front_;
  }

  /** Whether a frame is on the screen whole. */
  get whole(): boolean {
    return this.whole_;
  }

  /** A frame begins; a delta that belongs to another frame than the one on the screen is left aside. */
  begin(layout: SurfaceLayout, key: boolean): void {
    if (!key) {
      this.coming_ = this.front_ && continues(this.front_.layout, layout) ? this.front_ : null;
      return;
    }
    if (this.whole_) this.coming_ = this.back_ = this.madeFor(this.back_, layout);
    else this.coming_ = this.front_ = this.madeFor(this.front_, layout);
  }

  /** False where there is no surface that the block belongs to. */
  put(block: SurfaceBlock): boolean {
    this.coming_?.put(block);
    return this.coming_ !== null;
  }

  /** The frame is whole. `last`: no other samples are about to follow, so that one set of buffers is enough. */
  end(last: boolean): void {
    if (this.coming_ && this.coming_ === this.back_) {
      this.back_ = this.front_;
      this.front_ = this.coming_;
    }
    this.whole_ ||= this.coming_ !== null;
    this.coming_ = null;
    if (!last) return;
    this.back_?.dispose();
    this.back_ = null;
  }

  clear(): void {
    this.front_?.dispose();
    this.back_?.dispose();
    this.forget();
  }

  /** The buffers are gone already. */
  forget(): void {
    this.front_ = this.back_ = this.coming_ = null;
    this.whole_ = false;
  }

  private madeFor(surface: Surface | null, layout: SurfaceLayout): Surface {
    const wasteful = (room: number) => room > MOST_SLACK * layout.blockCount;
    if (surface && !wasteful(surface.room) && surface.begin(layout)) return surface;
    const known = Math.max(this.front_?.room ?? 0, this.back_?.room ?? 0);
    const most = wasteful(known) ? 0 : known;
    surface?.dispose();
    const grown = most === 0 ? 0 : Math.ceil(GROWTH * most);
    return this.make_(layout, layout.blockCount <= most ? most : Math.max(layout.blockCount, grown));
  }
}
