import type { ApiClient } from "../api/client";
import { problemOf } from "../api/problem";
import type {
  CloudDocument,
  Job,
  JobFormat,
  JobMode,
  JobRequest,
  SessionDocument,
  UploadDocument,
} from "../api/types";
import { freshId, h, replaceChildren, setText } from "./dom";
import { selectField, textField } from "./fields";
import { formatBytes, formatCount } from "./format";
import { estimateFacts, FORMAT_NAMES } from "./job-words";
import { problemCard } from "./problem-card";
import { createScanSender } from "./scan-sender";

const MODES: Record<JobMode | "auto", readonly [string, string]> = {
  auto: ["Automatic", "In tiles where the scan's format allows it, else as a whole in memory."],
  tiles: ["In tiles", "In bounded memory, for scans of any size: PLY, LAS and Draco tiles."],
  memory: ["In memory", "The whole scan at once: every format."],
  direct: ["Direct", "On levels of the scan's own instead of the preview's: takes the most time and memory."],
};
const PRIORITIES = [
  ["8", "High: before others"],
  ["5", "Normal"],
  ["2", "Low: after others"],
] as const;
const FORMATS: readonly JobFormat[] = ["ply", "las", "draco", "draco-tiles", "xyz"];
const LOCAL = "local";
const MIN_STEPS = 2;
const MAX_STEPS = 1000;

/** What the server has that jobs may be made of and started by. */
export interface JobSources {
  clouds: readonly CloudDocument[];
  uploads: readonly UploadDocument[];
  launchers: readonly string[];
}

/** Scans that are clouds go by their ids, files that are none by this and theirs. */
const UPLOAD = "upload:";

export interface JobForm {
  element: HTMLElement;
  /** Whether there is anything to be done: the reason why not, or nothing. */
  setObstacle(reason: string): void;
}

function uploadText(name: string, bytes: number): string {
  return `${name || "A file"} · ${formatBytes(bytes)}, as it came`;
}

