import type { ApiClient } from "../api/client";
import type { RecordedOperation, RegionName, SessionDocument } from "../api/types";
import type { SessionStore } from "../session-store";

export const REGIONS: readonly RegionName[] = ["zero", "one"];

type Lists = Record<RegionName, readonly RecordedOperation[]>;
type Counts = Record<RegionName, { samples: number; operations: number }>;

/** A change of the painting, with what it takes to go back and to come again. */
interface Step {
  /** The head of the edits at that time: undo goes back over edits and paintings in the order of the hand. */
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
 * and put as they were. Every call runs within the command queue.
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
    return { undo: this.done_.at(-1)?.head === head, redo: this.undone_.at(-1)?.head === head };
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
        if (!same(before, after, "operations") || !same(before, after, "samples"))
          this.done_.push({
            head: now.history.head,
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
    const [here, there] = by < 0 ? [step.after, step.before] : [step.before, step.after];
    const counts = countsOf(this.store_.document);
    if (!same(counts, here, "operations") || !same(counts, here, "samples")) {
      this.done_.length = 0;
      this.undone_.length = 0;
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
    const lists = by < 0 ? step.listsBefore : step.listsAfter;
    if (!lists) return "none";
    const exact = await this.restore(step, lists, there);
    from.pop();
    // What follows is measured against what the server holds now.
    const now = countsOf(this.store_.document);
    if (by < 0) step.before = now;
    else step.after = now;
    to.push(step);
    return exact ? "done" : "nearly";
  }

  /**
   * Puts the lists. Where samples changed hands between the regions, the order in which the lists are replayed matters: the
   * orders are tried until both regions hold as many samples as they did.
   */
  private async restore(step: Step, lists: Lists, wanted: Counts): Promise<boolean> {
    const others = REGIONS.filter((region) => !step.painted.includes(region));
    const untouched = others.every((region) => step.before[region].samples === step.after[region].samples);
    const orders = [
      ...(untouched ? [step.painted] : []),
      [...others, ...step.painted],
      [...step.painted, ...others],
      ...(others.length === 0 ? [[...step.painted].reverse()] : []),
    ];
    for (const order of orders) {
      for (const region of order)
        this.store_.update(await this.client_.putOperations(this.store_.id, region, lists[region]));
      if (same(countsOf(this.store_.document), wanted, "samples")) return true;
    }
    return false;
  }

  private async read(): Promise<Lists> {
    const [zero, one] = await Promise.all(
      REGIONS.map((region) => this.client_.regionOperations(this.store_.id, region)),
    );
    return { zero: zero ?? [], one: one ?? [] };
  }
}
