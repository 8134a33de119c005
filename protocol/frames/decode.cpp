// The decoder. It never trusts a number before it is checked against the bytes that are there.
#include <algorithm>
#include <cmath>
#include <string>

#include "protocol/frames/frame.h"

namespace pointwright::protocol {
namespace {

Error malformed(std::size_t offset, const std::string& what) {
  return Error{.code = ErrorCode::kMalformedData,
               .message = "frame, byte " + std::to_string(offset) + ": " + what,
               .field = "frame"};
}

bool finite_and_not_negative(float value) {
  return std::isfinite(value) && value >= 0.0F;
}

Result<void> check_magic(std::span<const std::byte> bytes) {
  if (bytes.size() < kFrameHeaderBytes) return malformed(bytes.size(), "shorter than the header");
  constexpr std::array<char, 4> kMagic{'P', 'W', 'F', 'R'};
  if (load<std::array<char, 4>>(bytes, 0) != kMagic) return malformed(0, "not the magic PWFR");
  if (const auto version = load<std::uint16_t>(bytes, 4); version != kFrameVersion) {
    return Error{.code = ErrorCode::kUnsupportedFormat,
                 .message = "frame version " + std::to_string(version) + " is unknown; this is version 1",
                 .field = "version"};
  }
  if (load<std::uint16_t>(bytes, 6) != kFrameHeaderBytes) return malformed(6, "another header size than 96");
  if (load<std::uint32_t>(bytes, 8) != bytes.size()) {
    return malformed(8, "announces " + std::to_string(load<std::uint32_t>(bytes, 8)) +
                            " bytes, but there are " + std::to_string(bytes.size()));
  }
  if (load<std::uint8_t>(bytes, 12) > 1) return malformed(12, "unknown kind");
  if ((load<std::uint16_t>(bytes, 14) & ~kAllFrameAttributes) != 0)
    return malformed(14, "unknown attribute bits");
  if (load<std::uint8_t>(bytes, 12) == 1 && (load<std::uint16_t>(bytes, 14) & kFrameRadius) != 0)
    return malformed(14, "radii in a delta");
  return {};
}

FrameHeader read_header(std::span<const std::byte> bytes) {
  FrameHeader header{.kind = static_cast<FrameKind>(load<std::uint8_t>(bytes, 12)),
                     .level = load<std::uint8_t>(bytes, 13),
                     .attributes = load<std::uint16_t>(bytes, 14),
                     .revision = load<std::uint64_t>(bytes, 16),
                     .sequence = load<std::uint64_t>(bytes, 24),
                     .sample_count = load<std::uint32_t>(bytes, 32),
                     .block_size = load<std::uint32_t>(bytes, 36),
                     .block_count = load<std::uint32_t>(bytes, 40),
                     .present_blocks = load<std::uint32_t>(bytes, 44),
                     .detail_range = load<float>(bytes, 72),
                     .stretch_range = load<float>(bytes, 76),
                     .bounds = {}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    header.origin[static_cast<int>(axis)] = load<double>(bytes, 48 + 8 * axis);
    header.bounds.center[static_cast<int>(axis)] = load<float>(bytes, 80 + 4 * axis);
  }
  header.bounds.radius = load<float>(bytes, 92);
  return header;
}

Result<void> check_header(const FrameHeader& header, std::size_t length, const FrameLimits& limits) {
  if (header.revision > kMaxSequence) return malformed(16, "a revision beyond 2^53 - 1");
  if (header.sequence > kMaxSequence) return malformed(24, "a sequence beyond 2^53 - 1");
  if (header.sample_count > limits.max_samples) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the frame speaks of " + std::to_string(header.sample_count) + " samples",
                 .field = "sample_count",
                 .limit = limits.max_samples,
                 .actual = header.sample_count};
  }
  if (header.block_size < 1 || header.block_size > kMaxBlockSize)
    return malformed(36, "block size out of range");
  if (header.block_count > header.sample_count) return malformed(40, "more blocks than samples");
  if (std::uint64_t{header.block_count} * header.block_size < header.sample_count) {
    return malformed(40, "more samples than slots");
  }
  if (header.present_blocks > header.block_count) return malformed(44, "more blocks present than there are");
  if (header.kind == FrameKind::kKey && header.present_blocks != header.block_count) {
    return malformed(44, "a key frame without all blocks");
  }
  const std::size_t least = block_record_bytes(1, header.attributes);
  if ((length - kFrameHeaderBytes) / least < header.present_blocks)
    return malformed(44, "more blocks than bytes");
  if (!header.origin.allFinite()) return malformed(48, "an origin that is not finite");
  if (!finite_and_not_negative(header.detail_range))
    return malformed(72, "a detail range that is not a length");
  if (!finite_and_not_negative(header.stretch_range))
    return malformed(76, "a stretch range that is not a factor");
  if (!header.bounds.center.allFinite() || !finite_and_not_negative(header.bounds.radius)) {
    return malformed(80, "bounds that are not a ball");
  }
  return {};
}

