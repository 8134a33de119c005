// The encoder. Sizes and places of all block records follow from the layout alone, so every block is written
// straight to its place, by whichever thread takes it.
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "engine/core/parallel.h"
#include "protocol/frames/frame.h"
#include "protocol/frames/quantise.h"

namespace pointwright::protocol {
namespace {

/// Blocks that one thread takes at a time.
constexpr std::size_t kBlocksPerTask = 2;

constexpr std::size_t padded_to_word(std::size_t bytes) {
  return (bytes + 3) / 4 * 4;
}

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
  POINTWRIGHT_CHECK(!has(attributes, kFrameIds) || columns.ids.size() >= n, "ids do not fit the layout");
}

/// Buffers of one thread's blocks; a whole block of positions, chunks of everything else.
struct Scratch {
  explicit Scratch(std::size_t block_size) {
    for (auto& axis : position) axis.resize(padded_to_block(block_size));
  }
  std::array<std::vector<float>, 3> position;
  std::array<std::array<float, kQuantiseChunk>, 3> chunk;
  std::array<std::uint32_t, 2 * kQuantiseChunk> words;
};

constexpr std::array<float, kQuantiseChunk> kZeros{};

/// Calls write(first, count) for the chunks of `count` lanes.
template <typename Write>
void for_chunks(std::size_t count, const Write& write) {
  for (std::size_t first = 0; first < count; first += kQuantiseChunk) {
    write(first, std::min(kQuantiseChunk, count - first));
  }
}

std::byte* copy_words(const std::uint32_t* words, std::size_t count, std::byte* out) {
  std::memcpy(out, words, count * sizeof(std::uint32_t));
  return out + count * sizeof(std::uint32_t);
}

/// One block's record, written to its place.
class BlockEncoder {
 public:
  BlockEncoder(const FrameLayout& layout, const FrameColumns& columns, const FrameState& state,
               std::uint16_t attributes)
      : layout_(layout),
        columns_(columns),
        state_(state),
        attributes_(attributes),
        scratch_(layout.block_size()) {}

  /// Writes block_record_bytes() bytes; returns the box of the block.
  Box3f encode(std::uint32_t block, std::byte* out) {
    samples_ = layout_.block_samples(block);
    QuantiseAxis axes[3];
    const Box3f box = gather_positions(axes);
    store(out, block);
    store(out + 4, samples_.count);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      store(out + 8 + 4 * axis, axes[axis].minimum);
      store(out + 20 + 4 * axis, axes[axis].extent);
    }
    out = write_positions(axes, out + kBlockHeaderBytes);
    if (has(attributes_, kFrameNormal)) out = write_normals(out);
    if (has(attributes_, kFrameDetail)) out = write_detail(out);
    if (has(attributes_, kFrameColor)) out = write_column(columns_.color, out);
    if (has(attributes_, kFrameMarks)) out = write_column(columns_.marks, out);
    if (has(attributes_, kFrameIds)) write_column(columns_.ids, out);
    return box;
  }

 private:
  Box3f gather_positions(QuantiseAxis (&axes)[3]) {
    const std::array<const float*, 3> sources{columns_.position->x(), columns_.position->y(),
                                              columns_.position->z()};
    Box3f box;
    for (int axis = 0; axis < 3; ++axis) {
      auto& column = scratch_.position[static_cast<std::size_t>(axis)];
      gather_floats(sources[static_cast<std::size_t>(axis)] + samples_.begin, samples_.stride, samples_.count,
                    column.data());
      minimum_and_maximum(column.data(), samples_.count, box.min[axis], box.max[axis]);
      axes[axis] = quantise_axis(box.min[axis], box.max[axis]);
    }
    return box;
  }

  /// The chunk's values of a column, or zeros where it is empty.
  const float* chunk_of(std::span<const float> column, std::size_t first, std::size_t count,
                        std::size_t buffer) {
    if (column.empty()) return kZeros.data();
    gather_floats(column.data() + samples_.begin + first * samples_.stride, samples_.stride, count,
                  scratch_.chunk[buffer].data());
    return scratch_.chunk[buffer].data();
  }

  std::byte* write_positions(const QuantiseAxis (&axes)[3], std::byte* out) {
    const std::span<const float> t = has(attributes_, kFrameT) ? columns_.t : std::span<const float>{};
    for_chunks(samples_.count, [&](std::size_t first, std::size_t count) {
      const float* t_chunk = chunk_of(t, first, count, 0);
      quantise_positions(axes, &scratch_.position[0][first], &scratch_.position[1][first],
                         &scratch_.position[2][first], t_chunk, count, scratch_.words.data());
      out = copy_words(scratch_.words.data(), 2 * count, out);
    });
    return out;
  }

  std::byte* write_normals(std::byte* out) {
    const Points& normal = *columns_.normal;
    for_chunks(samples_.count, [&](std::size_t first, std::size_t count) {
      const float* x = chunk_of({normal.x(), normal.size()}, first, count, 0);
      const float* y = chunk_of({normal.y(), normal.size()}, first, count, 1);
      const float* z = chunk_of({normal.z(), normal.size()}, first, count, 2);
      quantise_normals(x, y, z, count, scratch_.words.data());
      out = copy_words(scratch_.words.data(), count, out);
    });
    return out;
  }

