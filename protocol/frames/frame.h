#pragma once
// Sample frames: columns of a cloud to bytes and back. The layout of the bytes is frozen in FRAMES.md.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "protocol/frames/bytes.h"
#include "protocol/frames/layout.h"

namespace pointwright::protocol {

inline constexpr std::uint16_t kFrameVersion = 1;
inline constexpr std::size_t kFrameHeaderBytes = 96;
inline constexpr std::size_t kBlockHeaderBytes = 32;
/// Revisions and sequences stay within what every JSON number holds exactly.
inline constexpr std::uint64_t kMaxSequence = (std::uint64_t{1} << 53) - 1;

enum class FrameKind : std::uint8_t {
  kKey = 0,    ///< every block is present
  kDelta = 1,  ///< only blocks that changed since the receiver's last frame
};

/// Bits of a frame's attributes. Positions are always there.
enum FrameAttribute : std::uint16_t {
  kFrameNormal = 1,
  kFrameT = 2,
  kFrameDetail = 4,  ///< detail and stretch
  kFrameColor = 8,
  kFrameMarks = 16,
  kFrameIds = 32,
  kFrameRadius = 64,  ///< key frames only: a delta leaves the receiver's radii as they are
};
inline constexpr std::uint16_t kAllFrameAttributes = 127;

/// A ball around the whole surface, relative to the origin: what a camera frames.
struct SurfaceBounds {
  Vec3f center = Vec3f::Zero();
  float radius = 0.0F;
};

/// The 96 bytes at the head of a frame, without magic and sizes.
struct FrameHeader {
  FrameKind kind = FrameKind::kKey;
  std::uint8_t level = 0;
  std::uint16_t attributes = 0;
  std::uint64_t revision = 0;
  std::uint64_t sequence = 0;
  std::uint32_t sample_count = 0;
  std::uint32_t block_size = kDefaultBlockSize;
  std::uint32_t block_count = 0;
  std::uint32_t present_blocks = 0;
  Vec3d origin = Vec3d::Zero();
  float detail_range = 0.0F;
  float stretch_range = 0.0F;
  SurfaceBounds bounds;
};

/// What a frame is made of: columns of N samples in coherent order; the caller keeps them alive.
struct FrameColumns {
  const Points* position = nullptr;  ///< always there; relative to the origin, finite
  const Points* normal = nullptr;    ///< unit vectors; owed where kFrameNormal is asked for, as below
  std::span<const float> t;          ///< in [0, 1] (may be padded beyond N); empty: all 0
  std::span<const float> detail;     ///< model units; empty: all 0
  std::span<const float> stretch;    ///< factors >= 0; empty: all 0
  std::span<const Rgba> color;
  std::span<const std::uint8_t> marks;
  std::span<const std::uint32_t> ids;
  std::span<const std::uint16_t> radius;  ///< of the splats, as to_bfloat16 gives it
};

/// What of the header the columns do not say.
struct FrameState {
  std::uint8_t level = 0;
  std::uint64_t revision = 0;
  std::uint64_t sequence = 0;  ///< 0 where no preview is shown
  Vec3d origin = Vec3d::Zero();
  float detail_range = 0.0F;   ///< > 0 for detail to be sent as other than 0
  float stretch_range = 0.0F;  ///< > 0 for stretch to be sent as other than 0
  /// Where not given, the bounding box's ball: free in a key, O(N) in a delta.
  std::optional<SurfaceBounds> bounds = std::nullopt;
};

/// The upper half of a float32, rounded to nearest (ties to even).
/// Pre: finite, and not so large that it rounds to infinity
std::uint16_t to_bfloat16(float value);
float from_bfloat16(std::uint16_t bits);

/// A frame's bytes. Growing one leaves the new bytes uninitialised: the encoder writes every one of them.
using FrameBytes = std::vector<std::byte, UninitialisedAllocator<std::byte>>;

/// Bytes of one block record with `count` filled lanes.
std::size_t block_record_bytes(std::uint32_t count, std::uint16_t attributes);
/// Bytes of a key frame with all blocks of the layout.
std::size_t key_frame_bytes(const FrameLayout& layout, std::uint16_t attributes);

/// Writes the key frame of the columns to `out`, whose storage is reused.
/// Pre:         columns of layout.sample_count() samples; those that `attributes` names are there (t, detail
///              and stretch may be empty); the frame stays below 4 GiB (LogicError otherwise)
/// Cost:        O(N), vectorised, parallel over blocks
/// Determinism: bitwise equal for any thread count and machine
void encode_key_frame(const FrameLayout& layout, const FrameColumns& columns, const FrameState& state,
                      std::uint16_t attributes, FrameBytes& out);

/// Writes the delta frame with the given blocks. The receiver's last frame must have had the same layout,
/// level, attributes, origin, ranges and radii; a change of these takes a key frame. Radii stand in key
/// frames only, whatever `attributes` names.
/// Pre:  as encode_key_frame; blocks strictly ascending and < block_count
/// Cost: O(samples of the blocks)
void encode_delta_frame(const FrameLayout& layout, const FrameColumns& columns, const FrameState& state,
                        std::uint16_t attributes, std::span<const std::uint32_t> blocks, FrameBytes& out);

/// The blocks in which any column that `attributes` names differs, radii excepted: a change of radii takes a
/// key frame. Ascending. Columns that are the same memory in both are equal without a look.
/// Pre:  both as in encode_key_frame
/// Cost: O(N), parallel
std::vector<std::uint32_t> changed_blocks(const FrameLayout& layout, const FrameColumns& before,
                                          const FrameColumns& after, std::uint16_t attributes);

/// The ball around the bounding box of the points. Cost: O(N), parallel.
SurfaceBounds surface_bounds(const Points& position);

/// What a decoder accepts.
struct FrameLimits {
  std::uint32_t max_samples = 100'000'000;
};

/// One block record, quantised as it came. Columns that the attributes do not name are empty.
struct DecodedBlock {
  std::uint32_t number = 0;
  std::uint32_t count = 0;
  Vec3f minimum = Vec3f::Zero();
  Vec3f extent = Vec3f::Zero();
  std::vector<std::array<std::uint16_t, 4>> position_t;
  std::vector<std::array<std::int16_t, 2>> normal;
  std::vector<std::int16_t> detail;
  std::vector<std::uint16_t> stretch;
  std::vector<Rgba> color;
  std::vector<std::uint8_t> marks;
  std::vector<std::uint32_t> ids;
  std::vector<std::uint16_t> radius;
};

struct DecodedFrame {
  FrameHeader header;
  std::vector<DecodedBlock> blocks;  ///< in the order of the frame
};

/// Reads a frame, refusing whatever FRAMES.md refuses. Memory stays proportional to the bytes.
/// Errors: kMalformedData (with the byte offset), kUnsupportedFormat (another version), kTooLarge
Result<DecodedFrame> decode_frame(std::span<const std::byte> bytes, const FrameLimits& limits = {});

/// The positions of a block in model space, lane by lane.
std::vector<Vec3d> decode_positions(const FrameHeader& header, const DecodedBlock& block);
/// The unit normals of a block; empty where it has none.
std::vector<Vec3f> decode_normals(const DecodedBlock& block);

}  // namespace pointwright::protocol
