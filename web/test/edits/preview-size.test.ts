import { expect, test } from "vitest";
import { defaultPreview, parsePreview, previewText } from "../../src/edits/preview-size";

test("clouds above a million samples are edited by a million of them unless somebody says otherwise", () => {
  expect(previewText(437_645)).toBe("437,645");
  expect(previewText(20_000_000)).toBe("1,000,000");
  expect(defaultPreview(1_000_000)).toBeUndefined();
  expect(defaultPreview(1_000_001)).toBe(1_000_000);
  for (const whole of [437_645, 1_000_000, 20_000_000])
    expect(parsePreview(previewText(whole), whole)).toBe(defaultPreview(whole));
});

test("counts are read as people write them; as many as there are, or nothing, is all", () => {
  expect(parsePreview("250 000", 1e6)).toBe(250_000);
  expect(parsePreview("250'000", 1e6)).toBe(250_000);
  expect(parsePreview("", 1e6)).toBeUndefined();
  expect(parsePreview("1,000,000", 1e6)).toBeUndefined();
  expect(parsePreview("99999999", 1e6)).toBeUndefined();
  for (const text of ["0", "-5", "1.5", "many", "1e5"])
    expect(parsePreview(text, 1e6)).toMatch(/whole number/);
});
