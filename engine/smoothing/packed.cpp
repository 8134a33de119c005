#include "engine/smoothing/packed.h"

#include "engine/core/parallel.h"

namespace pointwright {

Packed::Packed(const Points& points) : Packed(points.size()) {
  parallel_for(count_, [&](std::size_t begin, std::size_t end) {
    const float* x = points.x();
    const float* y = points.y();
    const float* z = points.z();
    Float4* to = values_.data();
    for (std::size_t i = begin; i < end; ++i) to[i] = Float4{x[i], y[i], z[i], 0.0F};
  });
}

Points Packed::unpacked() const {
  Points points(count_);
  parallel_for(count_, [&](std::size_t begin, std::size_t end) {
    const Float4* from = values_.data();
    float* x = points.x();
    float* y = points.y();
    float* z = points.z();
    for (std::size_t i = begin; i < end; ++i) {
      x[i] = from[i][0];
      y[i] = from[i][1];
      z[i] = from[i][2];
    }
  });
  return points;
}

}  // namespace pointwright
