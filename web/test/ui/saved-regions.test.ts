import { expect, test } from "vitest";
import { nameFault } from "../../src/ui/saved-regions";

test("a region is called what the server lets it be called", () => {
  for (const name of ["left wing", "A-1_b.c", "x".repeat(64)]) expect(nameFault(name)).toBe("");
  for (const name of ["", "x".repeat(65), "a/b", "ö", " a", "a "]) expect(nameFault(name)).toMatch(/1 to 64/);
  for (const name of ["zero", "one", "t", ".", ".."]) expect(nameFault(name)).toMatch(/something else/);
});
