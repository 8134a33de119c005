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

/// Samples that stand for a surface from which others were taken: discs around them.
struct Discs {
  Points normal;               ///< unit; means over the originals that lie nearest to the sample
  std::vector<double> radius;  ///< twice the distance of the farthest of those; 0 where there are none
};

/// The discs that `samples` need to stand for the `originals`, whose unit normals may have any sides.
/// Pre:  at least one sample
/// Cost: O(N log M), parallel
Discs discs_over(const Points& samples, const Points& originals, const Points& original_normal);

/// Distance of every original p to the blended planes of the discs j that reach it:
///   | sum_j w_j n_j . (p - q_j) / sum_j w_j |,
///   w_j = (1 - |p - q_j|^2 / r_j^2)^4 / r_j^2 * (n_p . n_j)^2, n_j on the side of n_p.
/// Each disc has a reach of its own, so that sets that are dense in one place and sparse in another have no
/// holes; and planes at a right angle to the surface say nothing of the distance: samples of any polyhedron
/// with their true normals are at distance 0 from it, up to its edges.
/// Where every plane is at a right angle it is the distance to the nearest sample's.
/// Pre:  discs over these samples and originals
/// Cost: O(N log N + N discs that reach a sample), parallel in part
/// Determinism: bitwise equal for any thread count
std::vector<double> distances_to_discs(const Points& originals, const Points& original_normal,
                                       const Points& samples, const Discs& discs);

/// Distance of every query to the degree-2 moving-least-squares surface of `samples`: heights over the
/// weighted plane of the 32 nearest, weights (1 - |p - q_j|^2 / r^2)^2 with r the distance to the 33rd, to
/// first order in the slope at the query's foot. Degree 1 where the neighbours do not determine six
/// coefficients, and the distance to their mean where they span no plane.
/// Pre:  at least one sample
/// Cost: O(N log M), parallel
std::vector<double> distances_to_quadratic_fit(const Points& queries, const Points& samples);

}  // namespace pointwright::test
