#include "protocol/frames/layout.h"

#include <algorithm>
#include <bit>

#include "engine/core/check.h"

namespace pointwright::protocol {
namespace {

constexpr std::uint32_t kCoarsestStride = std::uint32_t{1} << (kLayerCount - 1);

/// The blocks first .. first + count - 1 in bit-reversed order, appended to `order`.
void append_bit_reversed(std::uint32_t first, std::uint32_t count, std::vector<std::uint32_t>& order) {
  if (count == 0) return;
  const std::uint32_t rounded = std::bit_ceil(count);
  std::uint32_t reversed = 0;
  for (std::uint32_t i = 0; i < rounded; ++i) {
    if (reversed < count) order.push_back(first + reversed);
    // Adds one at the top bit and lets the carry run downwards.
    std::uint32_t bit = rounded >> 1;
    while (bit != 0 && (reversed & bit) != 0) {
      reversed ^= bit;
      bit >>= 1;
    }
    reversed ^= bit;
  }
}

}  // namespace

FrameLayout::FrameLayout(std::uint32_t sample_count, std::uint32_t block_size)
    : sample_count_(sample_count), block_size_(block_size) {
  POINTWRIGHT_CHECK(block_size >= 1 && block_size <= kMaxBlockSize, "block size out of range");
  POINTWRIGHT_CHECK(sample_count <= (std::uint32_t{1} << 31), "more samples than a layout can number");
  for (std::uint32_t layer = 0; layer < kLayerCount; ++layer) {
    const std::uint32_t samples = layer_samples(layer).count;
    const std::uint32_t blocks = samples / block_size + (samples % block_size != 0 ? 1 : 0);
    first_block_[layer + 1] = first_block_[layer] + blocks;
  }
  key_order_.reserve(block_count());
  for (std::uint32_t layer = 0; layer < kLayerCount; ++layer) {
    append_bit_reversed(first_block_[layer], first_block_[layer + 1] - first_block_[layer], key_order_);
  }
}

SampleRange FrameLayout::layer_samples(std::uint32_t layer) const {
  const std::uint32_t stride = layer == 0 ? kCoarsestStride : (2 * kCoarsestStride) >> layer;
  const std::uint32_t begin = layer == 0 ? 0 : stride / 2;
  const std::uint32_t count = sample_count_ > begin ? (sample_count_ - begin - 1) / stride + 1 : 0;
  return {.begin = begin, .stride = stride, .count = count};
}

std::uint32_t FrameLayout::layer_of_block(std::uint32_t block) const {
  POINTWRIGHT_CHECK(block < block_count(), "no such block");
  const auto next = std::upper_bound(first_block_.begin(), first_block_.end(), block);
  return static_cast<std::uint32_t>(next - first_block_.begin()) - 1;
}

SampleRange FrameLayout::block_samples(std::uint32_t block) const {
  const std::uint32_t layer = layer_of_block(block);
  const SampleRange samples = layer_samples(layer);
  const std::uint32_t offset = (block - first_block_[layer]) * block_size_;
  return {.begin = samples.begin + offset * samples.stride,
          .stride = samples.stride,
          .count = std::min(block_size_, samples.count - offset)};
}

std::uint64_t FrameLayout::slot_of_sample(std::uint32_t sample) const {
  POINTWRIGHT_CHECK(sample < sample_count_, "no such sample");
  const auto zeros = static_cast<std::uint32_t>(std::countr_zero(sample | kCoarsestStride));
  const std::uint32_t layer = kLayerCount - 1 - zeros;
  // The multiples of 64 fill layer 0; elsewhere odd multiples of the layer's half stride.
  const bool coarsest = sample % kCoarsestStride == 0;
  const std::uint32_t index = coarsest ? sample / kCoarsestStride : sample >> (zeros + 1);
  return std::uint64_t{first_block_[coarsest ? 0 : layer]} * block_size_ + index;
}

std::uint32_t FrameLayout::block_of_sample(std::uint32_t sample) const {
  return static_cast<std::uint32_t>(slot_of_sample(sample) / block_size_);
}

std::uint32_t FrameLayout::sample_of_slot(std::uint64_t slot) const {
  POINTWRIGHT_CHECK(slot < slot_count(), "no such slot");
  const SampleRange samples = block_samples(static_cast<std::uint32_t>(slot / block_size_));
  const auto lane = static_cast<std::uint32_t>(slot % block_size_);
  return lane < samples.count ? samples.begin + lane * samples.stride : sample_count_;
}

}  // namespace pointwright::protocol
