#pragma once
// Which slot of a frame holds which sample: the progressive layers and blocks of FRAMES.md.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace pointwright::protocol {

/// Layers that refine each other: layer 0 holds every 64th sample, the last one every odd sample.
inline constexpr std::uint32_t kLayerCount = 7;
inline constexpr std::uint32_t kDefaultBlockSize = 4096;
inline constexpr std::uint32_t kMaxBlockSize = 65536;

/// The samples of one block or layer: begin, begin + stride, … (`count` of them), in coherent order.
struct SampleRange {
  std::uint32_t begin = 0;
  std::uint32_t stride = 1;
  std::uint32_t count = 0;
  friend bool operator==(const SampleRange&, const SampleRange&) = default;
};

/// The mapping between samples (indices into the coherent order) and slots (block * block_size + lane).
/// Immutable once built; cheap to build and to copy; every method is thread-safe.
class FrameLayout {
 public:
  FrameLayout() : FrameLayout(0) {}
  /// Pre:  1 <= block_size <= kMaxBlockSize; sample_count <= 2^31
  /// Cost: O(blocks)
  explicit FrameLayout(std::uint32_t sample_count, std::uint32_t block_size = kDefaultBlockSize);

  [[nodiscard]] std::uint32_t sample_count() const { return sample_count_; }
  [[nodiscard]] std::uint32_t block_size() const { return block_size_; }
  [[nodiscard]] std::uint32_t block_count() const { return first_block_[kLayerCount]; }
  /// Slots of the whole cloud: block_count * block_size. Up to block_size - 1 per layer of them stay empty.
  [[nodiscard]] std::uint64_t slot_count() const { return std::uint64_t{block_count()} * block_size_; }

  /// The samples of a layer. Pre: layer < kLayerCount.
  [[nodiscard]] SampleRange layer_samples(std::uint32_t layer) const;
  /// The first block of a layer; of kLayerCount: one past the last block. Pre: layer <= kLayerCount.
  [[nodiscard]] std::uint32_t first_block(std::uint32_t layer) const { return first_block_[layer]; }
  /// The layer that a block belongs to. Pre: block < block_count().
  [[nodiscard]] std::uint32_t layer_of_block(std::uint32_t block) const;
  /// The samples in a block's lanes 0..count-1. Pre: block < block_count().
  [[nodiscard]] SampleRange block_samples(std::uint32_t block) const;

  /// Pre: sample < sample_count().
  [[nodiscard]] std::uint32_t block_of_sample(std::uint32_t sample) const;
  [[nodiscard]] std::uint64_t slot_of_sample(std::uint32_t sample) const;
  /// The sample in a slot; sample_count() for the lanes that hold nothing. Pre: slot < slot_count().
  [[nodiscard]] std::uint32_t sample_of_slot(std::uint64_t slot) const;

  /// All blocks in the order of a key frame: layers in order, bit-reversed inside a layer, so that every
  /// prefix covers the whole shape.
  [[nodiscard]] const std::vector<std::uint32_t>& key_order() const { return key_order_; }

  friend bool operator==(const FrameLayout& a, const FrameLayout& b) {
    return a.sample_count_ == b.sample_count_ && a.block_size_ == b.block_size_;
  }

 private:
  std::uint32_t sample_count_ = 0;
  std::uint32_t block_size_ = kDefaultBlockSize;
  std::array<std::uint32_t, kLayerCount + 1> first_block_{};
  std::vector<std::uint32_t> key_order_;
};

}  // namespace pointwright::protocol
