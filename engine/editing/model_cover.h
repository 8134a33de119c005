#pragma once
// Which samples of a surface the shape of another model holds, for many samples at once.

#include <cstdint>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/model_shape.h"
#include "engine/editing/region.h"

namespace pointwright {

/// The shape beside one surface: the moved samples within reach of it, with fast distances. Like all regions
/// it reckons in float32 relative to the surface's origin.
class ModelCover {
 public:
  /// `position`: the samples of the surface, relative to `origin`
  /// Cost:    O(N + M), parallel but for sums
  /// Cancels: between blocks; it then covers nothing
  ModelCover(const ModelShape& shape, const Points& position, const Vec3d& origin,
             const ExecutionContext* context);

  /// Writes 1 to covered[0, end - begin) for the samples of the surface that the shape holds, 0 for others.
  /// Pre:  begin a multiple of kSimdBlock
  /// Cost: O(log M) a sample, less far from the model and inside the shape
  void cover(const Points& position, std::size_t begin, std::size_t end, std::uint8_t* covered,
             RegionDistances& scratch) const;

 private:
  Region region_;
};

}  // namespace pointwright