/// Takes `count` entries off the front of `bytes`. Pre: they are there.
template <typename T>
std::vector<T> take(std::span<const std::byte>& bytes, std::size_t count) {
  std::vector<T> column(count);
  std::memcpy(column.data(), bytes.first(count * sizeof(T)).data(), count * sizeof(T));
  bytes = bytes.subspan(count * sizeof(T));
  return column;
}

/// Moves past what fills `bytes_taken` up to a whole word; whether all of it is zero.
bool skip_padding(std::span<const std::byte>& bytes, std::size_t bytes_taken) {
  const auto padding = bytes.first(padded_to_word(bytes_taken) - bytes_taken);
  bytes = bytes.subspan(padding.size());
  return std::ranges::all_of(padding, [](std::byte value) { return value == std::byte{0}; });
}

/// False where padding is not zero.
bool take_columns(std::span<const std::byte> bytes, std::uint16_t attributes, DecodedBlock& block) {
  const std::size_t count = block.count;
  block.position_t = take<std::array<std::uint16_t, 4>>(bytes, count);
  if ((attributes & kFrameNormal) != 0) block.normal = take<std::array<std::int16_t, 2>>(bytes, count);
  if ((attributes & kFrameDetail) != 0) {
    const auto pairs = take<std::array<std::uint16_t, 2>>(bytes, count);
    block.detail.reserve(count);
    block.stretch.reserve(count);
    for (const auto& [detail, stretch] : pairs) {
      block.detail.push_back(static_cast<std::int16_t>(detail));
      block.stretch.push_back(stretch);
    }
  }
  if ((attributes & kFrameColor) != 0) block.color = take<Rgba>(bytes, count);
  if ((attributes & kFrameMarks) != 0) {
    block.marks = take<std::uint8_t>(bytes, count);
    if (!skip_padding(bytes, count)) return false;
  }
  if ((attributes & kFrameIds) != 0) block.ids = take<std::uint32_t>(bytes, count);
  if ((attributes & kFrameRadius) != 0) {
    block.radius = take<std::uint16_t>(bytes, count);
    if (!skip_padding(bytes, 2 * count)) return false;
  }
  return true;
}

