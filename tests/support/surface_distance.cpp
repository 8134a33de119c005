#include "tests/support/surface_distance.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/normals/plane_fit.h"
#include "engine/spatial/kd_tree.h"

namespace pointwright::test {
namespace {

constexpr std::size_t kFitted = 32;

// Square of the radius at which weights vanish; the sample that stands there, if any, leaves `found`.
double squared_reach(std::vector<Neighbor>& found, std::size_t k) {
  const double farthest = static_cast<double>(found.back().distance_sq);
  if (found.size() <= k) return 2.0 * farthest;
  found.pop_back();
  return farthest;
}

double squared(double x) {
  return x * x;
}

// 1 at the query, 0 at the reach; all alike where everything stands in one place.
double closeness(const Neighbor& neighbor, double reach_sq) {
  return reach_sq > 0.0 ? std::max(0.0, 1.0 - static_cast<double>(neighbor.distance_sq) / reach_sq) : 1.0;
}

std::vector<Neighbor> nearest_samples(const Points& queries, const Points& samples) {
  const KdTree tree(samples);
  std::vector<Neighbor> result(queries.size());
  parallel_for(queries.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Neighbor> found;
    for (std::size_t i = begin; i < end; ++i) {
      tree.nearest(queries[i], 1, found);
      result[i] = found.front();
    }
  });
  return result;
}

// distance(query, its nearest samples) of every query.
template <typename Distance>
std::vector<double> over_neighbors(const Points& queries, const Points& samples, std::size_t k,
                                   const Distance& distance) {
  POINTWRIGHT_CHECK(!samples.empty(), "there must be samples to measure from");
  const KdTree tree(samples);
  std::vector<double> result(queries.size());
  parallel_for(queries.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Neighbor> found;
    for (std::size_t i = begin; i < end; ++i) {
      tree.nearest(queries[i], k + 1, found);
      const double reach_sq = squared_reach(found, k);
      result[i] = distance(queries[i].cast<double>(), found, reach_sq);
    }
  });
  return result;
}

// Height of the query over the fitted polynomial, as a distance: heights over the plane through `foot`.
double height_distance(const Eigen::MatrixXd& terms, const Eigen::VectorXd& heights, double query_height) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(terms);
  solver.setThreshold(1e-9);
  if (solver.rank() < terms.cols()) {
    // Too few places for the squares: drop them. One column at least, the constant, is always determined.
    const Eigen::Index fewer = terms.cols() > 3 ? 3 : 1;
    return height_distance(terms.leftCols(fewer), heights, query_height);
  }
  const Eigen::VectorXd c = solver.solve(heights);
  const double slope_sq = c.size() > 1 ? squared(c[1]) + squared(c[2]) : 0.0;
  return std::abs(query_height - c[0]) / std::sqrt(1.0 + slope_sq);
}

}  // namespace

DistanceSummary summarized(const std::vector<double>& distances) {
  DistanceSummary result;
  for (const double d : distances) {
    result.mean += d;
    result.rms += d * d;
    result.max = std::max(result.max, d);
  }
  const double count = std::max(1.0, static_cast<double>(distances.size()));
  result.mean /= count;
  result.rms = std::sqrt(result.rms / count);
  return result;
}

std::vector<double> distances_to(const Points& queries, const SurfaceDistance& distance) {
  std::vector<double> result(queries.size());
  parallel_for(queries.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) result[i] = std::abs(distance(queries[i].cast<double>()));
  });
  return result;
}

Discs discs_over(const Points& samples, const Points& originals, const Points& original_normal) {
  POINTWRIGHT_CHECK(!samples.empty(), "there must be samples to measure from");
  POINTWRIGHT_CHECK(originals.size() == original_normal.size(), "every original has a normal");
  const std::vector<Neighbor> nearest = nearest_samples(originals, samples);
  std::vector<Symmetric3d> spread(samples.size());
  std::vector<double> farthest_sq(samples.size(), 0.0);
  for (std::size_t i = 0; i < originals.size(); ++i) {
    const std::size_t j = nearest[i].index;
    const Vec3d n = original_normal[i].cast<double>();
    farthest_sq[j] = std::max(farthest_sq[j], static_cast<double>(nearest[i].distance_sq));
    // Lines have no side: their mean is the dominant eigenvector of sum n n', the least of sum (1 - n n').
    Symmetric3d& m = spread[j];
    m.xx += 1.0 - n.x() * n.x();
    m.yy += 1.0 - n.y() * n.y();
    m.zz += 1.0 - n.z() * n.z();
    m.xy -= n.x() * n.y();
    m.xz -= n.x() * n.z();
    m.yz -= n.y() * n.z();
  }
  Discs discs{Points(samples.size()), std::vector<double>(samples.size(), 0.0)};
  for (std::size_t j = 0; j < samples.size(); ++j) {
    Vec3d n;
    smallest_eigenvector(spread[j], n);
    discs.normal.set(j, n.cast<float>());
    discs.radius[j] = 2.0 * std::sqrt(farthest_sq[j]);
  }
  return discs;
}

