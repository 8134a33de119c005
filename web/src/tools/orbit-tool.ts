import type { Tool } from "./tool";

/** Only looks: every button belongs to the camera. */
export class OrbitTool implements Tool {
  readonly name = "orbit";
  activate(): void {}
  deactivate(): void {}
}
