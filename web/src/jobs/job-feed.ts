import type { ApiClient } from "../api/client";
import type { Job } from "../api/types";

/** Browsers open six connections to a host in all; the session's stream and the requests need theirs. */
const MAX_STREAMS = 2;
/** How often the list is read: while all that is under way is followed live, while some of it is not, while nothing is. */
const LIVE_MS = 4000;
const POLL_MS = 1200;
const IDLE_MS = 10_000;
/** How long a job whose stream broke is only polled. */
const REST_MS = 15_000;

/** Whether a job waits or runs. */
export function isActive({ status }: Job): boolean {
  return status === "accepted" || status === "running";
}

export interface FeedSink {
  /** All jobs that are shown, newest first, after each change. */
  jobs(jobs: readonly Job[]): void;
  /** The list could not be read; undefined once it can be again. */
  trouble(error: unknown): void;
}

/** The service's jobs as they are now: each by its events where it may have a stream, the others by asking again. */
export class JobFeed {
  private readonly client_: Pick<ApiClient, "jobs" | "jobEvents">;
  private readonly sink_: FeedSink;
  private readonly shows_: (job: Job) => boolean;
  private readonly jobs_ = new Map<string, Job>();
  private readonly streams_ = new Map<string, AbortController>();
  private readonly rests_ = new Map<string, number>();
  /** Taken or removed while the list was on its way: what it says of them may be older. */
  private readonly changed_ = new Set<string>();
  private timer_: ReturnType<typeof setTimeout> | undefined;
  private running_ = false;
  private reading_ = false;
  private again_ = false;

  constructor(
    client: Pick<ApiClient, "jobs" | "jobEvents">,
    sink: FeedSink,
    shows: (job: Job) => boolean = () => true,
  ) {
    this.client_ = client;
    this.sink_ = sink;
    this.shows_ = shows;
  }

  start(): void {
    if (this.running_) return;
    this.running_ = true;
    void this.read();
  }

  stop(): void {
    this.running_ = false;
    clearTimeout(this.timer_);
    for (const controller of this.streams_.values()) controller.abort();
    this.streams_.clear();
  }

  /** A job as an answer has it. */
  take(job: Job): void {
    this.changed_.add(job.jobID);
    if (!this.shows_(job)) return;
    const known = this.jobs_.get(job.jobID);
    if (known && known.updated > job.updated) return;
    this.jobs_.set(job.jobID, job);
    this.tell();
    this.follow();
  }

  /** A job that the server has forgotten. */
  remove(id: string): void {
    this.changed_.add(id);
    this.streams_.get(id)?.abort();
    this.streams_.delete(id);
    if (this.jobs_.delete(id)) this.tell();
  }

  /** Reads the list now; where it is being read, once more after that. */
  async read(): Promise<void> {
    if (!this.running_) return;
    if (this.reading_) {
      this.again_ = true;
      return;
    }
    clearTimeout(this.timer_);
    this.reading_ = true;
    this.changed_.clear();
    try {
      const list = await this.client_.jobs();
      if (!this.running_) return;
      this.merge(list);
      this.sink_.trouble(undefined);
    } catch (error) {
      if (this.running_) this.sink_.trouble(error);
    } finally {
      this.reading_ = false;
    }
    if (!this.running_) return;
    this.follow();
    const wait = this.again_ ? 0 : this.patience();
    this.again_ = false;
    this.timer_ = setTimeout(() => void this.read(), wait);
  }

  private merge(list: readonly Job[]): void {
    const listed = new Set(list.map(({ jobID }) => jobID));
    for (const id of [...this.jobs_.keys()])
      if (!listed.has(id) && !this.changed_.has(id)) this.jobs_.delete(id);
    for (const job of list) {
      const known = this.jobs_.get(job.jobID);
      const isGone = !known && this.changed_.has(job.jobID);
      if (isGone || !this.shows_(job) || (known && known.updated > job.updated)) continue;
      this.jobs_.set(job.jobID, job);
    }
    this.tell();
  }

  private tell(): void {
    if (!this.running_) return;
    this.sink_.jobs([...this.jobs_.values()].sort((a, b) => b.created.localeCompare(a.created)));
  }

  private active(): Job[] {
    return [...this.jobs_.values()].filter(isActive);
  }

  private patience(): number {
    const active = this.active();
    if (active.length === 0) return IDLE_MS;
    return active.every(({ jobID }) => this.streams_.has(jobID)) ? LIVE_MS : POLL_MS;
  }

  /** Opens streams to jobs that run, then to those that are next, as far as there may be more. */
  private follow(): void {
    if (!this.running_) return;
    const rank = ({ status, queue_place: place }: Job): number => (status === "running" ? 0 : (place ?? 1e9));
    for (const job of this.active().sort((a, b) => rank(a) - rank(b))) {
      if (this.streams_.size >= MAX_STREAMS) return;
      const rests = Date.now() < (this.rests_.get(job.jobID) ?? 0);
      if (!rests && !this.streams_.has(job.jobID)) void this.listen(job.jobID);
    }
  }

  private async listen(id: string): Promise<void> {
    const controller = new AbortController();
    this.streams_.set(id, controller);
    try {
      for await (const job of this.client_.jobEvents(id, controller.signal)) {
        if (controller.signal.aborted) return;
        this.take(job);
      }
    } catch {
      // Refused, or broken on the way: asking again says what there is to say.
    }
    if (controller.signal.aborted) return;
    this.streams_.delete(id);
    const job = this.jobs_.get(id);
    if (job && isActive(job)) this.rests_.set(id, Date.now() + REST_MS);
    // Its end moves those that wait.
    void this.read();
  }
}
