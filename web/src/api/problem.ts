import type { Problem, ProblemDetail } from "./types";

/** A request that the server refused, or that did not reach it (status 0). */
export class ApiError extends Error {
  readonly problem: Problem;
  /** Seconds after which the server says to try again. */
  readonly retryAfter: number | undefined;

  constructor(problem: Problem, retryAfter?: number) {
    super(problem.detail ?? problem.title);
    this.name = "ApiError";
    this.problem = problem;
    this.retryAfter = retryAfter;
  }

  get status(): number {
    return this.problem.status;
  }
}

/** Whether the same request may succeed later: the connection broke, or the server or a proxy before it says so. */
export function isPassing(error: unknown): error is ApiError {
  if (!(error instanceof ApiError)) return false;
  if (error.status === 429) return error.retryAfter !== undefined;
  return error.status === 0 || error.status === 423 || error.status >= 500;
}

/** The problem that a refused answer tells; what is not a problem document becomes one by its status. */
export function problemFromBody(status: number, statusText: string, text: string): Problem {
  try {
    const body = JSON.parse(text) as Partial<Problem> | null;
    if (body && typeof body === "object" && typeof body.title === "string") {
      return { ...body, type: body.type ?? "about:blank", title: body.title, status: body.status ?? status };
    }
  } catch {
    // Not JSON: a proxy's own page, or nothing at all.
  }
  return { type: "about:blank", title: statusText || `The server answered ${status}`, status };
}

export function networkProblem(detail: string): Problem {
  return { type: "about:blank", title: "The server cannot be reached", status: 0, detail };
}

function describeDetail(error: ProblemDetail): string {
  return error.pointer ? `${error.pointer}: ${error.detail}` : error.detail;
}

/** All that a problem says, one fact a line, for the person who reads it. */
export function describeProblem(problem: Problem): string[] {
  const lines: string[] = [];
  const { title, detail, errors = [] } = problem;
  // What a pointer names says it better.
  if (detail && detail !== title && !errors.some((error) => error.detail === detail)) lines.push(detail);
  for (const error of errors) lines.push(describeDetail(error));
  if (problem.limit !== undefined) {
    const actual = problem.actual === undefined ? "" : `, this is ${problem.actual.toLocaleString("en")}`;
    lines.push(`The limit is ${problem.limit.toLocaleString("en")}${actual}`);
  }
  return [...new Set(lines)];
}

/** Any thrown value as a problem. */
export function problemOf(error: unknown): Problem {
  if (error instanceof ApiError) return error.problem;
  const detail = error instanceof Error ? error.message : String(error);
  return { type: "about:blank", title: "Something went wrong in the viewer", status: 0, detail };
}
