import { expect, test } from "vitest";
import type { Problem } from "../../src/api/types";
import {
  DEFAULT_RESAMPLING,
  describeSamples,
  faultOfProblem,
  loadResampling,
  numberFault,
  resamplingOf,
  samplesBefore,
  saveResampling,
} from "../../src/edits/resampling";

test("an edit names its resampling only where it resamples", () => {
  expect(resamplingOf(DEFAULT_RESAMPLING)).toBeNull();
  expect(resamplingOf({ ...DEFAULT_RESAMPLING, on: true })).toEqual({
    bound: 1.5,
    min_spacing: 0,
    shear_aware: false,
    collect: 0,
  });
  expect(
    resamplingOf({
      on: true,
      bound: 2,
      minSpacing: 0.01,
      shearAware: true,
      cleanUp: true,
      distance: 0.6,
    }),
  ).toEqual({ bound: 2, min_spacing: 0.01, shear_aware: true, collect: 0.6 });
});

test("numbers out of range are refused with their range", () => {
  expect(numberFault("bound", 1.05)).toBeNull();
  expect(numberFault("bound", 16)).toBeNull();
  expect(numberFault("bound", 1)).toBe("Between 1.05 and 16.");
  expect(numberFault("distance", 0.91)).toBe("Between 0 and 0.9.");
  expect(numberFault("minSpacing", -1)).toBe("At least 0, at most 1,000,000,000.");
  expect(numberFault("bound", Number.NaN)).not.toBeNull();
});

const problemOf = (pointer: string, more: Partial<Problem> = {}): Problem => ({
  type: "about:blank",
  title: "Refused",
  status: 422,
  errors: [{ pointer, detail: "It is wrong." }],
  ...more,
});

test("a refusal is told at the field that it is about", () => {
  expect(faultOfProblem(problemOf("/resampling/bound"))).toEqual({ about: "bound", text: "It is wrong." });
  expect(faultOfProblem(problemOf("/resampling/min_spacing"))?.about).toBe("minSpacing");
  expect(faultOfProblem(problemOf("/resampling/collect"))?.about).toBe("distance");
  expect(faultOfProblem(problemOf("/resampling/sweeps"))).toEqual({ about: null, text: "It is wrong." });
  expect(faultOfProblem(problemOf("/resampling"))?.about).toBeNull();
  expect(faultOfProblem(problemOf("/resamplings"))).toBeNull();
  expect(faultOfProblem(problemOf("/deformation/vector"))).toBeNull();
  expect(faultOfProblem({ type: "about:blank", title: "Refused", status: 500 })).toBeNull();
});

test("too many samples are told with both numbers", () => {
  const fault = faultOfProblem(
    problemOf("/resampling/max_samples", { status: 413, limit: 300_000, actual: 412_345 }),
  );
  expect(fault?.about).toBeNull();
  expect(fault?.text).toMatch(/^412,345 samples would be needed, 300,000 is the limit\./);
  const without = faultOfProblem(problemOf("/resampling/max_samples", { limit: 300_000 }));
  expect(without?.text).toMatch(/^300,000 is the limit\./);
});

test("what an edit did to the samples is said in words, and what there was before all edits is known", () => {
  expect(describeSamples({ inserted: 0, removed: 0 })).toBe("");
  expect(describeSamples({ inserted: 15_743, removed: 0 })).toBe("15,743 inserted");
  expect(describeSamples({ inserted: 1, removed: 1200 })).toBe("1 inserted, 1,200 removed");
  const edit = { level: 0, deformation: { type: "translation", vector: [0, 0, 0] } } as const;
  expect(samplesBefore([], 7)).toBe(7);
  expect(
    samplesBefore(
      [
        { edit, inserted: 15, removed: 2, sample_count: 113 },
        { edit, inserted: 0, removed: 0, sample_count: 113 },
      ],
      100,
    ),
  ).toBe(100);
});

test("the choice is kept for its session alone; what cannot be read is the default", () => {
  const kept = new Map<string, string>();
  const storage = () => ({
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
  });
  const choice = { ...DEFAULT_RESAMPLING, on: true, bound: 2.5, cleanUp: true, distance: 0.5 };
  saveResampling("a", choice, storage);
  expect(loadResampling("a", storage)).toEqual(choice);
  expect(loadResampling("b", storage)).toEqual(DEFAULT_RESAMPLING);
  kept.set([...kept.keys()][0] ?? "", '{"on": true, "bound": 99, "distance": "0.5"}');
  expect(loadResampling("a", storage)).toEqual({ ...DEFAULT_RESAMPLING, on: true });
  kept.set([...kept.keys()][0] ?? "", "[");
  expect(loadResampling("a", storage)).toEqual(DEFAULT_RESAMPLING);
  const refusing = (): never => {
    throw new Error("no storage");
  };
  saveResampling("a", choice, refusing);
  expect(loadResampling("a", refusing)).toEqual(DEFAULT_RESAMPLING);
});
