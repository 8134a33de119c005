import { describeProblem } from "../api/problem";
import type { Problem } from "../api/types";
import { h } from "./dom";

/** A refused request, in full: what, why, where in the input, which limit, and the id to look for in the log. */
export function problemCard(what: string, problem: Problem): HTMLElement {
  return h(
    "div",
    { class: "problem-card", role: "alert" },
    h("strong", {}, what),
    h("p", {}, problem.title),
    ...describeProblem(problem).map((line) => h("p", { class: "problem-line" }, line)),
    problem.request_id ? h("p", { class: "problem-id" }, `Request ${problem.request_id}`) : null,
  );
}
