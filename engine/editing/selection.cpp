#include "engine/editing/selection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/editing/region.h"

namespace pointwright {
namespace {

// The members as balls without extent: exact nearest distances, several times faster than a kd-tree's.
Region region_of(const Points& position, const SampleMask& members) {
  const auto count = static_cast<std::size_t>(std::count(members.begin(), members.end(), std::uint8_t{1}));
  Points centers(count);
  std::size_t next = 0;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i] != 0) centers.set(next++, position[i]);
  }
  return Region(centers, std::vector<float>(count, 0.0F), BallOrder::kCoherent);
}

}  // namespace

SampleMask near_members(const Points& position, const SampleMask& members, double distance,
                        const ExecutionContext* context) {
  POINTWRIGHT_CHECK(members.size() == position.size(), "one entry per sample");
  SampleMask near(position.size(), 0);
  const Region region = region_of(position, members);
  if (region.empty()) return near;
  // Nobody needs to know how far it is beyond the distance asked for.
  const auto reach = static_cast<float>(distance);
  const float limit = std::max(std::nextafter(reach, std::numeric_limits<float>::infinity()),
                               std::numeric_limits<float>::min());
  parallel_for(
      position.size(),
      [&](std::size_t begin, std::size_t end) {
        RegionDistances found;
        const std::vector<float> limits(padded_to_block(end - begin), limit);
        region.distances(position, begin, end, found, &limits);
        for (std::size_t i = begin; i < end; ++i)
          near[i] = members[i] == 0 && found.distance[i - begin] <= reach ? 1 : 0;
      },
      kParallelBlock, context);
  return near;
}

}  // namespace pointwright
