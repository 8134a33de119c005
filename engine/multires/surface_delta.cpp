#include "engine/multires/surface_delta.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

using Bits = std::array<std::uint32_t, kSimdBlock>;

// Blocks that one word of flags stands for: a parallel range works on words of its own.
constexpr std::size_t kBlocksOfWord = 64;
constexpr std::size_t kWordSamples = kBlocksOfWord * kSimdBlock;

// A column as it stands in memory. Points are padded to whole blocks, detail is not.
template <typename Float>
struct ColumnView {
  Float* data = nullptr;
  std::size_t size = 0;
};

template <typename Float>
Bits load(const ColumnView<Float>& column, std::size_t begin) {
  Bits bits{};
  std::memcpy(bits.data(), column.data + begin, sizeof(float) * std::min(kSimdBlock, column.size - begin));
  return bits;
}

void store(const ColumnView<float>& column, std::size_t begin, const Bits& bits) {
  std::memcpy(column.data + begin, bits.data(), sizeof(float) * std::min(kSimdBlock, column.size - begin));
}

// A well-mixed odd number for each place; the steps of SplitMix64.
constexpr std::uint64_t odd_number(std::uint64_t place) {
  std::uint64_t x = (place + 1) * 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return (x ^ (x >> 31U)) | 1U;
}

constexpr std::array<std::uint64_t, kSimdBlock> kLaneFactors = [] {
  std::array<std::uint64_t, kSimdBlock> factors{};
  for (std::size_t i = 0; i < kSimdBlock; ++i) factors[i] = odd_number(i);
  return factors;
}();

// Sums over blocks wrap around and so come in any order. Where one entry changes, so does the sum: factors
// are odd.
std::uint64_t sum_of(const Bits& bits, std::size_t column, std::size_t block) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < kSimdBlock; ++i) sum += bits[i] * kLaneFactors[i];
  return sum * odd_number((std::uint64_t{column} << 40U) + block);
}

// The columns of a surface in one fixed order, as far as `count` samples go.
template <typename Float, typename Surface>
std::vector<ColumnView<Float>> columns_of(Surface& surface, std::size_t count) {
  std::vector<ColumnView<Float>> columns;
  columns.reserve(surface.levels.size() * 6 + surface.detail.size());
  for (auto& level : surface.levels) {
    for (auto* points : {&level.position, &level.normal}) {
      POINTWRIGHT_CHECK(points->size() >= count, "levels of the same samples");
      const std::size_t size = padded_to_block(count);
      for (Float* data : {points->x(), points->y(), points->z()}) columns.push_back({data, size});
    }
  }
  for (auto& detail : surface.detail) {
    POINTWRIGHT_CHECK(detail.size() >= count, "one detail per sample");
    columns.push_back({detail.data(), count});
  }
  return columns;
}

void resize(MultiresSurface& surface, std::size_t count) {
  for (Level& level : surface.levels) {
    level.position.resize(count);
    level.normal.resize(count);
  }
  for (std::vector<float>& detail : surface.detail) detail.resize(count);
}

// Calls body(block) for the blocks whose bits are set.
template <typename Body>
void for_each_bit(std::uint64_t word, std::size_t first_block, const Body& body) {
  for (; word != 0; word &= word - 1) body(first_block + static_cast<std::size_t>(std::countr_zero(word)));
}

}  // namespace

struct SurfaceDelta::Pair {
  ColumnView<const float> a;
  ColumnView<const float> b;
};

SurfaceDelta::SurfaceDelta(const MultiresSurface& a, const MultiresSurface& b)
    : least_(std::min(a.sample_count(), b.sample_count())),
      most_(std::max(a.sample_count(), b.sample_count())) {
  // The padding of the smaller one is compared with what the larger one has there.
  const auto of_a = columns_of<const float>(a, least_);
  const auto of_b = columns_of<const float>(b, least_);
  POINTWRIGHT_CHECK(of_a.size() == of_b.size() && a.levels.size() == b.levels.size(),
                    "surfaces with the same levels and bands");
  columns_.resize(of_a.size());
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    sums_ = sums_ + compare({of_a[c], of_b[c]}, c, columns_[c]);
    blocks_ += columns_[c].bits.size() / kSimdBlock;
  }
  if (most_ == least_) return;
  const MultiresSurface& larger = a.sample_count() == most_ ? a : b;
  for (const ColumnView<const float>& column : columns_of<const float>(larger, most_))
    tail_.emplace_back(column.data + least_, column.data + column.size);
}

