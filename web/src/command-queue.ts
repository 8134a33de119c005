/**
 * One first-in-first-out line for every request that changes the server. A command that fails is reported to its own
 * caller and does not stop the ones behind it.
 */
export class CommandQueue {
  private tail_: Promise<unknown> = Promise.resolve();
  private length_ = 0;

  /** Commands that wait or run. */
  get length(): number {
    return this.length_;
  }

  /** Runs `command` after all those before it have settled; settles as `command` does. */
  enqueue<Result>(command: () => Promise<Result>): Promise<Result> {
    this.length_ += 1;
    const result = this.tail_.then(command).finally(() => {
      this.length_ -= 1;
    });
    this.tail_ = result.catch(() => undefined);
    return result;
  }
}
