/** The typed client as a package (clients/typescript): the viewer's own requests and codecs, and no viewer. */

export { laneDetail, laneNormal, lanePosition, laneT } from "../protocol/frame-tools";
export type { FrameBlock, FrameHeader } from "../protocol/frames";
export { decodeFrame, type Frame, FrameError } from "../protocol/frames";
export type { components, paths } from "../protocol/openapi";
export { ApiClient, type Fetch } from "./client";
export { EventParser, readEvents, type ServerEvent } from "./event-stream";
export { ApiError, describeProblem } from "./problem";
export { SessionStream, type StreamEvent, type StreamSink, type StreamStatus } from "./stream";
export * from "./tools";
export type * from "./types";
