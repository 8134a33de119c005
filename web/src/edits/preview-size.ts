/** How many samples of a cloud a session edits, as people type and read it. */

/** Clouds with more are edited by so many of their samples, unless somebody wants otherwise. */
export const DEFAULT_PREVIEW = 1_000_000;

/** What a session on the cloud begins with where nobody has said it; undefined: all. */
export function defaultPreview(whole: number): number | undefined {
  return whole > DEFAULT_PREVIEW ? DEFAULT_PREVIEW : undefined;
}

/** The count as it stands in the field to begin with: "1,000,000". */
export function previewText(whole: number): string {
  return Math.min(whole, DEFAULT_PREVIEW).toLocaleString("en");
}

/** "1,000,000" as a count, undefined for all samples; a sentence where it is none. */
export function parsePreview(text: string, whole: number): number | undefined | string {
  const digits = text.replace(/[\s,'_]/g, "");
  if (digits === "") return undefined;
  const count = Number(digits);
  if (!/^\d+$/.test(digits) || count < 1)
    return "Samples: a whole number, at least 1; nothing for all of them.";
  return count < whole ? count : undefined;
}
