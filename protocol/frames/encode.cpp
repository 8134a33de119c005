// The encoder. Sizes and places of all block records follow from the layout alone, so every block is written
// straight to its place, by whichever thread takes it.
#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "engine/core/parallel.h"
#include "protocol/frames/block_writer.h"
#include "protocol/frames/frame.h"

namespace pointwright::protocol {
namespace {

/// Pieces that one thread takes at a time: four windows of the cloud.
constexpr std::size_t kPiecesPerTask = std::size_t{4} * kLayerCount;

bool has(std::uint16_t attributes, FrameAttribute attribute) {
  return (attributes & attribute) != 0;
}

void check_columns(const FrameLayout& layout, const FrameColumns& columns, std::uint16_t attributes) {
  const std::size_t n = layout.sample_count();
  const auto fits = [n](std::size_t size) { return size == 0 || size >= n; };
  POINTWRIGHT_CHECK((attributes & ~kAllFrameAttributes) == 0, "unknown attribute bits");
  POINTWRIGHT_CHECK(columns.position != nullptr && columns.position->size() == n,
                    "positions do not fit the layout");
  POINTWRIGHT_CHECK(
      !has(attributes, kFrameNormal) || (columns.normal != nullptr && columns.normal->size() == n),
      "normals do not fit the layout");
  POINTWRIGHT_CHECK(fits(columns.t.size()), "t does not fit the layout");
  POINTWRIGHT_CHECK(fits(columns.detail.size()), "detail does not fit the layout");
  POINTWRIGHT_CHECK(fits(columns.stretch.size()), "stretch does not fit the layout");
  POINTWRIGHT_CHECK(!has(attributes, kFrameColor) || columns.color.size() >= n,
                    "colours do not fit the layout");
  POINTWRIGHT_CHECK(!has(attributes, kFrameMarks) || columns.marks.size() >= n,
                    "marks do not fit the layout");
  POINTWRIGHT_CHECK(!has(attributes, kFrameRadius) || columns.radius.size() >= n,
                    "radii do not fit the layout");
  POINTWRIGHT_CHECK(!has(attributes, kFrameIds) || columns.ids.size() >= n, "ids do not fit the layout");
}

SurfaceBounds ball_of(const Box3f& box) {
  if (box.is_empty()) return {};
  // Halves first: the sum of two large coordinates must not overflow.
  return {.center = 0.5F * box.min + 0.5F * box.max, .radius = 0.5F * box.diagonal()};
}

void write_header(const FrameHeader& header, std::size_t frame_bytes, std::byte* out) {
  constexpr std::array<char, 4> kMagic{'P', 'W', 'F', 'R'};
  store(out, kMagic);
  store(out + 4, kFrameVersion);
  store(out + 6, static_cast<std::uint16_t>(kFrameHeaderBytes));
  store(out + 8, static_cast<std::uint32_t>(frame_bytes));
  store(out + 12, header.kind);
  store(out + 13, header.level);
  store(out + 14, header.attributes);
  store(out + 16, header.revision);
  store(out + 24, header.sequence);
  store(out + 32, header.sample_count);
  store(out + 36, header.block_size);
  store(out + 40, header.block_count);
  store(out + 44, header.present_blocks);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    store(out + 48 + 8 * axis, header.origin[static_cast<int>(axis)]);
    store(out + 80 + 4 * axis, header.bounds.center[static_cast<int>(axis)]);
  }
  store(out + 72, header.detail_range);
  store(out + 76, header.stretch_range);
  store(out + 92, header.bounds.radius);
}

/// The records of the given blocks, one after the other; returns the bytes of the frame.
std::size_t place_records(const FrameLayout& layout, std::uint16_t attributes,
                          std::span<const std::uint32_t> blocks, std::vector<BlockRecord>& records) {
  std::size_t frame_bytes = kFrameHeaderBytes;
  records.reserve(blocks.size());
  for (const std::uint32_t block : blocks) {
    const std::uint32_t count = layout.block_samples(block).count;
    records.push_back({.number = block, .count = count, .offset = frame_bytes});
    frame_bytes += block_record_bytes(count, attributes);
  }
  POINTWRIGHT_CHECK(frame_bytes <= std::numeric_limits<std::uint32_t>::max(), "a frame beyond 4 GiB");
  return frame_bytes;
}

/// The pieces of the records, window by window of the cloud and layer by layer in each: every window is read
/// once, though its samples go to blocks of all layers.
std::vector<BlockPiece> cut_pieces(const FrameLayout& layout, const std::vector<BlockRecord>& records) {
  constexpr std::uint32_t kAbsent = 0xFFFFFFFFU;
  std::vector<std::uint32_t> record_of(layout.block_count(), kAbsent);
  for (std::uint32_t i = 0; i < records.size(); ++i) record_of[records[i].number] = i;
  std::vector<BlockPiece> pieces;
  pieces.reserve(records.size() + std::size_t{kLayerCount} * (layout.sample_count() / kPieceWindow + 1));
  for (std::uint64_t window = 0; window < layout.sample_count(); window += kPieceWindow) {
    // The finest layer first: it reads every cache line in a row, as memory likes it best.
    for (std::uint32_t layer = kLayerCount; layer-- > 0;) {
      const SampleRange samples = layout.layer_samples(layer);
      // Windows start at multiples of every stride.
      const auto end = static_cast<std::uint32_t>(
          std::min<std::uint64_t>(samples.count, (window + kPieceWindow) / samples.stride));
      for (auto index = static_cast<std::uint32_t>(window / samples.stride); index < end;) {
        const std::uint32_t lane = index % layout.block_size();
        const std::uint32_t count = std::min(end - index, layout.block_size() - lane);
        const std::uint32_t record = record_of[layout.first_block(layer) + index / layout.block_size()];
        if (record != kAbsent) {
          pieces.push_back({.record = record,
                            .lane = lane,
                            .samples = {.begin = samples.begin + index * samples.stride,
                                        .stride = samples.stride,
                                        .count = count}});
        }
        index += count;
      }
    }
  }
  return pieces;
}

/// Finds the box of every record; returns the box of them all.
Box3f measure_records(const std::vector<BlockPiece>& pieces, const FrameColumns& columns,
                      const FrameState& state, std::vector<BlockRecord>& records) {
  std::vector<Box3f> piece_boxes(pieces.size());
  parallel_for(
      pieces.size(),
      [&](std::size_t begin, std::size_t end) {
        BlockWriter writer(columns, state, 0);
        for (std::size_t i = begin; i < end; ++i) piece_boxes[i] = writer.bounds(pieces[i]);
      },
      kPiecesPerTask);
  std::vector<Box3f> boxes(records.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    boxes[pieces[i].record].extend(piece_boxes[i].min);
    boxes[pieces[i].record].extend(piece_boxes[i].max);
  }
  Box3f whole;
  for (std::size_t i = 0; i < records.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      records[i].axes[static_cast<std::size_t>(axis)] = quantise_axis(boxes[i].min[axis], boxes[i].max[axis]);
    }
    whole.extend(boxes[i].min);
    whole.extend(boxes[i].max);
  }
  return whole;
}

