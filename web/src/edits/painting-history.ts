import type { ApiClient } from "../api/client";
import type { RecordedOperation, RegionName, SessionDocument } from "../api/types";
import type { SessionStore } from "../session-store";

export const REGIONS: readonly RegionName[] = ["zero", "one"];

type Lists = Record<RegionName, readonly RecordedOperation[]>;
type Counts = Record<RegionName, { samples: number; operations: number }>;

/** A change of the painting, with what it takes to go back and to come again. */
interface Step {
  /** The heads of the edits before and after it: undo goes back over edits and paintings in the order of the hand. */
  headBefore: number;
  head: number;
  /** The regions that were painted; the other may have lost samples to them. */
  painted: readonly RegionName[];
  before: Counts;
  after: Counts;
  /** Absent: the server's list as it is after the step, cut to the length of before. */
  listsBefore?: Lists;
  listsAfter?: Lists;
}

export type StepResult = "done" | "nearly" | "stale" | "none";

const countsOf = ({ regions }: SessionDocument): Counts => ({
  zero: { ...regions.zero },
  one: { ...regions.one },
});

const same = (a: Counts, b: Counts, what: "samples" | "operations"): boolean =>
  REGIONS.every((region) => a[region][what] === b[region][what]);

/**
 * Undo and redo of painting, for what was painted on this page. The server keeps a list of operations a region, records
 * some of them in another form than they were sent, and knows no undo of them: the lists are read back when they are wanted,
 * and put as they were. A recipe, which brings edits and regions, is one step. Every call runs within the command queue.
 */
export class PaintingHistory {
  private readonly client_: ApiClient;
  private readonly store_: SessionStore;
  private readonly done_: Step[] = [];
  private readonly undone_: Step[] = [];

  constructor(client: ApiClient, store: SessionStore) {
    this.client_ = client;
    this.store_ = store;
  }

  /** Whether the next undo or redo at this head of the edits is one of painting. */
  get next(): { undo: boolean; redo: boolean } {
    const { head } = this.store_.document.history;
    return { undo: this.done_.at(-1)?.head === head, redo: this.undone_.at(-1)?.headBefore === head };
  }

  /**
   * An edit was recorded on top of the head: nothing is left to redo, and the edits behind that head are gone. What was
   * painted under them is painted still, so it now counts as painted at that head.
   */
  edited(headBefore: number): void {
    this.undone_.length = 0;
    for (const step of this.done_) {
      step.headBefore = Math.min(step.headBefore, headBefore);
      step.head = Math.min(step.head, headBefore);
    }
  }

  /**
   * Runs a change of the painting and keeps what it takes to undo it. `replaces`: lists are not only added to. The change
   * hands over the session after each of its requests: where it has moved on by more than those, someone else painted, and
   * nothing that was painted before can be undone without undoing theirs.
   */
  async record<Result>(
    painted: readonly RegionName[],
    replaces: boolean,
    change: (take: (document: SessionDocument) => void) => Promise<Result>,
  ): Promise<Result> {
    const { document } = this.store_;
    const before = countsOf(document);
    const lists = replaces ? await this.read() : undefined;
    let requests = 0;
    try {
      return await change((next) => {
        ++requests;
        this.store_.update(next);
      });
    } finally {
      // Also where a later part of the change was refused: what came before it is painted.
      const now = this.store_.document;
      const after = countsOf(now);
      if (now.revision !== document.revision) this.undone_.length = 0;
      if (now.revision !== document.revision + requests) this.done_.length = 0;
      else if (requests > 0) {
        const headBefore = document.history.head;
        const { head } = now.history;
        if (head !== headBefore) this.edited(headBefore);
        if (head !== headBefore || !same(before, after, "operations") || !same(before, after, "samples"))
          this.done_.push({
            headBefore,
            head,
            painted,
            before,
            after,
            ...(lists && { listsBefore: lists }),
          });
      }
    }
  }

  /** Undoes (-1) or redoes (1) the next step; `none` where the next one is not of painting. */
  async step(by: -1 | 1): Promise<StepResult> {
    const [from, to] = by < 0 ? [this.done_, this.undone_] : [this.undone_, this.done_];
    if (!(by < 0 ? this.next.undo : this.next.redo)) return "none";
    const step = from.at(-1);
    if (!step) return "none";
    const [here, there, head] =
      by < 0 ? [step.after, step.before, step.headBefore] : [step.before, step.after, step.head];
    const counts = countsOf(this.store_.document);
    if (!same(counts, here, "operations") || !same(counts, here, "samples")) {
      this.forget();
      return "stale";
    }
    if (by < 0) {
      const lists = await this.read();
      step.listsAfter = lists;
      step.listsBefore ??= {
        zero: lists.zero.slice(0, step.before.zero.operations),
        one: lists.one.slice(0, step.before.one.operations),
      };
    }
    const [have, wanted] = by < 0 ? [step.listsAfter, step.listsBefore] : [step.listsBefore, step.listsAfter];
    if (!have || !wanted) return "none";
    // The region that loses samples goes first, so that no sample is in the way of the other.
    const gain = (region: RegionName): number => there[region].samples - here[region].samples;
    const touched = (region: RegionName): boolean =>
      step.painted.includes(region) ||
      gain(region) !== 0 ||
      there[region].operations !== here[region].operations;
    const order = REGIONS.filter(touched).sort((a, b) => gain(a) - gain(b));
    try {
      await this.restore(order, wanted, have, head);
    } catch (error) {
      // The step stays, measured against what the server holds now.
      if (by < 0) step.after = countsOf(this.store_.document);
      else step.before = countsOf(this.store_.document);
      throw error;
    }
    const exact = same(countsOf(this.store_.document), there, "samples");
    from.pop();
    // What follows is measured against what the server holds now.
    const now = countsOf(this.store_.document);
    if (by < 0) step.before = now;
    else step.after = now;
    to.push(step);
    return exact ? "done" : "nearly";
  }

  /** Puts the lists and the head, all or nothing: where a part is refused, what was put before it goes back. */
  private async restore(
    order: readonly RegionName[],
    wanted: Lists,
    have: Lists,
    head: number,
  ): Promise<void> {
    const { id } = this.store_;
    const put = async (region: RegionName, lists: Lists): Promise<void> =>
      this.store_.update(await this.client_.putOperations(id, region, lists[region]));
    const from = this.store_.document.history.head;
    const go = async (to: number): Promise<void> => {
      const { history, revision } = this.store_.document;
      if (to !== history.head) this.store_.update(await this.client_.putHead(id, to, revision));
    };
    const accepted: RegionName[] = [];
    try {
      // Lists are replayed on the surface as it is: on the one before a recipe's edits, both ways.
      await go(Math.min(from, head));
      for (const region of order) {
        await put(region, wanted);
        accepted.unshift(region);
      }
      await go(head);
    } catch (error) {
      try {
        for (const region of accepted) await put(region, have);
        await go(from);
      } catch {
        // Neither state is whole, so that no step fits what is there. The first refusal says why.
        this.forget();
      }
      throw error;
    }
  }

  private forget(): void {
    this.done_.length = 0;
    this.undone_.length = 0;
  }

  private async read(): Promise<Lists> {
    const [zero, one] = await Promise.all(
      REGIONS.map((region) => this.client_.regionOperations(this.store_.id, region)),
    );
    return { zero: zero ?? [], one: one ?? [] };
  }
}
