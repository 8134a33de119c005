#include "protocol/frames/block_writer.h"

#include <algorithm>

namespace pointwright::protocol {
namespace {

constexpr std::array<float, kPieceLanes> kZeros{};

/// Entries of a column that go out as they are.
template <typename T>
void copy_strided(std::span<const T> column, const SampleRange& samples, std::byte* out) {
  const T* source = column.data() + samples.begin;
  for (std::size_t i = 0; i < samples.count; ++i) store(out + i * sizeof(T), source[i * samples.stride]);
}

void write_record_header(const BlockRecord& record, std::byte* out) {
  store(out, record.number);
  store(out + 4, record.count);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    store(out + 8 + 4 * axis, record.axes[axis].minimum);
    store(out + 20 + 4 * axis, record.axes[axis].extent);
  }
}

}  // namespace

QuantiseAxis quantise_axis(float minimum, float maximum) {
  // Below this, 65535 / extent overflows; such a box is flat for every purpose.
  constexpr float kFlat = 1e-30F;
  const float extent = maximum - minimum;
  if (!(extent > kFlat)) return {.minimum = minimum, .extent = 0.0F, .scale = 0.0F};
  return {.minimum = minimum, .extent = extent, .scale = 65535.0F / extent};
}

BlockWriter::BlockWriter(const FrameColumns& columns, const FrameState& state, std::uint16_t attributes)
    : columns_(columns),
      state_(state),
      attributes_(attributes),
      gather_kernel_(POINTWRIGHT_KERNEL(frame_gather)),
      range_kernel_(POINTWRIGHT_KERNEL(frame_range)),
      positions_kernel_(POINTWRIGHT_KERNEL(frame_positions)),
      normals_kernel_(POINTWRIGHT_KERNEL(frame_normals)),
      detail_kernel_(POINTWRIGHT_KERNEL(frame_detail)) {}

const float* BlockWriter::gather(const float* column, const SampleRange& samples, std::size_t buffer) {
  float* const values = buffers_[buffer].data();
  gather_kernel_({.src = column + samples.begin, .stride = samples.stride, .dst = values}, 0, samples.count);
  // The last value again: it changes no minimum, and whatever is made of it is not sent.
  std::fill(values + samples.count, values + padded_to_block(samples.count), values[samples.count - 1]);
  return values;
}

const float* BlockWriter::gather(std::span<const float> column, const SampleRange& samples,
                                 std::size_t buffer) {
  return column.empty() ? kZeros.data() : gather(column.data(), samples, buffer);
}

Box3f BlockWriter::bounds(const BlockPiece& piece) {
  const Points& position = *columns_.position;
  Box3f box;
  range_kernel_({.values = {gather(position.x(), piece.samples, 0), gather(position.y(), piece.samples, 1),
                            gather(position.z(), piece.samples, 2)},
                 .minimum = box.min.data(),
                 .maximum = box.max.data()},
                0, padded_to_block(piece.samples.count));
  return box;
}

void BlockWriter::write_positions(const BlockPiece& piece, const BlockRecord& record, std::byte* out) {
  const Points& position = *columns_.position;
  const std::span<const float> t = (attributes_ & kFrameT) != 0 ? columns_.t : std::span<const float>{};
  positions_kernel_(
      {.axes = {record.axes[0], record.axes[1], record.axes[2]},
       .position = {gather(position.x(), piece.samples, 0), gather(position.y(), piece.samples, 1),
                    gather(position.z(), piece.samples, 2)},
       .t = gather(t, piece.samples, 3),
       .words = words_.data()},
      0, padded_to_block(piece.samples.count));
  std::memcpy(out, words_.data(), std::size_t{8} * piece.samples.count);
}

void BlockWriter::write_normals(const BlockPiece& piece, std::byte* out) {
  const Points& normal = *columns_.normal;
  normals_kernel_({.normal = {gather(normal.x(), piece.samples, 0), gather(normal.y(), piece.samples, 1),
                              gather(normal.z(), piece.samples, 2)},
                   .words = words_.data()},
                  0, padded_to_block(piece.samples.count));
  std::memcpy(out, words_.data(), std::size_t{4} * piece.samples.count);
}

void BlockWriter::write_detail(const BlockPiece& piece, std::byte* out) {
  detail_kernel_({.detail = gather(columns_.detail, piece.samples, 0),
                  .stretch = gather(columns_.stretch, piece.samples, 1),
                  .detail_scale = state_.detail_range > 0.0F ? 1.0F / state_.detail_range : 0.0F,
                  .stretch_scale = state_.stretch_range > 0.0F ? 1.0F / state_.stretch_range : 0.0F,
                  .words = words_.data()},
                 0, padded_to_block(piece.samples.count));
  std::memcpy(out, words_.data(), std::size_t{4} * piece.samples.count);
}

void BlockWriter::write(const BlockPiece& piece, const BlockRecord& record, std::byte* record_bytes) {
  if (piece.lane == 0) write_record_header(record, record_bytes);
  std::byte* section = record_bytes + kBlockHeaderBytes;
  const auto next = [&](std::size_t bytes_per_lane) {  // the piece's place in the next section
    std::byte* const place = section + bytes_per_lane * piece.lane;
    section += padded_to_word(bytes_per_lane * record.count);
    return place;
  };
  write_positions(piece, record, next(8));
  if ((attributes_ & kFrameNormal) != 0) write_normals(piece, next(4));
  if ((attributes_ & kFrameDetail) != 0) write_detail(piece, next(4));
  if ((attributes_ & kFrameColor) != 0) copy_strided(columns_.color, piece.samples, next(4));
  const auto fill_up = [&](std::size_t bytes_per_lane) {  // the last piece clears what pads its section
    if (piece.lane + piece.samples.count != record.count) return;
    const std::size_t bytes = bytes_per_lane * record.count;
    std::fill(section - (padded_to_word(bytes) - bytes), section, std::byte{0});
  };
  if ((attributes_ & kFrameMarks) != 0) {
    copy_strided(columns_.marks, piece.samples, next(1));
    fill_up(1);
  }
  if ((attributes_ & kFrameIds) != 0) copy_strided(columns_.ids, piece.samples, next(4));
  if ((attributes_ & kFrameRadius) != 0) {
    copy_strided(columns_.radius, piece.samples, next(2));
    fill_up(2);
  }
}

}  // namespace pointwright::protocol