/// Encodes the given blocks in the given order.
void encode_frame(FrameKind kind, const FrameLayout& layout, const FrameColumns& columns,
                  const FrameState& state, std::uint16_t attributes, std::span<const std::uint32_t> blocks,
                  FrameBytes& out) {
  check_columns(layout, columns, attributes);
  POINTWRIGHT_CHECK(state.revision <= kMaxSequence && state.sequence <= kMaxSequence,
                    "a number beyond 2^53 - 1");
  std::vector<BlockRecord> records;
  const std::size_t frame_bytes = place_records(layout, attributes, blocks, records);
  const std::vector<BlockPiece> pieces = cut_pieces(layout, records);
  const Box3f box = measure_records(pieces, columns, state, records);
  out.resize(frame_bytes);
  parallel_for(
      pieces.size(),
      [&](std::size_t begin, std::size_t end) {
        BlockWriter writer(columns, state, attributes);
        for (std::size_t i = begin; i < end; ++i) {
          const BlockRecord& record = records[pieces[i].record];
          writer.write(pieces[i], record, out.data() + record.offset);
        }
      },
      kPiecesPerTask);

  const bool has_detail = has(attributes, kFrameDetail);
  const SurfaceBounds bounds = state.bounds              ? *state.bounds
                               : kind == FrameKind::kKey ? ball_of(box)
                                                         : surface_bounds(*columns.position);
  write_header({.kind = kind,
                .level = state.level,
                .attributes = attributes,
                .revision = state.revision,
                .sequence = state.sequence,
                .sample_count = layout.sample_count(),
                .block_size = layout.block_size(),
                .block_count = layout.block_count(),
                .present_blocks = static_cast<std::uint32_t>(blocks.size()),
                .origin = state.origin,
                .detail_range = has_detail ? state.detail_range : 0.0F,
                .stretch_range = has_detail ? state.stretch_range : 0.0F,
                .bounds = bounds},
               frame_bytes, out.data());
}

}  // namespace

