import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type { Blend, Deformation, EditBody, ElementaryDeformation, SessionDocument } from "../api/types";
import type { CommandQueue } from "../command-queue";
import { type ToolName, TRANSFORM_KINDS, type TransformKind, type TransformState } from "../event-map";
import type { Vec3 } from "../math/vec3";
import type { Bus, SessionStore } from "../session-store";
import {
  AXES,
  deformationFault,
  describeEdit,
  isIdentity,
  KIND_OF_TYPE,
  pivotOf,
  translation,
  withPivot,
} from "./deformation";
import { reportChangedMeanwhile, reportError } from "./errors";
import { PreviewSender } from "./preview";
import {
  faultOfProblem,
  type KeptText,
  loadResampling,
  type ResamplingChoice,
  type ResamplingFault,
  resamplingOf,
  saveResampling,
} from "./resampling";
import type { LookAhead } from "./residual";
import {
  allSteps,
  composed,
  MAX_STEPS,
  normalStep,
  ONE_STEP,
  type Steps,
  withNormalFirst,
  withoutStep,
  withStepAdded,
  withStepChosen,
  withSwapped,
} from "./steps";

/** Nothing is previewed. */
const NO_PREVIEW = { state: "none", resampled: false, latencyMs: 0, samplesPerSecond: 0 } as const;
const KEPT: () => KeptText = () => sessionStorage;

function obstacleOf(session: SessionDocument): string | null {
  if (session.state !== "ready") return "The session is still being prepared.";
  const { zero, one } = session.regions;
  if (zero.samples === 0 && one.samples === 0)
    return "Paint a zero-region that stays and a one-region that moves.";
  if (zero.samples === 0) return "Paint a zero-region: what must stay in place.";
  if (one.samples === 0) return "Paint a one-region: what must move as a whole.";
  return null;
}

/** The transform that is being made: previewed while it changes, recorded or dropped at its end. */
export class TransformEditor {
  readonly preview: PreviewSender;
  private readonly bus_: Bus;
  private readonly client_: ApiClient;
  private readonly queue_: CommandQueue;
  private readonly store_: SessionStore;
  /** Of the step that the hand is at. */
  private deformation_: ElementaryDeformation | null = null;
  private steps_: Steps = ONE_STEP;
  private pivot_: Vec3 = [0, 0, 0];
  private axis_: TransformState["axis"] = null;
  private pivotEditing_ = false;
  private twist_: TransformState["twist"] = { direction: [0, 1, 0], length: 1 };
  private level_ = 0;
  private blend_: Blend = "quartic";
  private gains_: number[];
  private resampling_: ResamplingChoice;
  private resamplingFault_: ResamplingFault | null = null;
  /** Of the last frame that came whole. */
  private frameSamples_: number;
  private committing_: number | null = null;
  /** The tool asks for a step that there is no room for. */
  private full_ = false;

  constructor(
    bus: Bus,
    client: ApiClient,
    queue: CommandQueue,
    store: SessionStore,
    onLookAhead: (ahead: LookAhead) => void,
  ) {
    this.bus_ = bus;
    this.client_ = client;
    this.queue_ = queue;
    this.store_ = store;
    this.gains_ = store.document.levels.slice(1).map(() => 1);
    this.resampling_ = loadResampling(store.id, KEPT);
    this.frameSamples_ = store.document.sample_count;
    this.preview = new PreviewSender(
      {
        put: (deformation, sequence) => client.putPreview(store.id, this.body(deformation), sequence),
        end: () => client.endPreview(store.id),
      },
      {
        onLookAhead,
        onAhead: (covered) =>
          bus.fire("preview.changed", { ...NO_PREVIEW, state: covered ? "preview" : "waiting" }),
        onExact: (latencyMs) => {
          const samplesPerSecond = latencyMs > 0 ? (this.frameSamples_ / latencyMs) * 1000 : 0;
          const resampled = this.frameSamples_ !== store.document.sample_count;
          bus.fire("preview.changed", { state: "exact", resampled, latencyMs, samplesPerSecond });
        },
        onError: (error) => {
          if (!this.takeFault(error)) reportError(bus, error, "The preview was refused");
        },
      },
      Date.now(),
    );
    bus.function("edit.commit", () => this.commit());
    bus.function("edit.cancel", () => this.cancel());
    bus.function("edit.pending", () => this.pending);
    bus.on("session.changed", () => this.tell());
    bus.on("frame.applied", ({ sequence, revision, samples }) => {
      this.frameSamples_ = samples;
      // The recorded edit's frame may come before the answer that says so.
      if (this.committing_ !== null && sequence === 0 && revision > this.committing_) this.settle();
      this.preview.frameShown(sequence);
    });
  }

