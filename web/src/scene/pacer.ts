/** Sub-pixel offsets of the accumulated pictures: the Halton sequence of bases 2 and 3. */
export function jitterOf(index: number): readonly [number, number] {
  if (index === 0) return [0, 0];
  return [halton(index, 2) - 0.5, halton(index, 3) - 0.5];
}

function halton(index: number, base: number): number {
  let value = 0;
  let digit = 1 / base;
  for (let rest = index; rest > 0; rest = Math.floor(rest / base)) {
    value += digit * (rest % base);
    digit /= base;
  }
  return value;
}

export interface PacerStep {
  kind: "none" | "picture";
  /** Samples to draw at most. */
  budget: number;
  /** Which of the accumulated pictures: 0 begins anew. */
  index: number;
  jitter: readonly [number, number];
}

const REFINEMENTS = 16;
const LEAST_REFINEMENTS = 4;
const LEAST_PATIENT_REFINEMENTS = 7;
const REFINEMENT_MS = 1200;
const REST_MS = 110;
const LEAST_BUDGET = 30_000;
/** What a picture may take while things move. */
const TARGET_MS = 40;
const QUICK_MS = 22;

/**
 * When to draw what. While things move, each picture is drawn once, with as many samples as the machine keeps up with; at
 * rest the whole surface is drawn, then accumulated over sub-pixel offsets until edges are smooth, then nothing is drawn.
 */
export class Pacer {
  /** Refine further on slow machines too: for pictures that nobody waits at. */
  patient = false;
  private changed_ = true;
  private index_ = 0;
  private partial_ = false;
  private budget_ = Number.POSITIVE_INFINITY;
  private lastTick_ = 0;
  private lastChange_ = 0;
  private restSince_ = 0;

  get settled(): boolean {
    return !this.changed_ && !this.partial_ && this.done(this.lastTick_);
  }

  /** Samples that fit while things move. */
  get budget(): number {
    return this.budget_;
  }

  change(): void {
    this.changed_ = true;
  }

  next(now: number, samples: number): PacerStep {
    this.lastTick_ = now;
    if (this.changed_) {
      this.changed_ = false;
      this.lastChange_ = now;
      this.restSince_ = 0;
      this.index_ = 0;
      this.partial_ = this.budget_ < samples;
      return { kind: "picture", budget: this.budget_, index: 0, jitter: jitterOf(0) };
    }
    if (now - this.lastChange_ < REST_MS || (!this.partial_ && this.done(now))) {
      return { kind: "none", budget: 0, index: this.index_, jitter: [0, 0] };
    }
    if (this.restSince_ === 0) this.restSince_ = now;
    if (this.partial_) {
      this.partial_ = false;
      this.index_ = 0;
    } else {
      this.index_ += 1;
    }
    return {
      kind: "picture",
      budget: Number.POSITIVE_INFINITY,
      index: this.index_,
      jitter: jitterOf(this.index_),
    };
  }

  /** Milliseconds until the next tick is due: 0 at the next frame, null where nothing is left to do. */
  wait(now: number): number | null {
    if (this.changed_) return 0;
    if (now - this.lastChange_ < REST_MS) return Math.max(1, REST_MS - (now - this.lastChange_));
    return this.partial_ || !this.done(now) ? 0 : null;
  }

  private done(now: number): boolean {
    if (this.index_ >= REFINEMENTS - 1) return true;
    const least = this.patient ? LEAST_PATIENT_REFINEMENTS : LEAST_REFINEMENTS;
    return this.index_ >= least && this.restSince_ > 0 && now - this.restSince_ > REFINEMENT_MS;
  }

  /** A picture of `drawn` of `samples` samples took `ms` on the GPU: the next ones while things move are cut to fit. */
  finished(ms: number, drawn: number, samples: number): void {
    if (ms > TARGET_MS) {
      this.budget_ = Math.max(LEAST_BUDGET, drawn * Math.max(0.25, TARGET_MS / ms));
    } else if (ms < QUICK_MS && this.budget_ < samples) {
      this.budget_ *= 1.3;
      if (this.budget_ >= samples) this.budget_ = Number.POSITIVE_INFINITY;
    }
  }
}
