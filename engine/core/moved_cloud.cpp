#include "engine/core/moved_cloud.h"

#include "engine/core/parallel.h"

namespace pointwright {

Cloud moved_cloud(const Cloud& cloud, const Points& position, const Points& normal) {
  Cloud result = cloud;
  if (!result.exact_position.empty()) {
    parallel_for(cloud.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (position[i] == cloud.position[i]) continue;
        const Vec3d place = cloud.origin + position[i].cast<double>();
        result.exact_position[i] = {place.x(), place.y(), place.z()};
      }
    });
  }
  result.position = position;
  result.normal = normal;
  return result;
}

}  // namespace pointwright
