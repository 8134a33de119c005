#include "engine/resampling/neighborhood_update.h"

#include <algorithm>
#include <limits>

#include "engine/core/parallel.h"
#include "engine/resampling/nearest_few.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kNotSplit = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kSamplesOfRange = 512;
constexpr std::uint32_t kMostNeighbors = 32;  // of a hierarchy's graph

class Update {
 public:
  Update(const NeighborGraph& before, const Inserted& inserted, const Points& position)
      : before_(before), inserted_(inserted), position_(position), split_of_(before.count, kNotSplit) {
    const auto& splits = inserted.splits.splits;
    for (std::size_t s = 0; s < splits.size(); ++s)
      split_of_[splits[s].sample] = static_cast<std::uint32_t>(s);
  }

  [[nodiscard]] bool touches(std::size_t i) const {
    if (split_of_[i] != kNotSplit) return true;
    for (std::uint32_t j = 0; j < before_.k; ++j)
      if (split_of_[before_.index(i, j)] != kNotSplit) return true;
    return false;
  }

  // The row of sample i, `old` the one of before that its candidates come from.
  void set_row(std::size_t i, std::uint32_t old, NeighborGraph& graph) const {
    NearestFew<kMostNeighbors> nearest(graph.k);
    const float* const x = position_.x();
    const float* const y = position_.y();
    const float* const z = position_.z();
    const Vec3f here = position_[i];
    const auto consider = [&](std::uint32_t j) {
      const float dx = x[j] - here.x();
      const float dy = y[j] - here.y();
      const float dz = z[j] - here.z();
      const float distance = dx * dx + dy * dy + dz * dz;
      if (distance > 0.0F) nearest.consider(distance, j);  // neither itself nor a copy
    };
    const auto consider_family = [&](std::uint32_t sample) {
      consider(sample);
      if (split_of_[sample] == kNotSplit) return;
      const Split& split = inserted_.splits.splits[split_of_[sample]];
      const auto first = static_cast<std::uint32_t>(before_.count) + split.first_child;
      for (std::uint32_t c = first; c < first + split.children(); ++c) consider(c);
    };
    consider_family(old);
    if (split_of_[old] != kNotSplit && before_.k <= kRingSize) {
      const RestPatch& patch = inserted_.patches.of(old);
      for (std::uint32_t r = 0; r < patch.ring_size; ++r) consider_family(patch.ring[r]);
    } else {
      for (std::uint32_t j = 0; j < before_.k; ++j) consider_family(before_.index(old, j));
    }
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      // All at one place: whoever was near before.
      graph.index(i, j) =
          nearest.count() == 0 ? before_.index(old, j) : nearest[std::min(j, nearest.count() - 1)];
    }
  }

 private:
  const NeighborGraph& before_;
  const Inserted& inserted_;
  const Points& position_;
  std::vector<std::uint32_t> split_of_;
};

}  // namespace

NeighborGraph updated_neighborhoods(const NeighborGraph& before, const Inserted& inserted,
                                    const Points& position) {
  const Update update(before, inserted, position);
  NeighborGraph graph = before;
  graph.count += inserted.count();
  graph.lanes.resize(padded_to_block(graph.count) * graph.k, 0);
  parallel_for(
      graph.count,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          if (i >= before.count)
            update.set_row(i, inserted.split(i - before.count).sample, graph);
          else if (update.touches(i))
            update.set_row(i, static_cast<std::uint32_t>(i), graph);
        }
      },
      kSamplesOfRange);
  return graph;
}

}  // namespace pointwright
