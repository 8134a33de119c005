#include "engine/resampling/neighborhood_update.h"

#include <algorithm>
#include <limits>

#include "engine/core/parallel.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kSamplesOfRange = 512;

struct Near {
  float distance = 0.0F;  // squared
  std::uint32_t sample = 0;
  friend bool operator<(const Near& a, const Near& b) {
    return a.distance < b.distance || (a.distance == b.distance && a.sample < b.sample);
  }
  friend bool operator==(const Near&, const Near&) = default;
};

class Update {
 public:
  Update(const NeighborGraph& before, const Inserted& inserted, const Points& position)
      : before_(before), inserted_(inserted), position_(position), split_of_(before.count, kNone) {
    const auto& splits = inserted.splits.splits;
    for (std::size_t s = 0; s < splits.size(); ++s)
      split_of_[splits[s].sample] = static_cast<std::uint32_t>(s);
  }

  [[nodiscard]] bool touches(std::size_t i) const {
    if (split_of_[i] != kNone) return true;
    for (std::uint32_t j = 0; j < before_.k; ++j)
      if (split_of_[before_.index(i, j)] != kNone) return true;
    return false;
  }

  // The row of sample i, `old` the one of before that its candidates come from.
  void set_row(std::size_t i, std::uint32_t old, std::vector<Near>& found, NeighborGraph& graph) const {
    found.clear();
    const Vec3f here = position_[i];
    const auto consider = [&](std::uint32_t j) {
      const float distance = (position_[j] - here).squaredNorm();
      if (distance > 0.0F) found.push_back({.distance = distance, .sample = j});  // neither itself nor a copy
    };
    const auto consider_family = [&](std::uint32_t sample) {
      consider(sample);
      if (split_of_[sample] == kNone) return;
      const Split& split = inserted_.splits.splits[split_of_[sample]];
      for (std::uint32_t c = 0; c < split.children(); ++c)
        consider(static_cast<std::uint32_t>(before_.count) + split.first_child + c);
    };
    consider_family(old);
    for (std::uint32_t j = 0; j < before_.k; ++j) consider_family(before_.index(old, j));
    if (split_of_[old] != kNone) {
      const RestPatch& patch = inserted_.patches.of(old);
      for (std::uint32_t r = 0; r < patch.ring_size; ++r) consider_family(patch.ring[r]);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      // All at one place: whoever was near before.
      graph.index(i, j) =
          found.empty() ? before_.index(old, j) : found[std::min<std::size_t>(j, found.size() - 1)].sample;
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
        std::vector<Near> found;
        for (std::size_t i = begin; i < end; ++i) {
          if (i >= before.count)
            update.set_row(i, inserted.split(i - before.count).sample, found, graph);
          else if (update.touches(i))
            update.set_row(i, static_cast<std::uint32_t>(i), found, graph);
        }
      },
      kSamplesOfRange);
  return graph;
}

}  // namespace pointwright