std::vector<double> distances_to_discs(const Points& originals, const Points& original_normal,
                                       const Points& samples, const Discs& discs) {
  const KdTree tree(originals);
  std::vector<double> sum(originals.size(), 0.0);
  std::vector<double> weights(originals.size(), 0.0);
  // Searched for by many threads, added up by one, in the order of the discs.
  constexpr std::size_t kDiscs = 4096;
  std::vector<std::vector<Neighbor>> reached(std::min(kDiscs, samples.size()));
  for (std::size_t first = 0; first < samples.size(); first += kDiscs) {
    const std::size_t count = std::min(kDiscs, samples.size() - first);
    parallel_for(
        count,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t d = begin; d < end; ++d) {
            const auto radius = static_cast<float>(discs.radius[first + d]);
            reached[d].clear();
            if (radius > 0.0F) tree.within(samples[first + d], radius, originals.size(), reached[d]);
          }
        },
        16);
    for (std::size_t d = 0; d < count; ++d) {
      const std::size_t j = first + d;
      const double radius_sq = squared(discs.radius[j]);
      const Vec3d n = discs.normal[j].cast<double>();
      for (const Neighbor& original : reached[d]) {
        const double facing = n.dot(original_normal[original.index].cast<double>());
        const double weight = squared(squared(closeness(original, radius_sq))) / radius_sq * squared(facing);
        const Vec3d away = originals[original.index].cast<double>() - samples[j].cast<double>();
        sum[original.index] += (facing < 0.0 ? -weight : weight) * n.dot(away);
        weights[original.index] += weight;
      }
    }
  }
  const std::vector<Neighbor> nearest = nearest_samples(originals, samples);
  std::vector<double> result(originals.size());
  for (std::size_t i = 0; i < originals.size(); ++i) {
    if (weights[i] > 0.0) {
      result[i] = std::abs(sum[i] / weights[i]);
    } else {
      const Vec3d away = originals[i].cast<double>() - samples[nearest[i].index].cast<double>();
      result[i] = std::abs(discs.normal[nearest[i].index].cast<double>().dot(away));
    }
  }
  return result;
}

std::vector<double> distances_to_quadratic_fit(const Points& queries, const Points& samples) {
  return over_neighbors(
      queries, samples, kFitted, [&](const Vec3d& p, const std::vector<Neighbor>& found, double reach_sq) {
        const double scale = reach_sq > 0.0 ? std::sqrt(reach_sq) : 1.0;
        const auto count = static_cast<Eigen::Index>(found.size());
        PlaneFit plane;
        std::vector<Vec3d> at(found.size());
        Eigen::VectorXd root(count);  // of the weights
        for (std::size_t j = 0; j < found.size(); ++j) {
          at[j] = (samples[found[j].index].cast<double>() - p) / scale;
          root[static_cast<Eigen::Index>(j)] = closeness(found[j], reach_sq);
        }
        if (root.sum() == 0.0) root.setOnes();
        for (std::size_t j = 0; j < at.size(); ++j) {
          plane.add(at[j].x(), at[j].y(), at[j].z(), squared(root[static_cast<Eigen::Index>(j)]));
        }
        Vec3d n;
        if (!plane.normal(n)) return plane.centroid().norm() * scale;
        const Vec3d u = n.unitOrthogonal();
        const Vec3d v = n.cross(u);
        Eigen::MatrixXd terms(count, 6);
        Eigen::VectorXd heights(count);
        for (Eigen::Index j = 0; j < count; ++j) {
          const Vec3d& q = at[static_cast<std::size_t>(j)];
          const double x = u.dot(q);
          const double y = v.dot(q);
          terms.row(j) << 1.0, x, y, x * x, x * y, y * y;
          terms.row(j) *= root[j];
          heights[j] = root[j] * n.dot(q);
        }
        if (count < 6) return height_distance(terms.leftCols(count < 3 ? 1 : 3), heights, 0.0) * scale;
        return height_distance(terms, heights, 0.0) * scale;
      });
}

}  // namespace pointwright::test
