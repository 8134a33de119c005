/** One server-sent event. */
export interface ServerEvent {
  event: string;
  data: string;
}

/** The server sends comments at least once a minute; a stream silent for longer than this is taken for dead. */
const SILENCE_MS = 75_000;
const MAX_EVENT_CHARACTERS = 1 << 20;

/** Cuts the text of a stream of server-sent events into events, wherever its pieces end. */
export class EventParser {
  private rest_ = "";
  private event_ = "";
  private data_: string[] = [];

  *push(text: string): Generator<ServerEvent, void, undefined> {
    this.rest_ += text;
    for (;;) {
      // A carriage return at the very end may be half of a line's end.
      const end = /\r\n|\n|\r(?!$)/.exec(this.rest_);
      if (!end) break;
      const line = this.rest_.slice(0, end.index);
      this.rest_ = this.rest_.slice(end.index + end[0].length);
      const event = this.line(line);
      if (event) yield event;
    }
    if (this.rest_.length > MAX_EVENT_CHARACTERS) throw new Error("an event of more than a mebibyte");
  }

  private line(line: string): ServerEvent | null {
    if (line === "") {
      const event = { event: this.event_ || "message", data: this.data_.join("\n") };
      const isEmpty = this.data_.length === 0;
      this.event_ = "";
      this.data_ = [];
      return isEmpty ? null : event;
    }
    const [, field, value = ""] = /^([^:]*)(?:: ?(.*))?$/s.exec(line) ?? [];
    if (field === "event") this.event_ = value;
    else if (field === "data") this.data_.push(value);
    return null;
  }
}

/** The events of an answer, as they come; lets the connection go when the reader stops. */
export async function* readEvents(response: Response): AsyncGenerator<ServerEvent, void, undefined> {
  const reader = response.body?.getReader();
  if (!reader) return;
  const parser = new EventParser();
  const decoder = new TextDecoder();
  let silence: ReturnType<typeof setTimeout> | undefined;
  try {
    for (;;) {
      clearTimeout(silence);
      silence = setTimeout(() => void reader.cancel(), SILENCE_MS);
      const { done, value } = await reader.read();
      if (done) return;
      yield* parser.push(decoder.decode(value, { stream: true }));
    }
  } finally {
    clearTimeout(silence);
    await reader.cancel().catch(() => undefined);
  }
}

/** The bytes without the beginning of a character whose end is still to come. */
export function wholeCharacters(bytes: Uint8Array): Uint8Array {
  for (let back = 1; back <= Math.min(3, bytes.length); ++back) {
    const byte = bytes[bytes.length - back] ?? 0;
    if (byte < 0x80) return bytes;
    if (byte < 0xc0) continue;
    const length = byte < 0xe0 ? 2 : byte < 0xf0 ? 3 : 4;
    return back < length ? bytes.subarray(0, bytes.length - back) : bytes;
  }
  return bytes;
}
