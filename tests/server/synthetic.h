#pragma once
// Small clouds and requests that the server's tests share.

#include <cmath>
#include <cstdint>
#include <numeric>

#include "engine/core/cloud.h"
#include "engine/editing/edit.h"
#include "engine/editing/painting.h"
#include "engine/multires/hierarchy.h"
#include "engine/spatial/coherent_order.h"

namespace pointwright::test {

/// A wavy sheet of side x side samples over [0, 1]^2, in coherent order, with colours.
inline Cloud wavy_sheet(std::size_t side) {
  Cloud cloud;
  cloud.position.resize(side * side);
  cloud.color.resize(side * side);
  for (std::size_t i = 0; i < side * side; ++i) {
    const float x = static_cast<float>(i % side) / static_cast<float>(side - 1);
    const float y = static_cast<float>(i / side) / static_cast<float>(side - 1);
    cloud.position.set(i, {x, y, 0.02F * std::sin(40.0F * x) * std::cos(30.0F * y)});
    cloud.color[i] = {static_cast<std::uint8_t>(i), 7, 9, 255};
  }
  cloud.id.resize(side * side);
  std::iota(cloud.id.begin(), cloud.id.end(), 0U);
  return permuted(cloud, coherent_order(cloud.position));
}

/// Paints everything with x below `edge` / above `edge`.
inline PaintOperation left_of(double edge) {
  return {.shape = AxisBox{.min = Vec3d(-1, -1, -1), .max = Vec3d(edge, 2, 1)}};
}
inline PaintOperation right_of(double edge) {
  return {.shape = AxisBox{.min = Vec3d(edge, -1, -1), .max = Vec3d(2, 2, 1)}};
}

inline EditParams lift(double height, std::uint32_t level = 0) {
  return {.level = level, .deformation = Translation{.vector = Vec3d(0, 0, height)}};
}
inline EditParams turn(double angle_rad, std::uint32_t level = 0) {
  return {
      .level = level,
      .deformation = Rotation{.point = Vec3d(0.5, 0.5, 0), .axis = Vec3d(0, 1, 0), .angle_rad = angle_rad}};
}

}  // namespace pointwright::test
