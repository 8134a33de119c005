/** Bytes that came in pieces, taken out in the sizes that a format wants. Copies each byte once. */
export class ByteQueue {
  private readonly chunks_: Uint8Array[] = [];
  private offset_ = 0;
  private size_ = 0;

  get size(): number {
    return this.size_;
  }

  push(chunk: Uint8Array): void {
    if (chunk.byteLength === 0) return;
    this.chunks_.push(chunk);
    this.size_ += chunk.byteLength;
  }

  /** Moves up to `want` bytes to `into` at `at`; returns how many it moved. */
  takeInto(into: Uint8Array, at: number, want: number): number {
    let taken = 0;
    while (taken < want) {
      const chunk = this.chunks_[0];
      if (!chunk) break;
      const part = Math.min(want - taken, chunk.byteLength - this.offset_);
      into.set(chunk.subarray(this.offset_, this.offset_ + part), at + taken);
      taken += part;
      this.offset_ += part;
      if (this.offset_ === chunk.byteLength) {
        this.chunks_.shift();
        this.offset_ = 0;
      }
    }
    this.size_ -= taken;
    return taken;
  }
}