std::size_t block_record_bytes(std::uint32_t count, std::uint16_t attributes) {
  std::size_t bytes = kBlockHeaderBytes + std::size_t{8} * count;
  for (const FrameAttribute attribute : {kFrameNormal, kFrameDetail, kFrameColor, kFrameIds}) {
    if (has(attributes, attribute)) bytes += std::size_t{4} * count;
  }
  if (has(attributes, kFrameMarks)) bytes += padded_to_word(count);
  if (has(attributes, kFrameRadius)) bytes += padded_to_word(std::size_t{2} * count);
  return bytes;
}

std::size_t key_frame_bytes(const FrameLayout& layout, std::uint16_t attributes) {
  std::size_t bytes = kFrameHeaderBytes;
  for (std::uint32_t block = 0; block < layout.block_count(); ++block) {
    bytes += block_record_bytes(layout.block_samples(block).count, attributes);
  }
  return bytes;
}

void encode_key_frame(const FrameLayout& layout, const FrameColumns& columns, const FrameState& state,
                      std::uint16_t attributes, FrameBytes& out) {
  encode_frame(FrameKind::kKey, layout, columns, state, attributes, layout.key_order(), out);
}

void encode_delta_frame(const FrameLayout& layout, const FrameColumns& columns, const FrameState& state,
                        std::uint16_t attributes, std::span<const std::uint32_t> blocks, FrameBytes& out) {
  for (std::size_t i = 1; i < blocks.size(); ++i) {
    POINTWRIGHT_CHECK(blocks[i - 1] < blocks[i], "the blocks of a delta ascend");
  }
  const auto sent = static_cast<std::uint16_t>(attributes & ~kFrameRadius);
  encode_frame(FrameKind::kDelta, layout, columns, state, sent, blocks, out);
}

std::uint16_t to_bfloat16(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return static_cast<std::uint16_t>((bits + 0x7FFFU + ((bits >> 16) & 1U)) >> 16);
}

float from_bfloat16(std::uint16_t bits) {
  return std::bit_cast<float>(std::uint32_t{bits} << 16);
}

SurfaceBounds surface_bounds(const Points& position) {
  const FrameColumns columns{.position = &position};
  const FrameState state;
  std::vector<Box3f> boxes((position.size() + kPieceLanes - 1) / kPieceLanes);
  parallel_for(
      boxes.size(),
      [&](std::size_t begin, std::size_t end) {
        BlockWriter writer(columns, state, 0);
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t first = i * kPieceLanes;
          const auto count = static_cast<std::uint32_t>(std::min(kPieceLanes, position.size() - first));
          boxes[i] = writer.bounds({.samples = {.begin = static_cast<std::uint32_t>(first), .count = count}});
        }
      },
      kPiecesPerTask);
  Box3f whole;
  for (const Box3f& box : boxes) {
    whole.extend(box.min);
    whole.extend(box.max);
  }
  return ball_of(whole);
}

}  // namespace pointwright::protocol
