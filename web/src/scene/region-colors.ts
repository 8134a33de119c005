/** sRGB colours of the regions, as the style sheet has them too. */
export const ZERO_COLOR: readonly [number, number, number] = [0.243, 0.482, 0.98];
export const ONE_COLOR: readonly [number, number, number] = [0.906, 0.294, 0.286];