/** What a job of this session is to be made on, and as what; what it would take; and its start. */
export function createJobForm(
  client: ApiClient,
  session: SessionDocument,
  { clouds, uploads, launchers }: JobSources,
  onStarted: (job: Job) => void,
): JobForm {
  let mode: JobMode | "auto" = "auto";
  const own = clouds.find(({ id }) => id === session.cloud);
  const ownCount = own?.sample_count ?? session.preview?.of;
  const describe = (cloud: CloudDocument): string =>
    `${cloud.name} · ${formatCount(cloud.sample_count)} samples`;
  const others = clouds.filter(({ id }) => id !== session.cloud);
  const ownText = own
    ? `This session's cloud: ${describe(own)}`
    : `This session's cloud${ownCount === undefined ? "" : ` · ${formatCount(ownCount)} samples`}`;
  const scan = selectField(
    "Scan",
    [
      ["", ownText] as const,
      ...others.map((cloud) => [cloud.id, describe(cloud)] as const),
      ...uploads
        .filter(({ length, offset }) => offset === length)
        .map((upload) => [UPLOAD + upload.id, uploadText(upload.name, upload.length)] as const),
    ],
    "",
    () => {
      nameFormat();
      forgetEstimate();
    },
  );
  const sender = createScanSender(client, (id, file) => {
    const value = UPLOAD + id;
    if (![...scan.select.options].some((option) => option.value === value))
      scan.select.append(h("option", { value }, uploadText(file.name, file.size)));
    scan.select.value = value;
    nameFormat();
    forgetEstimate();
  });
  scan.element.append(sender.element);
  const format = selectField<JobFormat | "">(
    "Format of the result",
    [["", ""] as const, ...FORMATS.map((key) => [key, FORMAT_NAMES[key]] as const)],
    "",
    () => forgetEstimate(),
  );
  const chosen = (): CloudDocument | undefined =>
    scan.select.value === "" ? own : clouds.find(({ id }) => id === scan.select.value);
  const nameFormat = (): void => {
    const is = chosen()?.report.format;
    const as = FORMATS.find((key) => key === is) ?? "ply";
    const option = format.select.options[0];
    if (option) option.text = is === undefined ? "As the scan" : `As the scan (${FORMAT_NAMES[as]})`;
  };
  const hintId = freshId();
  const hint = h("p", { id: hintId, class: "hint job-hint" }, MODES[mode][1]);
  const way = selectField<JobMode | "auto">(
    "Way",
    (Object.keys(MODES) as (JobMode | "auto")[]).map((key) => [key, MODES[key][0]] as const),
    mode,
    (next) => {
      mode = next;
      setText(hint, MODES[mode][1]);
      forgetEstimate();
    },
  );
  way.select.setAttribute("aria-describedby", hintId);
  const priority = selectField("Priority", PRIORITIES, "5", () => undefined);
  const launcher = selectField(
    "Started by",
    launchers.map((key) => [key, key === LOCAL ? "This server" : key] as const),
    LOCAL,
    () => undefined,
  );
  const name = textField("Name", session.name.replace(/\.[^.]+$/, ""), "");
  name.input.classList.remove("number");
  name.input.maxLength = 120;
  name.element.querySelector(".unit")?.remove();

  const frames = textField("Animation", "", "clouds");
  frames.input.inputMode = "numeric";
  frames.input.placeholder = "one";
  /** Nothing: one cloud; NaN: no number that the server takes. */
  const steps = (): number | undefined => {
    const text = frames.input.value.trim();
    if (text === "") return undefined;
    const count = Number(text);
    return Number.isInteger(count) && count >= MIN_STEPS && count <= MAX_STEPS ? count : Number.NaN;
  };
  frames.input.addEventListener("input", () => {
    frames.input.setAttribute("aria-invalid", String(Number.isNaN(steps())));
    forgetEstimate();
    refresh();
  });

  const answer = h("div", { class: "job-answer", aria: { live: "polite" } });
  const forgetEstimate = (): void => replaceChildren(answer);
  const output = (): Pick<JobRequest, "output"> => {
    const count = steps();
    const as = format.select.value;
    if (as === "" && count === undefined) return {};
    return {
      output: { ...(as !== "" && { format: as as JobFormat }), ...(count !== undefined && { steps: count }) },
    };
  };
  const source = (): Pick<JobRequest, "cloud" | "upload"> => {
    const { value } = scan.select;
    if (value === "") return {};
    return value.startsWith(UPLOAD) ? { upload: value.slice(UPLOAD.length) } : { cloud: value };
  };
  const request = (): JobRequest => ({
    session: session.id,
    ...source(),
    ...output(),
    ...(mode === "auto" ? {} : { mode }),
    ...(name.input.value.trim() === "" ? {} : { name: name.input.value.trim() }),
    priority: Number(priority.select.value),
    ...(launcher.select.value === LOCAL ? {} : { launcher: launcher.select.value }),
  });
  let obstacle = "";
  let reason = "";
  let busy = false;
  const note = h("p", { class: "hint obstacle", hidden: true });
  const estimate = h("button", { type: "button", class: "button" }, "Estimate");
  const start = h("button", { type: "submit", class: "button primary" }, "Start");
  const refresh = (): void => {
    const isWrong = obstacle === "" && Number.isNaN(steps());
    reason = isWrong ? `An animation has ${MIN_STEPS} to ${formatCount(MAX_STEPS)} clouds.` : obstacle;
    estimate.disabled = busy || reason !== "";
    start.disabled = busy || reason !== "";
    setText(note, reason);
    note.hidden = reason === "";
  };
  const guarded = async (
    what: string,
    button: HTMLButtonElement,
    action: () => Promise<void>,
  ): Promise<void> => {
    if (busy || reason !== "") return;
    busy = true;
    refresh();
    try {
      await action();
    } catch (error) {
      replaceChildren(answer, problemCard(what, problemOf(error)));
    }
    busy = false;
    refresh();
    // A disabled button loses the focus.
    if (document.activeElement === null || document.activeElement === document.body) button.focus();
  };
  estimate.addEventListener("click", () => {
    void guarded("This job cannot be made", estimate, async () => {
      const facts = estimateFacts(await client.validateJob(request()));
      replaceChildren(
        answer,
        h(
          "dl",
          { class: "job-facts", aria: { label: "What the job takes" } },
          ...facts.map(([term, value]) => h("div", {}, h("dt", {}, term), h("dd", {}, value))),
        ),
      );
    });
  });
  nameFormat();
  const element = h(
    "form",
    {
      class: "job-form",
      aria: { label: "New job" },
      onsubmit: (event) => {
        event.preventDefault();
        void guarded("The job was not started", start, async () => {
          onStarted(await client.createJob(request()));
          forgetEstimate();
        });
      },
    },
    h(
      "div",
      { class: "job-fields" },
      scan.element,
      name.element,
      format.element,
      frames.element,
      way.element,
      priority.element,
      launchers.length > 1 && launcher.element,
    ),
    hint,
    answer,
    h("div", { class: "job-submit" }, note, h("span", { class: "spacer" }), estimate, start),
  );
  return {
    element,
    setObstacle: (next) => {
      obstacle = next;
      refresh();
    },
  };
}