/// Reads the record at `offset` and moves past it.
Result<DecodedBlock> read_block(std::span<const std::byte> bytes, const FrameHeader& header,
                                std::size_t& offset) {
  if (bytes.size() - offset < kBlockHeaderBytes) return malformed(offset, "a block record is cut off");
  DecodedBlock block;
  block.number = load<std::uint32_t>(bytes, offset);
  block.count = load<std::uint32_t>(bytes, offset + 4);
  if (block.number >= header.block_count) return malformed(offset, "a block number out of range");
  if (block.count < 1 || block.count > header.block_size)
    return malformed(offset + 4, "a lane count out of range");
  const std::size_t record_bytes = block_record_bytes(block.count, header.attributes);
  if (bytes.size() - offset < record_bytes) return malformed(offset, "a block record is cut off");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto minimum = load<float>(bytes, offset + 8 + 4 * axis);
    const auto extent = load<float>(bytes, offset + 20 + 4 * axis);
    if (!std::isfinite(minimum) || !finite_and_not_negative(extent) || !std::isfinite(minimum + extent)) {
      return malformed(offset + 8, "a quantisation box that is not finite or negative");
    }
    block.minimum[static_cast<int>(axis)] = minimum;
    block.extent[static_cast<int>(axis)] = extent;
  }
  const auto record = bytes.subspan(offset, record_bytes);
  if (!take_columns(record.subspan(kBlockHeaderBytes), header.attributes, block))
    return malformed(offset, "padding that is not zero");
  for (const std::uint16_t radius : block.radius) {
    if (!finite_and_not_negative(from_bfloat16(radius)))
      return malformed(offset, "a radius that is not a length");
  }
  offset += record_bytes;
  return block;
}

}  // namespace

Result<DecodedFrame> decode_frame(std::span<const std::byte> bytes, const FrameLimits& limits) {
  if (auto magic = check_magic(bytes); !magic) return magic.error();
  DecodedFrame frame;
  frame.header = read_header(bytes);
  const FrameHeader& header = frame.header;
  if (auto sound = check_header(header, bytes.size(), limits); !sound) return sound.error();

  const bool key = header.kind == FrameKind::kKey;
  std::vector<bool> seen(key ? header.block_count : 0);
  std::uint64_t samples = 0;
  std::size_t offset = kFrameHeaderBytes;
  frame.blocks.reserve(header.present_blocks);
  for (std::uint32_t i = 0; i < header.present_blocks; ++i) {
    const std::size_t record = offset;
    auto block = read_block(bytes, header, offset);
    if (!block) return block.error();
    const std::uint32_t number = block.value().number;
    if (key && seen[number]) return malformed(record, "a block that was there before");
    if (key) seen[number] = true;
    if (!key && i > 0 && number <= frame.blocks.back().number)
      return malformed(record, "blocks that do not ascend");
    samples += block.value().count;
    frame.blocks.push_back(std::move(block).value());
  }
  if (offset != bytes.size()) return malformed(offset, "more bytes than the blocks fill");
  if (key ? samples != header.sample_count : samples > header.sample_count) {
    return malformed(32, "a sample count that the blocks contradict");
  }
  return frame;
}

std::vector<Vec3d> decode_positions(const FrameHeader& header, const DecodedBlock& block) {
  std::vector<Vec3d> positions;
  positions.reserve(block.position_t.size());
  for (const auto& q : block.position_t) {
    const Vec3d fraction = Vec3d(q[0], q[1], q[2]) / 65535.0;
    positions.emplace_back(header.origin + block.minimum.cast<double>() +
                           block.extent.cast<double>().cwiseProduct(fraction));
  }
  return positions;
}

std::vector<Vec3f> decode_normals(const DecodedBlock& block) {
  std::vector<Vec3f> normals;
  normals.reserve(block.normal.size());
  for (const auto& q : block.normal) {
    const float u = std::max(-1.0F, static_cast<float>(q[0]) / 32767.0F);
    const float v = std::max(-1.0F, static_cast<float>(q[1]) / 32767.0F);
    Vec3f normal(u, v, 1.0F - std::abs(u) - std::abs(v));
    if (normal.z() < 0.0F) {
      normal.x() = (1.0F - std::abs(v)) * (u < 0.0F ? -1.0F : 1.0F);
      normal.y() = (1.0F - std::abs(u)) * (v < 0.0F ? -1.0F : 1.0F);
    }
    normals.push_back(normal.normalized());
  }
  return normals;
}

}  // namespace pointwright::protocol
