#pragma once
// Writes pieces of block records to their places in a frame; the encoder's own, not for others.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/frames/frame.h"
#include "protocol/frames/quantise_kernels.h"

namespace pointwright::protocol {

/// Neighbouring lanes of one block that come from one stretch of the cloud (kPieceWindow samples), so that a
/// thread reads every cache line of it once, whatever the layers.
struct BlockPiece {
  std::uint32_t record = 0;  ///< index of the block among the frame's blocks
  std::uint32_t lane = 0;    ///< of its first sample
  SampleRange samples;
};
inline constexpr std::uint32_t kPieceWindow = 2048;
inline constexpr std::size_t kPieceLanes = kPieceWindow / 2;

/// A block's place in the frame.
struct BlockRecord {
  std::uint32_t number = 0;
  std::uint32_t count = 0;
  std::size_t offset = 0;  ///< of the record, in bytes
  std::array<QuantiseAxis, 3> axes{};
};

/// The axis of a quantisation box between two finite coordinates.
QuantiseAxis quantise_axis(float minimum, float maximum);

/// The work of one thread: gathers a piece's columns and quantises them. Holds its buffers; not thread-safe.
class BlockWriter {
 public:
  /// Looks the kernels up; keeps references to its arguments.
  BlockWriter(const FrameColumns& columns, const FrameState& state, std::uint16_t attributes);

  /// The box of a piece's positions.
  Box3f bounds(const BlockPiece& piece);
  /// Writes the piece's lanes into the record that starts at `record_bytes`; with the first piece its header
  /// too.
  void write(const BlockPiece& piece, const BlockRecord& record, std::byte* record_bytes);

 private:
  static constexpr std::size_t kBuffers = 4;

  const float* gather(const float* column, const SampleRange& samples, std::size_t buffer);
  /// Zeros where the column is empty.
  const float* gather(std::span<const float> column, const SampleRange& samples, std::size_t buffer);
  void write_positions(const BlockPiece& piece, const BlockRecord& record, std::byte* out);
  void write_normals(const BlockPiece& piece, std::byte* out);
  void write_detail(const BlockPiece& piece, std::byte* out);

  const FrameColumns& columns_;
  const FrameState& state_;
  std::uint16_t attributes_;
  decltype(&simd_base::frame_gather) gather_kernel_;
  decltype(&simd_base::frame_range) range_kernel_;
  decltype(&simd_base::frame_positions) positions_kernel_;
  decltype(&simd_base::frame_normals) normals_kernel_;
  decltype(&simd_base::frame_detail) detail_kernel_;
  std::array<std::array<float, kPieceLanes>, kBuffers> buffers_;
  std::array<std::uint32_t, 2 * kPieceLanes> words_;
};

}  // namespace pointwright::protocol
