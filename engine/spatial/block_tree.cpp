#include "engine/spatial/block_tree.h"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/spatial/block_tree_kernels.h"

namespace pointwright {
namespace {

constexpr float kFar = std::numeric_limits<float>::max();

// The box of `low` and `high` columns over [begin, end).
void cover(const std::array<const float*, 3>& low, const std::array<const float*, 3>& high, std::size_t begin,
           std::size_t end, std::array<float*, 6>& box, std::size_t at) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    float least = kFar;
    float greatest = -kFar;
    for (std::size_t i = begin; i < end; ++i) {
      least = std::min(least, low[axis][i]);
      greatest = std::max(greatest, high[axis][i]);
    }
    box[axis][at] = least;
    box[axis + 3][at] = greatest;
  }
}

}  // namespace

BlockTree::BlockTree(const Points& points) : points_(&points) {
  // How many boxes each level has, first of all: the columns must not move once levels point at them.
  std::vector<std::size_t> counts;
  for (std::size_t n = points.size(); counts.empty() || n > kSimdBlock;) {
    n = (n + kSimdBlock - 1) / kSimdBlock;
    counts.push_back(n);
  }
  std::size_t total = 0;
  for (const std::size_t n : counts) total += 6 * padded_to_block(n);
  boxes_.resize(total);

  std::array<const float*, 3> low{points.x(), points.y(), points.z()};
  std::array<const float*, 3> high = low;
  std::size_t below = points.size();
  float* column = boxes_.data();
  for (const std::size_t n : counts) {
    std::array<float*, 6> box{};
    for (float*& side : box) {
      side = column;
      column += padded_to_block(n);
    }
    parallel_for(padded_to_block(n), [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        cover(low, high, std::min(below, b * kSimdBlock), std::min(below, (b + 1) * kSimdBlock), box, b);
      }
    });
    low = {box[0], box[1], box[2]};
    high = {box[3], box[4], box[5]};
    levels_.push_back({{low[0], low[1], low[2]}, {high[0], high[1], high[2]}});
    below = n;
  }
}

BlockTree::~BlockTree() = default;
BlockTree::BlockTree(BlockTree&&) noexcept = default;
BlockTree& BlockTree::operator=(BlockTree&&) noexcept = default;

void BlockTree::nearest_of_range(std::size_t begin, std::size_t end, std::uint32_t length, float bound_sq,
                                 std::vector<std::int32_t>& rows) const {
  POINTWRIGHT_CHECK(begin % kSimdBlock == 0 && end <= size(), "the range starts at a whole block");
  POINTWRIGHT_CHECK(length > 0, "lists have at least one slot");
  end = padded_to_block(end);
  rows.resize((end - begin) * length);
  constexpr std::size_t kAlignment = 64;
  std::size_t space = 2 * kSimdBlock * length * sizeof(float) + kAlignment;
  std::vector<float> scratch(space / sizeof(float));
  void* aligned = scratch.data();
  aligned = std::align(kAlignment, space - kAlignment, aligned, space);
  const NearestArgs args{.tree = {.x = points_->x(),
                                  .y = points_->y(),
                                  .z = points_->z(),
                                  .count = points_->size(),
                                  .levels = levels_.data(),
                                  .level_count = static_cast<std::uint32_t>(levels_.size())},
                         .length = length,
                         .bound_sq = std::min(bound_sq, kFar)};
  POINTWRIGHT_KERNEL(nearest_of_all_kernel)(args, begin, end, rows.data(), static_cast<float*>(aligned));
}

}  // namespace pointwright
