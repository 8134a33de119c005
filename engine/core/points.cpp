#include "engine/core/points.h"

namespace pointwright {

Box3f bounds_of(const Points& points) {
  Box3f box;
  for (std::size_t i = 0; i < points.size(); ++i) box.extend(points[i]);
  return box;
}

}  // namespace pointwright
