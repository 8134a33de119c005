/** The smoothing scales of a session's base levels, as people type and read them: percent of the diagonal. */

export const DEFAULT_SCALES = [0.02, 0.01, 0.005];
export const MAX_BANDS = 8;
export const MAX_SCALE_PERCENT = 20;
/** Neighbouring scales are at least this far apart: the server's rule. */
const GREATEST_RATIO = 0.95;

/** Fractions as people read them: "4, 2, 1". */
export const scalesText = (scales: readonly number[]): string =>
  scales.map((scale) => Number((100 * scale).toPrecision(6))).join(", ");

/** "4, 2, 1" as fractions, coarsest first; a sentence where they cannot be scales. */
export function parseScales(text: string): number[] | string {
  const words = text.split(/[\s,;]+/).filter(Boolean);
  if (words.length === 0 || words.length > MAX_BANDS)
    return `One to ${MAX_BANDS} scales, such as “${scalesText(DEFAULT_SCALES)}”.`;
  const percents = words.map(Number);
  if (!percents.every((percent) => percent >= 0.01 && percent <= MAX_SCALE_PERCENT))
    return `Each scale lies between 0.01 and ${MAX_SCALE_PERCENT} % of the diagonal.`;
  if (percents.some((percent, i) => i > 0 && percent > GREATEST_RATIO * (percents[i - 1] ?? 0)))
    return "Coarsest first: each scale is smaller than the one before.";
  return percents.map((percent) => percent / 100);
}

/** A level by its number and what its base smooths away. */
export function levelName(level: { level: number; scale: number }, diagonal: number): string {
  if (level.scale === 0 || diagonal === 0) return `Level ${level.level}`;
  return `Level ${level.level} (${Number(((100 * level.scale) / diagonal).toPrecision(2))} %)`;
}

/** A band of detail by the scales that it lies between: what the base of level k smooths away and the next one keeps. */
export function bandName(levels: readonly { scale: number }[], band: number, diagonal: number): string {
  const percent = (level: number): number => {
    const scale = levels[level]?.scale ?? 0;
    return diagonal > 0 ? Number(((100 * scale) / diagonal).toPrecision(2)) : 0;
  };
  const [coarse, fine] = [percent(band), percent(band + 1)];
  if (coarse === 0) return `Band ${band}`;
  return fine === 0 ? `Below ${coarse} %` : `${coarse} % to ${fine} %`;
}