  get state(): TransformState {
    return {
      deformation: this.deformation_,
      steps: allSteps(this.steps_, this.deformation_),
      step: this.steps_.at,
      pivot: this.pivot_,
      axis: this.axis_,
      pivotEditing: this.pivotEditing_,
      twist: this.twist_,
      level: this.level_,
      blend: this.blend_,
      gains: this.gains_,
      resampling: this.resampling_,
      resamplingFault: this.resamplingFault_,
      obstacle:
        obstacleOf(this.store_.document) ??
        (this.full_ ? `An edit has at most ${MAX_STEPS} steps. Choose one of them, or apply.` : null),
    };
  }

  /** Whether something waits to be recorded or dropped. */
  get pending(): boolean {
    const whole = this.whole;
    return whole !== null && (!isIdentity(whole) || this.changesDetail);
  }

  /** Several steps make one edit: changing the tool goes to another step. */
  get composing(): boolean {
    return this.steps_.others.length > 0;
  }

  /** The edit as it stands, in words; empty where nothing is pending. */
  get description(): string {
    const whole = this.whole;
    return whole && this.pending ? describeEdit(this.body(whole)) : "";
  }

  /** All steps together. */
  private get whole(): Deformation | null {
    return composed(this.steps_, this.deformation_);
  }

  private get changesDetail(): boolean {
    return this.gains_.some((gain, band) => band >= this.level_ && gain !== 1);
  }

  /** The current step. */
  set(deformation: ElementaryDeformation): void {
    if (this.state.obstacle || deformationFault(deformation)) return;
    this.deformation_ = deformation;
    this.again();
  }

  /** Takes up a kind of step: the current one where it is of that kind, else a new one behind what is there. */
  begin(kind: TransformKind): void {
    this.full_ = false;
    if (!this.composing) return;
    if (this.deformation_ && KIND_OF_TYPE[this.deformation_.type] === kind) return;
    this.addStep();
    this.full_ = this.deformation_ !== null;
    if (this.full_) this.tell();
    if (kind !== "normal") return;
    const known = normalStep(this.steps_, this.deformation_);
    if (known >= 0) this.chooseStep(known);
    else this.steps_ = withNormalFirst(this.steps_);
    this.tell();
  }

  /** Whether what is pending goes on under another tool, rather than being recorded when it is left. */
  keeps(next: ToolName): boolean {
    const kind = TRANSFORM_KINDS.find((each) => each === next);
    if (!kind) return false;
    return this.composing || (this.deformation_ !== null && KIND_OF_TYPE[this.deformation_.type] === kind);
  }

  /** Sets the current step down and begins another one; false where there is nothing to set down, or no room. */
  addStep(): boolean {
    const steps = withStepAdded(this.steps_, this.deformation_);
    if (!steps) {
      // An empty step takes another kind as it is.
      if (this.deformation_ && isIdentity(this.deformation_)) this.deformation_ = null;
      this.tell();
      return false;
    }
    this.steps_ = steps;
    this.deformation_ = null;
    this.pivotEditing_ = false;
    this.tell();
    return true;
  }

  /** Goes to a step; answers the tool that it belongs to. */
  chooseStep(place: number): TransformKind | null {
    const chosen = withStepChosen(this.steps_, this.deformation_, place);
    if (!chosen) return null;
    this.takeStep(chosen.steps, chosen.current);
    return KIND_OF_TYPE[chosen.current.type];
  }

  /** Takes a step away; answers the tool of the one that is current then. */
  removeStep(place: number): TransformKind | null {
    const { steps, current } = withoutStep(this.steps_, this.deformation_, place);
    this.takeStep(steps, current);
    return current && KIND_OF_TYPE[current.type];
  }

  /** Changes the places of a step and the next one. */
  swapSteps(first: number): void {
    this.steps_ = withSwapped(this.steps_, this.deformation_, first);
    this.again();
  }

  private takeStep(steps: Steps, current: ElementaryDeformation | null): void {
    this.full_ = false;
    this.steps_ = steps;
    this.deformation_ = current;
    this.pivotEditing_ = false;
    if (current) this.pivot_ = pivotOf(current) ?? this.pivot_;
    if (current?.type === "twist")
      this.twist_ = { direction: current.axis.direction, length: current.length };
    this.again();
  }

  /** What turns and twists turn about and what a scale leaves in place, in model space. */
  setPivot(pivot: Vec3): void {
    this.pivot_ = pivot;
    const deformation = this.deformation_;
    const moved = deformation && !isIdentity(deformation) ? withPivot(deformation, pivot) : null;
    if (moved) this.set(moved);
    else this.tell();
  }