  std::byte* write_detail(std::byte* out) {
    for_chunks(samples_.count, [&](std::size_t first, std::size_t count) {
      quantise_detail(chunk_of(columns_.detail, first, count, 0), chunk_of(columns_.stretch, first, count, 1),
                      state_.detail_range, state_.stretch_range, count, scratch_.words.data());
      out = copy_words(scratch_.words.data(), count, out);
    });
    return out;
  }

  /// A column that goes out as it is, zero-padded to whole words.
  template <typename T>
  std::byte* write_column(std::span<const T> column, std::byte* out) {
    const T* source = column.data() + samples_.begin;
    for (std::size_t i = 0; i < samples_.count; ++i) store(out + i * sizeof(T), source[i * samples_.stride]);
    const std::size_t bytes = samples_.count * sizeof(T);
    std::fill(out + bytes, out + padded_to_word(bytes), std::byte{0});
    return out + padded_to_word(bytes);
  }

  const FrameLayout& layout_;
  const FrameColumns& columns_;
  const FrameState& state_;
  std::uint16_t attributes_;
  Scratch scratch_;
  SampleRange samples_;
};

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

/// Encodes the given blocks in the given order.
void encode_frame(FrameKind kind, const FrameLayout& layout, const FrameColumns& columns,
                  const FrameState& state, std::uint16_t attributes, std::span<const std::uint32_t> blocks,
                  FrameBytes& out) {
  check_columns(layout, columns, attributes);
  POINTWRIGHT_CHECK(state.revision <= kMaxSequence && state.sequence <= kMaxSequence,
                    "a number beyond 2^53 - 1");
  std::vector<std::size_t> offsets(blocks.size());
  std::vector<std::uint32_t> begins(blocks.size());
  std::size_t frame_bytes = kFrameHeaderBytes;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const SampleRange samples = layout.block_samples(blocks[i]);
    offsets[i] = frame_bytes;
    begins[i] = samples.begin;
    frame_bytes += block_record_bytes(samples.count, attributes);
  }
  POINTWRIGHT_CHECK(frame_bytes <= std::numeric_limits<std::uint32_t>::max(), "a frame beyond 4 GiB");
  out.resize(frame_bytes);

  // Blocks of several layers read the same cache lines: taken by place in the cloud, memory is read once.
  std::vector<std::uint32_t> jobs(blocks.size());
  std::iota(jobs.begin(), jobs.end(), 0U);
  std::sort(jobs.begin(), jobs.end(), [&](std::uint32_t a, std::uint32_t b) {
    return begins[a] != begins[b] ? begins[a] < begins[b] : a < b;
  });
  std::vector<Box3f> boxes(blocks.size());
  parallel_for(
      jobs.size(),
      [&](std::size_t begin, std::size_t end) {
        BlockEncoder encoder(layout, columns, state, attributes);
        for (std::size_t i = begin; i < end; ++i) {
          boxes[jobs[i]] = encoder.encode(blocks[jobs[i]], out.data() + offsets[jobs[i]]);
        }
      },
      kBlocksPerTask);

  FrameHeader header{.kind = kind,
                     .level = state.level,
                     .attributes = attributes,
                     .revision = state.revision,
                     .sequence = state.sequence,
                     .sample_count = layout.sample_count(),
                     .block_size = layout.block_size(),
                     .block_count = layout.block_count(),
                     .present_blocks = static_cast<std::uint32_t>(blocks.size()),
                     .origin = state.origin,
                     .detail_range = has(attributes, kFrameDetail) ? state.detail_range : 0.0F,
                     .stretch_range = has(attributes, kFrameDetail) ? state.stretch_range : 0.0F,
                     .bounds = {}};
  if (state.bounds) {
    header.bounds = *state.bounds;
  } else if (kind == FrameKind::kDelta) {
    header.bounds = surface_bounds(*columns.position);
  } else {
    Box3f whole;
    for (const Box3f& box : boxes) {
      whole.extend(box.min);
      whole.extend(box.max);
    }
    header.bounds = ball_of(whole);
  }
  write_header(header, frame_bytes, out.data());
}

}  // namespace

std::size_t block_record_bytes(std::uint32_t count, std::uint16_t attributes) {
  std::size_t bytes = kBlockHeaderBytes + std::size_t{8} * count;
  for (const FrameAttribute attribute : {kFrameNormal, kFrameDetail, kFrameColor, kFrameIds}) {
    if (has(attributes, attribute)) bytes += std::size_t{4} * count;
  }
  if (has(attributes, kFrameMarks)) bytes += padded_to_word(count);
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
  encode_frame(FrameKind::kDelta, layout, columns, state, attributes, blocks, out);
}

SurfaceBounds surface_bounds(const Points& position) {
  std::vector<Box3f> boxes((position.size() + kParallelBlock - 1) / kParallelBlock);
  const std::array<const float*, 3> sources{position.x(), position.y(), position.z()};
  parallel_for(position.size(), [&](std::size_t begin, std::size_t end) {
    std::array<float, kParallelBlock> values;
    Box3f& box = boxes[begin / kParallelBlock];
    for (int axis = 0; axis < 3; ++axis) {
      gather_floats(sources[static_cast<std::size_t>(axis)] + begin, 1, end - begin, values.data());
      minimum_and_maximum(values.data(), end - begin, box.min[axis], box.max[axis]);
    }
  });
  Box3f whole;
  for (const Box3f& box : boxes) {
    whole.extend(box.min);
    whole.extend(box.max);
  }
  return ball_of(whole);
}

}  // namespace pointwright::protocol