SurfaceDelta::Sums SurfaceDelta::compare(const Pair& pair, std::size_t number, Column& column) {
  const std::size_t size = pair.a.size;
  column.changed.assign((size + kWordSamples - 1) / kWordSamples, 0);
  const auto sums = parallel_sum<Sums>(
      size, Sums{},
      [&](std::size_t begin, std::size_t end) {
        Sums sum;
        std::uint64_t word = 0;
        for (std::size_t i = begin; i < end; i += kSimdBlock) {
          const Bits of_a = load(pair.a, i);
          const Bits of_b = load(pair.b, i);
          if (of_a == of_b) continue;
          word |= std::uint64_t{1} << ((i - begin) / kSimdBlock);
          sum = sum + Sums{sum_of(of_a, number, i / kSimdBlock), sum_of(of_b, number, i / kSimdBlock)};
        }
        column.changed[begin / kWordSamples] = word;
        return sum;
      },
      kWordSamples);
  std::uint32_t total = 0;
  column.first.reserve(column.changed.size());
  for (const std::uint64_t word : column.changed) {
    column.first.push_back(total);
    total += static_cast<std::uint32_t>(std::popcount(word));
  }
  if (total == 0) {
    column = {};
    return sums;
  }
  column.bits.resize(std::size_t{total} * kSimdBlock);
  parallel_for(
      size,
      [&](std::size_t begin, std::size_t) {
        const std::size_t w = begin / kWordSamples;
        std::uint32_t* out = column.bits.data() + std::size_t{column.first[w]} * kSimdBlock;
        for_each_bit(column.changed[w], w * kBlocksOfWord, [&](std::size_t block) {
          const Bits of_a = load(pair.a, block * kSimdBlock);
          const Bits of_b = load(pair.b, block * kSimdBlock);
          for (std::size_t i = 0; i < kSimdBlock; ++i) *out++ = of_a[i] ^ of_b[i];
        });
      },
      kWordSamples);
  return sums;
}

// Not parallel: what is appended is little beside what a history copies, or its edit took far longer.
void SurfaceDelta::append_tail(MultiresSurface& surface) const {
  resize(surface, most_);
  const auto views = columns_of<float>(surface, most_);
  for (std::size_t c = 0; c < views.size(); ++c)
    std::copy(tail_[c].begin(), tail_[c].end(), views[c].data + least_);
}

void SurfaceDelta::apply(MultiresSurface& surface) const {
  const std::size_t count = surface.sample_count();
  POINTWRIGHT_CHECK(count == least_ || count == most_, "a surface with the samples of the delta");
  const bool appends = most_ > least_ && count == least_;
  if (count > least_) resize(surface, least_);
  const auto views = columns_of<float>(surface, least_);
  POINTWRIGHT_CHECK(views.size() == columns_.size(), "a surface with the levels of the delta");
  std::uint64_t before = 0;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const Column& column = columns_[c];
    if (column.bits.empty()) continue;
    const ColumnView<float>& view = views[c];
    POINTWRIGHT_CHECK(column.changed.size() == (view.size + kWordSamples - 1) / kWordSamples,
                      "a surface with the samples of the delta");
    before += parallel_sum<std::uint64_t>(
        view.size, 0,
        [&](std::size_t begin, std::size_t) {
          const std::size_t w = begin / kWordSamples;
          const std::uint32_t* in = column.bits.data() + std::size_t{column.first[w]} * kSimdBlock;
          std::uint64_t sum = 0;
          for_each_bit(column.changed[w], w * kBlocksOfWord, [&](std::size_t block) {
            Bits bits = load(view, block * kSimdBlock);
            sum += sum_of(bits, c, block);
            for (std::uint32_t& each : bits) each ^= *in++;
            store(view, block * kSimdBlock, bits);
          });
          return sum;
        },
        kWordSamples);
  }
  POINTWRIGHT_CHECK(before == sums_.a || before == sums_.b, "one of the two surfaces of the delta");
  if (appends) append_tail(surface);
}

std::uint64_t SurfaceDelta::memory() const {
  std::uint64_t bytes = columns_.capacity() * sizeof(Column) + tail_.capacity() * sizeof(std::vector<float>);
  for (const std::vector<float>& column : tail_) bytes += column.capacity() * sizeof(float);
  for (const Column& column : columns_) {
    bytes += column.changed.capacity() * sizeof(std::uint64_t);
    bytes += (column.first.capacity() + column.bits.capacity()) * sizeof(std::uint32_t);
  }
  return bytes;
}

}  // namespace pointwright