  /** Holds an axis; a twist turns about it. */
  setAxis(axis: TransformState["axis"]): void {
    this.axis_ = axis;
    if (axis) this.setTwist({ ...this.twist_, direction: AXES[axis] });
    else this.tell();
  }

  setTwist(twist: TransformState["twist"]): void {
    this.twist_ = twist;
    const deformation = this.deformation_;
    if (deformation?.type === "twist") {
      const axis = { ...deformation.axis, direction: twist.direction };
      this.set({ ...deformation, axis, length: twist.length });
    }
    this.tell();
  }

  setPivotEditing(editing: boolean): void {
    this.pivotEditing_ = editing;
    this.tell();
  }

  /** Which level moves: the detail of the finer ones rides along; on the finest one the samples themselves move. */
  setLevel(level: number): void {
    this.level_ = level;
    this.again();
  }

  /** How t falls from the one-region to the zero-region. */
  setBlend(blend: Blend): void {
    this.blend_ = blend;
    this.again();
  }

  /** What multiplies the detail of a band in the one-region. */
  setGain(band: number, gain: number): void {
    if (this.state.obstacle || !(band in this.gains_)) return;
    this.gains_ = this.gains_.map((known, k) => (k === band ? gain : known));
    this.deformation_ ??= translation([0, 0, 0]);
    this.again();
  }

  /** Whether and where samples are inserted, for this edit and the next ones of this session. */
  setResampling(change: Partial<ResamplingChoice>): void {
    this.resampling_ = { ...this.resampling_, ...change };
    this.resamplingFault_ = null;
    saveResampling(this.store_.id, this.resampling_, KEPT);
    this.again();
  }

  /** Keeps what of a refusal is about the resampling, to be told at its field; false where nothing is. */
  private takeFault(error: unknown): boolean {
    this.resamplingFault_ = faultOfProblem(problemOf(error));
    this.tell();
    return this.resamplingFault_ !== null;
  }

  /** The same deformation under other conditions. */
  private again(): void {
    const whole = this.whole;
    const gains = this.changesDetail ? this.gains_.join(" ") : "";
    // A refusal of how many samples there would be was of other numbers.
    if (this.resamplingFault_?.about === null) this.resamplingFault_ = null;
    if (whole) this.preview.want(whole, { blend: this.blend_, gains });
    this.tell();
  }

  cancel(): void {
    this.clear();
    this.pivotEditing_ = false;
    this.tell();
    this.bus_.fire("preview.changed", NO_PREVIEW);
    void this.preview
      .cancel()
      .catch((error: unknown) => reportError(this.bus_, error, "The preview could not be ended"));
  }

  /** Records the transform; afterwards nothing is pending, or, where the server refuses, it is pending still. */
  async commit(): Promise<void> {
    const whole = this.whole;
    if (!whole || !this.pending) return;
    await this.queue_.enqueue(async () => {
      await this.preview.idle();
      const { revision, history } = this.store_.document;
      this.committing_ = revision;
      try {
        const edit = this.body(whole);
        await this.client_.commitEdit(this.store_.id, edit, revision);
        this.bus_.fire("edit.recorded", history.head);
        this.settle();
        this.store_.update(await this.client_.session(this.store_.id));
        this.bus_.fire("toast", { kind: "success", title: describeEdit(edit) });
      } catch (error) {
        await this.failed(error);
      } finally {
        this.committing_ = null;
      }
    });
  }

  private async failed(error: unknown): Promise<void> {
    if (problemOf(error).status !== 412) {
      this.takeFault(error);
      reportError(this.bus_, error, "The edit was not recorded");
      return;
    }
    await reportChangedMeanwhile(this.bus_, this.client_, this.store_);
  }

  private clear(): void {
    this.deformation_ = null;
    this.steps_ = ONE_STEP;
    this.full_ = false;
    this.gains_ = this.gains_.map(() => 1);
    this.resamplingFault_ = null;
  }

  private settle(): void {
    this.clear();
    this.preview.settle();
    this.bus_.fire("preview.changed", NO_PREVIEW);
    this.tell();
  }

  private body(deformation: Deformation): EditBody {
    const resampling = resamplingOf(this.resampling_);
    return {
      level: this.level_,
      blend: this.blend_,
      deformation,
      ...(this.changesDetail && { gains: this.gains_ }),
      ...(resampling && { resampling }),
    };
  }

  private tell(): void {
    this.bus_.fire("transform.changed", this.state);
  }
}
