#include "engine/transfer/anchors.h"

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Two sheets are rarely so close that the nearest few are all of the other one.
constexpr std::size_t kFirstLook = 4;
constexpr std::size_t kSecondLook = 16;

}  // namespace

std::vector<std::uint32_t> AnchorIndex::anchors_of(const Points& position, const Points& normal,
                                                   const ExecutionContext& context) const {
  POINTWRIGHT_CHECK(!preview_.position.empty(), "a preview has samples");
  POINTWRIGHT_CHECK(normal.empty() || normal.size() == position.size(), "normals of the same samples");
  std::vector<std::uint32_t> anchors(position.size());
  parallel_for(
      position.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<Neighbor> found;
        for (std::size_t i = begin; i < end; ++i) {
          if (normal.empty()) {  // in coherent order the last one's is near
            anchors[i] = tree_.nearest_from(position[i], i > begin ? anchors[i - 1] : 0);
            continue;
          }
          tree_.nearest(position[i], kFirstLook, found);
          anchors[i] = found.front().index;
          const auto same_side = [&, side = normal[i]] {
            for (const Neighbor& neighbor : found) {
              if (preview_.normal[neighbor.index].dot(side) <= 0.0F) continue;
              anchors[i] = neighbor.index;
              return true;
            }
            return false;
          };
          if (same_side()) continue;
          tree_.nearest(position[i], kSecondLook, found);
          same_side();
        }
      },
      kParallelBlock, &context);
  return anchors;
}

}  // namespace pointwright
