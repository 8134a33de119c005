import type { Bus } from "../session-store";

/** How long all edits play. */
export const PLAY_MS = 4000;

/** What draws one part of the way; null goes back to the committed state. */
export type ShowPart = (s: number | null) => void;

/** Plays the recorded edits part of the way: shown, never recorded. Taking up any tool leaves it. */
export class Player {
  private readonly bus_: Bus;
  private readonly show_: ShowPart;
  private readonly now_: () => number;
  private s_: number | null = null;
  private timer_: ReturnType<typeof setInterval> | null = null;

  constructor(bus: Bus, show: ShowPart, now = () => performance.now()) {
    this.bus_ = bus;
    this.show_ = show;
    this.now_ = now;
    bus.function("animation.set", (s) => this.set(s));
    bus.function("animation.play", () => this.toggle());
    bus.function("animation.current", () => this.s_);
    bus.on("tool.changed", (tool) => {
      if (tool !== "orbit") this.set(null);
    });
  }

  get playing(): boolean {
    return this.timer_ !== null;
  }

  /** Shows the state at `s`, 0 … 1, and rests there; null leaves the animation. */
  set(s: number | null): void {
    this.pause();
    this.show(s);
  }

  /** Plays on from where it is, from the start where it is at the end, or pauses. */
  toggle(): void {
    if (this.playing) {
      this.pause();
      this.show(this.s_);
      return;
    }
    const from = this.s_ === null || this.s_ >= 1 ? 0 : this.s_;
    const begun = this.now_() - from * PLAY_MS;
    this.timer_ = setInterval(() => {
      const s = Math.min(1, (this.now_() - begun) / PLAY_MS);
      if (s >= 1) this.pause();
      this.show(s);
    }, 40);
    this.show(from);
  }

  private pause(): void {
    if (this.timer_ !== null) clearInterval(this.timer_);
    this.timer_ = null;
  }

  private show(s: number | null): void {
    if (s === null && this.s_ === null) return;
    this.s_ = s;
    this.show_(s);
    this.bus_.fire("animation.changed", { s, playing: this.playing });
  }
}
