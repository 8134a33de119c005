import {
  blockHeaderBytes,
  blockRecordBytes,
  checkHeader,
  type FrameBlock,
  FrameError,
  type FrameHeader,
  frameHeaderBytes,
  readBlock,
  readHeader,
} from "../protocol/frames";

/**
 * Reads one frame while it arrives, so that the first blocks are on the screen before the last have left the server: the
 * header once its bytes are there, each block once it is whole. As strict as `decodeFrame`.
 */
export class FrameReader {
  private readonly bytes_: Uint8Array<ArrayBuffer>;
  private readonly view_: DataView;
  private readonly seen_ = new Set<number>();
  private filled_ = 0;
  private parsed_ = frameHeaderBytes;
  private previous_ = -1;
  private samples_ = 0;
  private header_: FrameHeader | null = null;

  /** For a frame of `frameBytes` bytes, as its record announces it. */
  constructor(frameBytes: number) {
    if (frameBytes < frameHeaderBytes) throw new FrameError("not a frame: shorter than the header");
    this.bytes_ = new Uint8Array(frameBytes);
    this.view_ = new DataView(this.bytes_.buffer);
  }

  get header(): FrameHeader | null {
    return this.header_;
  }

  /** Bytes that are still to come. */
  get missing(): number {
    return this.bytes_.byteLength - this.filled_;
  }

  /** Whether the frame has come whole and all its blocks were taken. */
  get done(): boolean {
    return this.missing === 0 && this.header_ !== null && this.seen_.size === this.header_.presentBlocks;
  }

  /** Lets `fill` write into the frame; it returns how many bytes it wrote. */
  fill(fill: (into: Uint8Array, at: number, want: number) => number): void {
    this.filled_ += fill(this.bytes_, this.filled_, this.missing);
    if (this.header_ || this.filled_ < frameHeaderBytes) return;
    const header = readHeader(this.view_);
    checkHeader(header, this.bytes_.byteLength);
    this.header_ = header;
  }

  /** The next whole block; null where none is whole yet, or the frame is at its end. */
  next(): FrameBlock | null {
    const header = this.header_;
    if (!header) return null;
    if (this.seen_.size === header.presentBlocks) {
      this.checkEnd(header);
      return null;
    }
    const missing = this.missing > 0;
    if (missing && this.filled_ < this.parsed_ + blockHeaderBytes) return null;
    if (missing) {
      const count = this.view_.getUint32(this.parsed_ + 4, true);
      if (
        count <= header.blockSize &&
        this.filled_ < this.parsed_ + blockRecordBytes(count, header.attributes)
      )
        return null;
    }
    const block = readBlock(this.bytes_, this.view_, this.parsed_, header);
    const repeated = header.kind === "key" ? this.seen_.has(block.number) : block.number <= this.previous_;
    if (repeated) throw new FrameError("not a frame: blocks repeated or out of order");
    this.seen_.add(block.number);
    this.previous_ = block.number;
    this.samples_ += block.count;
    this.parsed_ += blockRecordBytes(block.count, header.attributes);
    return block;
  }

  private checkEnd(header: FrameHeader): void {
    if (this.parsed_ !== this.bytes_.byteLength)
      throw new FrameError("not a frame: more bytes than the blocks fill");
    const whole =
      header.kind === "key" ? this.samples_ === header.sampleCount : this.samples_ <= header.sampleCount;
    if (!whole) throw new FrameError("not a frame: a sample count that the blocks contradict");
  }
}
