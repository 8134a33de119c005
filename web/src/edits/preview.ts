import type { Blend, Deformation } from "../api/types";
import { type Conditions, type LookAhead, lookAhead, type Parameters } from "./residual";

export interface PreviewTransport {
  put(deformation: Deformation, sequence: number): Promise<void>;
  end(): Promise<void>;
}

export interface PreviewListener {
  /** What the picture must add to the server's last frame. */
  onLookAhead(ahead: LookAhead): void;
  /** The newest parameters' own frame is on the screen; it took so long since they were sent. */
  onExact(latencyMs: number): void;
  /** The hand is ahead of the frame; `covered`: the picture looks ahead that far. */
  onAhead(covered: boolean): void;
  onError(error: unknown): void;
}

interface Sent extends Parameters {
  at: number;
}

const PLAIN: Conditions = { blend: "quartic", gains: "" };

/**
 * Sends a drag's parameters: one request in flight, the newest wins, sequence numbers rise. Knows which of them the frame
 * on the screen shows, and so what the hand is ahead of it.
 */
export class PreviewSender {
  private readonly transport_: PreviewTransport;
  private readonly listener_: PreviewListener;
  private readonly now_: () => number;
  private readonly sent_ = new Map<number, Sent>();
  private sequence_: number;
  private newest_ = 0;
  private wanted_: Parameters | null = null;
  private shown_: Parameters | null = null;
  /** Of the frame's t: committed frames are quartic, or, for a while, what the last preview was. */
  private frameBlend_: Blend | null = "quartic";
  private otherBlends_ = false;
  private waiting_ = false;
  private flight_: Promise<void> | null = null;
  private active_ = false;

  /** `firstSequence` must exceed all that were sent to the session before: the clock does. */
  constructor(
    transport: PreviewTransport,
    listener: PreviewListener,
    firstSequence: number,
    now = () => performance.now(),
  ) {
    this.transport_ = transport;
    this.listener_ = listener;
    this.sequence_ = firstSequence;
    this.now_ = now;
  }

  /** The last sequence number that was sent; 0 before the first. */
  get lastSequence(): number {
    return this.newest_;
  }

  get wanted(): Deformation | null {
    return this.wanted_?.deformation ?? null;
  }

  /** New parameters of the hand. */
  want(deformation: Deformation, under: Conditions = PLAIN): void {
    this.wanted_ = { deformation, under };
    this.otherBlends_ ||= under.blend !== "quartic";
    this.active_ = true;
    this.waiting_ = true;
    this.listener_.onAhead(this.tellAhead().covered);
    this.pump();
  }

  /** A frame of the stream has come whole: `sequence` as its header says, 0 for the committed state. */
  frameShown(sequence: number): void {
    const sent = sequence === 0 ? undefined : this.sent_.get(sequence);
    this.shown_ = sent ?? null;
    this.frameBlend_ = sent?.under.blend ?? (this.otherBlends_ ? null : "quartic");
    for (const old of this.sent_.keys()) {
      if (sequence !== 0 && old < sequence) this.sent_.delete(old);
    }
    this.tellAhead();
    if (sent && sequence === this.newest_ && !this.waiting_) this.listener_.onExact(this.now_() - sent.at);
  }

  /** The drag was recorded: the next committed frame shows it, nothing is left to send. */
  settle(): void {
    this.wanted_ = null;
    this.waiting_ = false;
    this.active_ = false;
    this.sent_.clear();
  }

  /** The drag was dropped: the picture goes back at once, the server after it. */
  async cancel(): Promise<void> {
    const active = this.active_;
    this.wanted_ = null;
    this.waiting_ = false;
    this.active_ = false;
    this.tellAhead();
    if (!active) return;
    await this.idle();
    await this.transport_.end();
  }

  /** Settles when no request is in flight. */
  async idle(): Promise<void> {
    while (this.flight_) await this.flight_;
  }

  private pump(): void {
    if (this.flight_ || !this.waiting_ || !this.wanted_) return;
    this.waiting_ = false;
    this.sequence_ += 1;
    const sequence = this.sequence_;
    this.newest_ = sequence;
    this.sent_.set(sequence, { ...this.wanted_, at: this.now_() });
    this.flight_ = this.transport_
      .put(this.wanted_.deformation, sequence)
      .catch((error: unknown) => {
        this.waiting_ = false;
        this.listener_.onError(error);
      })
      .finally(() => {
        this.flight_ = null;
        this.pump();
      });
  }

  private tellAhead(): LookAhead {
    const ahead = lookAhead(this.shown_, this.wanted_, this.frameBlend_);
    this.listener_.onLookAhead(ahead);
    return ahead;
  }
}
