import type { ImageChannel } from "../api/types";

/** Which part of an image's pixels makes a region. */
export interface MaskSettings {
  channel: ImageChannel;
  threshold: number;
  side: "above" | "below";
}

/** Four bytes a pixel, as a canvas gives them. */
type Pixels = Uint8ClampedArray;

/** What of a pixel counts, from 0 to 1: of the stored values, as the server weighs them. */
export function channelValue(pixels: Pixels, at: number, channel: ImageChannel): number {
  const [red = 0, green = 0, blue = 0, alpha = 0] = pixels.subarray(at, at + 4);
  switch (channel) {
    case "luminance":
      return (2126 * red + 7152 * green + 722 * blue) / (10_000 * 255);
    case "red":
      return red / 255;
    case "green":
      return green / 255;
    case "blue":
      return blue / 255;
    case "alpha":
      return alpha / 255;
  }
}

/** The mask in white on black; what is more than half transparent is in no mask, but for that of alpha. Answers its part of the image. */
export function paintMask(pixels: Pixels, settings: MaskSettings, into: Pixels): number {
  let inside = 0;
  for (let at = 0; at + 3 < pixels.length; at += 4) {
    const opaque = settings.channel === "alpha" || (pixels[at + 3] ?? 0) >= 127.5;
    const above = channelValue(pixels, at, settings.channel) >= settings.threshold;
    const chosen = opaque && above === (settings.side === "above");
    if (chosen) ++inside;
    into.fill(chosen ? 255 : 0, at, at + 3);
    into[at + 3] = 255;
  }
  return pixels.length >= 4 ? inside / (pixels.length / 4) : 0;
}
