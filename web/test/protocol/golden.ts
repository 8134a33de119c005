import { readdirSync, readFileSync } from "node:fs";

const protocol = new URL("../../../protocol/", import.meta.url);

/** A file below protocol/. */
export function goldenBytes(path: string): Uint8Array<ArrayBuffer> {
  return new Uint8Array(readFileSync(new URL(path, protocol)));
}
export function goldenText(path: string): string {
  return readFileSync(new URL(path, protocol), "utf8");
}
export function goldenJson<T>(path: string): T {
  return JSON.parse(goldenText(path)) as T;
}
/** Names of the example documents, without their extension. */
export function exampleNames(): string[] {
  return readdirSync(new URL("examples/", protocol)).map((name) => name.replace(/\.json$/, ""));
}
