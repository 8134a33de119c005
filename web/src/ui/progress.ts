import { describeProblem } from "../api/problem";
import type { Problem, SessionDocument } from "../api/types";
import { h, setText } from "./dom";

/** Over the empty view while a session is being built, or where it failed. */
export interface ProgressView {
  element: HTMLElement;
  show(document: SessionDocument): void;
  fail(problem: Problem): void;
  hide(): void;
}

const PHASES: Record<string, string> = {
  queued: "Waiting for its turn",
  order: "Putting the samples in order",
  ordering: "Putting the samples in order",
  neighbors: "Finding the neighbourhoods",
  neighbours: "Finding the neighbourhoods",
  normals: "Estimating normals",
  decomposition: "Separating the base from its detail",
  decompose: "Separating the base from its detail",
};

export function phaseName(phase: string): string {
  return PHASES[phase] ?? phase.charAt(0).toUpperCase() + phase.slice(1).replaceAll("_", " ");
}

export function createProgress(): ProgressView {
  const title = h("h2", {}, "Preparing the session");
  const phase = h("p", { class: "hint", aria: { live: "polite" } });
  const bar = h("progress", { max: 1, aria: { label: "Progress" } });
  const home = h("a", { class: "button", href: "./" }, "All clouds");
  home.hidden = true;
  const card = h("div", { class: "progress-card panel" }, title, phase, bar, home);
  const element = h("div", { class: "progress-layer", hidden: true }, card);
  return {
    element,
    show(document) {
      element.hidden = false;
      setText(title, `Preparing ${document.name}`);
      const { progress } = document;
      setText(phase, progress ? phaseName(progress.phase) : "Starting");
      if (progress && progress.fraction > 0) bar.value = Math.min(1, progress.fraction);
      else bar.removeAttribute("value");
    },
    fail(problem) {
      element.hidden = false;
      card.classList.add("failed");
      setText(title, problem.title);
      setText(phase, describeProblem(problem).join(" "));
      bar.hidden = true;
      home.hidden = false;
    },
    hide() {
      element.hidden = true;
    },
  };
}
