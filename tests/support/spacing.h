#pragma once
// How evenly samples are spaced.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include "engine/core/points.h"
#include "engine/spatial/kd_tree.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright::test {

/// The distance of neighbours when so many samples stand on an area in a hexagonal pattern: the greatest that
/// all of them can keep.
inline double hexagonal_spacing(double area, std::size_t count) {
  return std::sqrt(2.0 * area / (std::numbers::sqrt3 * static_cast<double>(count)));
}

/// Distances to the nearest other sample, ascending. Pre: coherent order, two places or more
inline std::vector<double> nearest_distances(const Points& points) {
  const NeighborGraph graph = build_neighbor_graph(points, 1);
  std::vector<double> distance;
  for (std::size_t i = 0; i < points.size(); ++i) {
    distance.push_back(static_cast<double>((points[i] - points[graph.index(i, 0)]).norm()));
  }
  std::sort(distance.begin(), distance.end());
  return distance;
}

/// Of the distances to the nearest other sample.
struct Spacing {
  double least = 0.0;
  double mean = 0.0;
  double variation = 0.0;  ///< standard deviation / mean
};
/// In this unit.
inline Spacing spacing_of(const Points& points, double unit) {
  const std::vector<double> distance = nearest_distances(points);
  double sum = 0.0;
  double square = 0.0;
  for (const double d : distance) {
    sum += d / unit;
    square += d / unit * d / unit;
  }
  const double mean = sum / static_cast<double>(distance.size());
  const double variance = square / static_cast<double>(distance.size()) - mean * mean;
  return {distance.front() / unit, mean, std::sqrt(std::max(0.0, variance)) / mean};
}

/// Distances from every sample to the nearest of others, ascending.
inline std::vector<double> distances_to(const Points& points, const Points& others) {
  const KdTree tree(others);
  std::vector<Neighbor> found;
  std::vector<double> distance;
  for (std::size_t i = 0; i < points.size(); ++i) {
    tree.nearest(points[i], 1, found);
    distance.push_back(std::sqrt(static_cast<double>(found[0].distance_sq)));
  }
  std::sort(distance.begin(), distance.end());
  return distance;
}

/// The farthest that a sample of the surface is from the subset, in this unit.
inline double largest_gap(const Points& surface, const Points& subset, double unit) {
  return distances_to(surface, subset).back() / unit;
}

}  // namespace pointwright::test
