import type { Bus, SessionStore } from "../session-store";

/** How long all edits play. */
export const PLAY_MS = 4000;

/** What draws one part of the way; null goes back to the committed state. */
export type ShowPart = (s: number | null) => void;

/**
 * Plays the recorded edits part of the way: shown, never recorded. What is seen there can be looked at only: entering it lays
 * any tool down, taking one up leaves it, and so does any change of the session. While an edit is pending it cannot be entered.
 */
export class Player {
  private readonly bus_: Bus;
  private readonly store_: Pick<SessionStore, "document">;
  private readonly show_: ShowPart;
  private readonly now_: () => number;
  private s_: number | null = null;
  /** Of the session whose edits are shown. */
  private revision_ = 0;
  private timer_: ReturnType<typeof setInterval> | null = null;

  constructor(
    bus: Bus,
    store: Pick<SessionStore, "document">,
    show: ShowPart,
    now = () => performance.now(),
  ) {
    this.bus_ = bus;
    this.store_ = store;
    this.show_ = show;
    this.now_ = now;
    bus.function("animation.set", (s) => this.set(s));
    bus.function("animation.play", () => this.toggle());
    bus.function("animation.current", () => this.s_);
    bus.on("tool.changed", (tool) => {
      if (tool !== "orbit") this.set(null);
    });
    bus.on("session.changed", ({ revision }) => {
      if (revision !== this.revision_) this.set(null);
    });
    bus.on("transform.changed", () => {
      if (this.s_ !== null && bus.invoke("edit.pending")) this.set(null);
    });
  }

  get playing(): boolean {
    return this.timer_ !== null;
  }

  /** Shows the state at `s`, 0 … 1, and rests there; null leaves the animation. */
  set(s: number | null): void {
    if (s !== null && !this.enter()) return;
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
    if (!this.enter()) return;
    const from = this.s_ === null || this.s_ >= 1 ? 0 : this.s_;
    const begun = this.now_() - from * PLAY_MS;
    this.timer_ = setInterval(() => {
      const s = Math.min(1, (this.now_() - begun) / PLAY_MS);
      if (s >= 1) this.pause();
      this.show(s);
    }, 40);
    this.show(from);
  }

  /** Makes room for the animation; false where an edit is pending. */
  private enter(): boolean {
    if (this.s_ !== null) return true;
    if (this.bus_.invoke("edit.pending")) return false;
    if (this.bus_.invoke("tool.current") !== "orbit") this.bus_.invoke("tool.activate", "orbit");
    this.revision_ = this.store_.document.revision;
    return true;
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
