#pragma once
// How far samples lie from a surface: from one that is known exactly, or from one that other samples stand
// for.

#include <cstddef>
#include <functional>
#include <vector>

#include "engine/core/points.h"

namespace pointwright::test {

struct DistanceSummary {
  double mean = 0.0;
  double rms = 0.0;
  double max = 0.0;
};

/// All zero for no distances.
DistanceSummary summarized(const std::vector<double>& distances);

/// A signed or unsigned distance to a surface; called concurrently.
using SurfaceDistance = std::function<double(const Vec3d&)>;

/// |distance(query)| of every query.
std::vector<double> distances_to(const Points& queries, const SurfaceDistance& distance);

/// Distance of every query to the planes of `samples`, blended. Of the 10 nearest samples q_j, normals n_j
/// turned to the nearest one's side, w_j = (1 - |p - q_j|^2 / r^2)^4 with r the distance to the 11th:
///   | sum_j w_j n_j . (p - q_j) / sum_j w_j |
/// Continuous in p but where sides change. With fewer than 11 samples r^2 is twice the farthest's square.
/// Pre:  at least one sample; unit normals, their sides of no account
/// Cost: O(N log M), parallel
std::vector<double> distances_to_planes(const Points& queries, const Points& samples, const Points& normal);

/// Distance of every query to the degree-2 moving-least-squares surface of `samples`: heights over the
/// weighted plane of the 32 nearest, weights (1 - |p - q_j|^2 / r^2)^2 with r the distance to the 33rd, to
/// first order in the slope at the query's foot. Degree 1 where the neighbours do not determine six
/// coefficients, and the distance to their mean where they span no plane.
/// Pre:  at least one sample
/// Cost: O(N log M), parallel
std::vector<double> distances_to_quadratic_fit(const Points& queries, const Points& samples);

}  // namespace pointwright::test
