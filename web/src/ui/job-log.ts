import type { ApiClient } from "../api/client";
import { describeProblem, isPassing, problemOf } from "../api/problem";
import { h } from "./dom";

const POLL_MS = 1000;
const MAX_CHARACTERS = 200_000;
/** A log that is read within so many pixels of its end goes on with it. */
const FOLLOW_PIXELS = 24;

/** The end of a job's log, which follows while it is looked at. Spoken only when it is read: it would never stop. */
export class JobLog {
  readonly element: HTMLPreElement;
  private readonly client_: ApiClient;
  private readonly id_: string;
  private readonly text_ = document.createTextNode("");
  private next_ = 0;
  private round_: AbortController | null = null;

  constructor(client: ApiClient, id: string, name: string, elementId: string) {
    this.client_ = client;
    this.id_ = id;
    this.element = h(
      "pre",
      {
        id: elementId,
        class: "job-log",
        role: "region",
        tabIndex: 0,
        aria: { label: `Log of ${name}`, live: "off" },
      },
      this.text_,
    );
  }

  /** Reads what there is and, while `goesOn` says so, what comes. */
  open(goesOn: () => boolean): void {
    this.close();
    const round = new AbortController();
    this.round_ = round;
    void this.run(round.signal, goesOn);
  }

  close(): void {
    this.round_?.abort();
    this.round_ = null;
  }

  private async run(signal: AbortSignal, goesOn: () => boolean): Promise<void> {
    let said = "";
    while (!signal.aborted) {
      // Before the reading: what is written until a job ends is there when it has ended.
      const isLast = !goesOn();
      try {
        const { text, next } = await this.client_.jobLog(this.id_, this.next_, signal);
        if (signal.aborted) return;
        const hasMore = next > this.next_;
        this.next_ = next;
        this.add(text);
        said = "";
        if (hasMore) continue;
        if (isLast) return;
      } catch (error) {
        if (signal.aborted) return;
        const problem = problemOf(error);
        const reason = `\n(${[problem.title, ...describeProblem(problem)].join(": ")})\n`;
        if (reason !== said) this.add(reason);
        said = reason;
        if (!isPassing(error) || isLast) return;
      }
      await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    }
  }

  private add(text: string): void {
    if (text === "") return;
    const { element } = this;
    const follows = element.scrollHeight - element.scrollTop - element.clientHeight < FOLLOW_PIXELS;
    const all = this.text_.data + text;
    this.text_.data =
      all.length > MAX_CHARACTERS ? all.slice(all.indexOf("\n", all.length - MAX_CHARACTERS) + 1) : all;
    if (follows) element.scrollTop = element.scrollHeight;
  }
}
