/** Layer k of FRAMES.md holds the samples whose coherent index is a multiple of 64 >> k and of no smaller layer. */
export const LAYER_COUNT = 7;

/** Samples of each layer, for a cloud of `sampleCount` samples. */
export function layerSizes(sampleCount: number): number[] {
  const coarsest = 1 << (LAYER_COUNT - 1);
  const sizes = [Math.ceil(sampleCount / coarsest)];
  for (let layer = 1; layer < LAYER_COUNT; ++layer) {
    const step = coarsest >> layer;
    // The odd multiples of `step` below sampleCount.
    sizes.push(sampleCount > step ? Math.ceil((sampleCount - step) / (2 * step)) : 0);
  }
  return sizes;
}

export interface LayerPrefix {
  /** Blocks of the prefix. */
  blocks: number;
  /** Samples in those blocks. */
  samples: number;
}

/** The prefixes of whole layers, coarsest first; the last one is every block, with what was appended after the layers. */
export function layerPrefixes(sampleCount: number, blockSize: number, blockCount: number): LayerPrefix[] {
  const prefixes: LayerPrefix[] = [];
  let blocks = 0;
  let samples = 0;
  for (const size of layerSizes(sampleCount)) {
    if (size === 0) continue;
    blocks += Math.ceil(size / blockSize);
    samples += size;
    prefixes.push({ blocks: Math.min(blocks, blockCount), samples });
  }
  const last = prefixes[prefixes.length - 1];
  if (last) {
    last.blocks = blockCount;
    last.samples = sampleCount;
  }
  return prefixes;
}

/** The largest prefix within `budget` samples; the coarsest where even that one exceeds it. */
export function prefixWithin(prefixes: readonly LayerPrefix[], budget: number): LayerPrefix {
  let chosen = prefixes[0] ?? { blocks: 0, samples: 0 };
  for (const prefix of prefixes) {
    if (prefix.samples <= budget) chosen = prefix;
  }
  return chosen;
}
