#include "protocol/frames/layout.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <set>

#include "engine/core/check.h"

using namespace pointwright::protocol;

TEST_CASE("every sample has exactly one slot and every filled slot one sample") {
  for (const std::uint32_t block_size : {1U, 3U, 16U, 4096U, kMaxBlockSize}) {
    for (const std::uint32_t count : {0U, 1U, 2U, 63U, 64U, 65U, 127U, 1000U, 9001U}) {
      const FrameLayout layout(count, block_size);
      std::set<std::uint64_t> slots;
      for (std::uint32_t sample = 0; sample < count; ++sample) {
        const std::uint64_t slot = layout.slot_of_sample(sample);
        REQUIRE(slot < layout.slot_count());
        REQUIRE(layout.sample_of_slot(slot) == sample);
        REQUIRE(layout.block_of_sample(sample) == slot / block_size);
        slots.insert(slot);
      }
      REQUIRE(slots.size() == count);
      if (layout.slot_count() > 100'000) continue;
      for (std::uint64_t slot = 0; slot < layout.slot_count(); ++slot) {
        REQUIRE((layout.sample_of_slot(slot) == count) == !slots.contains(slot));
      }
    }
  }
}

TEST_CASE("layers hold the multiples of 64, then the odd multiples of 32, 16, … 1") {
  const FrameLayout layout(10'000, 128);
  for (std::uint32_t layer = 0; layer < kLayerCount; ++layer) {
    const std::uint32_t step = layer == 0 ? 64 : 64U >> layer;
    std::vector<std::uint32_t> expected;
    for (std::uint32_t sample = 0; sample < 10'000; ++sample) {
      if (layer == 0 ? sample % 64 == 0 : sample % step == 0 && sample / step % 2 == 1)
        expected.push_back(sample);
    }
    std::vector<std::uint32_t> actual;
    for (std::uint32_t block = layout.first_block(layer); block < layout.first_block(layer + 1); ++block) {
      CHECK(layout.layer_of_block(block) == layer);
      const SampleRange samples = layout.block_samples(block);
      for (std::uint32_t lane = 0; lane < samples.count; ++lane) {
        actual.push_back(samples.begin + lane * samples.stride);
      }
      // Only the last block of a layer may be partly filled.
      if (block + 1 < layout.first_block(layer + 1)) CHECK(samples.count == 128);
    }
    CHECK(actual == expected);
    CHECK(layout.layer_samples(layer).count == expected.size());
  }
}

TEST_CASE("a block spans few neighbouring samples in the finest layer") {
  const FrameLayout layout(1'000'000);
  const SampleRange samples = layout.block_samples(layout.first_block(6) + 3);
  CHECK(samples.stride * samples.count == 2 * layout.block_size());
}

TEST_CASE(
    "a key frame sends each block once, layer by layer, every prefix of a layer spread over the shape") {
  for (const std::uint32_t count : {0U, 1U, 150U, 5000U, 50'000U}) {
    const FrameLayout layout(count, 16);
    std::vector<std::uint32_t> sorted = layout.key_order();
    REQUIRE(sorted.size() == layout.block_count());
    CHECK(std::is_sorted(sorted.begin(), sorted.end(), [&](std::uint32_t a, std::uint32_t b) {
      return layout.layer_of_block(a) < layout.layer_of_block(b);
    }));
    std::sort(sorted.begin(), sorted.end());
    for (std::uint32_t block = 0; block < layout.block_count(); ++block) REQUIRE(sorted[block] == block);
  }
  // Eight blocks in a layer: the order of the textbook.
  const FrameLayout layout(64 * 16 * 8, 16);
  const std::vector<std::uint32_t> first_layer(layout.key_order().begin(), layout.key_order().begin() + 8);
  CHECK(first_layer == std::vector<std::uint32_t>{0, 4, 2, 6, 1, 5, 3, 7});
}

TEST_CASE("a layout refuses what it cannot number") {
  CHECK_THROWS_AS(FrameLayout(10, 0), pointwright::LogicError);
  CHECK_THROWS_AS(FrameLayout(10, kMaxBlockSize + 1), pointwright::LogicError);
  const FrameLayout layout(10, 4);
  CHECK_THROWS_AS((void)layout.slot_of_sample(10), pointwright::LogicError);
  CHECK_THROWS_AS((void)layout.sample_of_slot(layout.slot_count()), pointwright::LogicError);
  CHECK_THROWS_AS((void)layout.block_samples(layout.block_count()), pointwright::LogicError);
}
