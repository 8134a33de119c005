#include "engine/multires/base_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "engine/core/median.h"
#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"
#include "engine/smoothing/umbrella.h"
#include "engine/spatial/coherent_order.h"
#include "engine/spatial/same_side_graph.h"

namespace pointwright {
namespace {

constexpr double kCellOfScale = 0.7;
constexpr std::uint32_t kSmoothingNeighbors = 10;
// On a grid that is even next to the scale about five are enough.
constexpr std::uint32_t kMaxIterations = 200;

// Samples sorted by grid cell: `order` lists them, cell c holds order[first[c] .. first[c + 1]).
struct Grid {
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> first;
};

Grid sort_into_cells(const Points& position, const Vec3d& origin, double cell) {
  const std::size_t n = position.size();
  const Box3f box = bounds_of(position);
  const auto cell_of = [&](const Vec3f& p) -> Eigen::Array3d {
    return ((origin + p.cast<double>()) / cell).array().floor();
  };
  const Eigen::Array3d lowest = cell_of(box.min);
  Grid grid;
  grid.order.resize(n);
  std::iota(grid.order.begin(), grid.order.end(), 0U);
  std::vector<std::uint64_t> keys(n);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Array3d c = cell_of(position[i]) - lowest;
      keys[i] = static_cast<std::uint64_t>(c.x()) | (static_cast<std::uint64_t>(c.y()) << 21) |
                (static_cast<std::uint64_t>(c.z()) << 42);
    }
  });
  sort_by_key(keys, grid.order);
  for (std::size_t i = 0; i < n; ++i) {
    if (i == 0 || keys[i] != keys[i - 1]) grid.first.push_back(static_cast<std::uint32_t>(i));
  }
  grid.first.push_back(static_cast<std::uint32_t>(n));
  return grid;
}

// What a cell contributes: one centroid, or two where opposite sheets share it.
struct CellSplit {
  std::array<Vec3d, 2> position;
  std::array<Vec3d, 2> normal;
  std::array<double, 2> count{};
  int parts = 1;
  Vec3d axis = Vec3d::Zero();  // a sample belongs to part 0 where normal . axis >= 0
};

CellSplit split_cell(const Points& position, const Points& normal, const std::uint32_t* begin,
                     const std::uint32_t* end) {
  CellSplit split;
  Mat3d spread = Mat3d::Zero();
  for (const std::uint32_t* i = begin; i != end; ++i) {
    const Vec3d n = normal[*i].cast<double>();
    spread += n * n.transpose();
  }
  // The dominant direction of the normals, whatever their sides and their order.
  Mat3d power = spread / spread.trace();
  for (int squaring = 0; squaring < 6; ++squaring) {
    power = (power * power).eval();
    power /= power.trace();
  }
  Eigen::Index column = 0;
  power.diagonal().maxCoeff(&column);
  split.axis = power.col(column).normalized();

  std::array<double, 2> count{};
  split.position.fill(Vec3d::Zero());
  split.normal.fill(Vec3d::Zero());
  for (const std::uint32_t* i = begin; i != end; ++i) {
    const Vec3d n = normal[*i].cast<double>();
    const std::size_t part = n.dot(split.axis) >= 0.0 ? 0 : 1;
    count[part] += 1.0;
    split.position[part] += position[*i].cast<double>();
    split.normal[part] += n;
  }
  if (count[0] > 0.0 && count[1] > 0.0 && split.normal[0].dot(split.normal[1]) < 0.0) {
    split.parts = 2;
  } else {
    split.axis.setZero();
    split.position[0] += split.position[1];
    split.normal[0] += split.normal[1];
    count[0] += count[1];
  }
  for (std::size_t part = 0; part < static_cast<std::size_t>(split.parts); ++part) {
    split.position[part] /= count[part];
    const double length = split.normal[part].norm();
    split.normal[part] = length > 1e-6 ? Vec3d(split.normal[part] / length) : normal[*begin].cast<double>();
    split.count[part] = count[part];
  }
  return split;
}

// The centroids of the cells, not yet in coherent order.
struct Centroids {
  Points position;
  Points normal;
  std::vector<double> count;  // samples that each stands for
};

// The nearest centroid of each one's side that is closer than `limit`; itself where there is none.
std::vector<std::uint32_t> nearest_of_side(const Centroids& centroids,
                                           const std::vector<std::uint32_t>& alive, double limit) {
  constexpr float kSameSide = 0.5F;
  constexpr std::size_t kLookedAt = 5;  // itself and those nearest to it
  const KdTree tree(centroids.position, alive);
  std::vector<std::uint32_t> nearest(alive.size());
  const auto limit_sq = static_cast<float>(limit * limit);
  parallel_for(alive.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Neighbor> found;
    for (std::size_t a = begin; a < end; ++a) {
      const std::uint32_t i = alive[a];
      nearest[a] = i;
      tree.nearest(centroids.position[i], kLookedAt, found);
      for (const Neighbor& neighbor : found) {
        if (neighbor.index == i || !(neighbor.distance_sq < limit_sq)) continue;
        if (centroids.normal[i].dot(centroids.normal[neighbor.index]) < kSameSide) continue;
        nearest[a] = neighbor.index;
        break;
      }
    }
  });
  return nearest;
}

// Cells cut a surface that runs along their border into slivers whose centroids stand close together and
// would count as much as whole cells: averages over Q would lean towards the border. Mutually nearest ones of
// one side, less than 0.7 cells apart, become one, in a few rounds. Returns for each centroid the one that it
// has become part of, or itself.
std::vector<std::uint32_t> join_slivers(Centroids& centroids, double cell) {
  constexpr double kJoinOfCell = 0.7;
  constexpr int kRounds = 4;
  std::vector<std::uint32_t> part_of(centroids.position.size());
  std::iota(part_of.begin(), part_of.end(), 0U);
  std::vector<std::uint32_t> alive = part_of;
  std::vector<std::uint32_t> place(part_of.size());
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<std::uint32_t> nearest = nearest_of_side(centroids, alive, kJoinOfCell * cell);
    for (std::uint32_t a = 0; a < alive.size(); ++a) place[alive[a]] = a;
    std::vector<std::uint32_t> left;
    for (std::uint32_t a = 0; a < alive.size(); ++a) {
      const std::uint32_t i = alive[a];
      const std::uint32_t j = nearest[a];
      const bool mutual = j != i && nearest[place[j]] == i;
      if (!mutual || i < j) left.push_back(i);
      if (!mutual || j < i) continue;
      const double together = centroids.count[i] + centroids.count[j];
      const auto mean = [&](const Points& points) -> Vec3d {
        return (centroids.count[i] * points[i].cast<double>() +
                centroids.count[j] * points[j].cast<double>()) /
               together;
      };
      centroids.position.set(i, mean(centroids.position).cast<float>());
      centroids.normal.set(i, mean(centroids.normal).normalized().cast<float>());
      centroids.count[i] = together;
      part_of[j] = i;
    }
    if (left.size() == alive.size()) break;
    alive = std::move(left);
  }
  for (std::uint32_t& whole : part_of) {
    while (part_of[whole] != whole) whole = part_of[whole];
  }
  return part_of;
}

// Fills position, normal and counterpart of Q from the cells.
void gather_cells(const Points& position, const Points& normal, const Grid& grid, double cell,
                  BaseSurface& base) {
  const std::size_t cells = grid.first.size() - 1;
  std::vector<CellSplit> splits(cells);
  parallel_for(
      cells,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
          splits[c] = split_cell(position, normal, grid.order.data() + grid.first[c],
                                 grid.order.data() + grid.first[c + 1]);
        }
      },
      256);
  std::vector<std::uint32_t> slot(cells + 1, 0);
  for (std::size_t c = 0; c < cells; ++c) slot[c + 1] = slot[c] + static_cast<std::uint32_t>(splits[c].parts);
  Centroids centroids{.position = Points(slot[cells]),
                      .normal = Points(slot[cells]),
                      .count = std::vector<double>(slot[cells])};
  base.counterpart.resize(position.size());
  parallel_for(
      cells,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
          for (std::uint32_t part = 0; part < static_cast<std::uint32_t>(splits[c].parts); ++part) {
            centroids.position.set(slot[c] + part, splits[c].position[part].cast<float>());
            centroids.normal.set(slot[c] + part, splits[c].normal[part].cast<float>());
            centroids.count[slot[c] + part] = splits[c].count[part];
          }
          for (std::uint32_t at = grid.first[c]; at < grid.first[c + 1]; ++at) {
            const std::uint32_t i = grid.order[at];
            const bool second = splits[c].parts == 2 && normal[i].cast<double>().dot(splits[c].axis) < 0.0;
            base.counterpart[i] = slot[c] + (second ? 1U : 0U);
          }
        }
      },
      256);
  const std::vector<std::uint32_t> part_of = join_slivers(centroids, cell);
  // Coherent order inside Q, as everywhere.
  const std::vector<std::uint32_t> order = coherent_order(centroids.position);
  std::vector<std::uint32_t> rank(order.size());
  std::uint32_t kept = 0;
  base.position.resize(order.size());
  base.normal.resize(order.size());
  for (const std::uint32_t c : order) {
    if (part_of[c] != c) continue;
    rank[c] = kept;
    base.position.set(kept, centroids.position[c]);
    base.normal.set(kept, centroids.normal[c]);
    ++kept;
  }
  base.position.resize(kept);
  base.normal.resize(kept);
  for (std::uint32_t& q : base.counterpart) q = rank[part_of[q]];
}

// The first k columns of a graph.
NeighborGraph narrowed(const NeighborGraph& graph, std::uint32_t k) {
  NeighborGraph result;
  result.count = graph.count;
  result.k = std::min(k, graph.k);
  result.lanes.assign(padded_to_block(graph.count) * result.k, 0U);
  for (std::size_t i = 0; i < graph.count; ++i) {
    for (std::uint32_t j = 0; j < result.k; ++j) result.index(i, j) = graph.index(i, j);
  }
  return result;
}

// What the means over the cells smooth: the median over Q of the variance of a cell's samples about their
// centroid, an axis of the tangent plane. A full cell has cell^2 / 12, one that a single sample fills 0.
double cell_variance(const Points& position, const BaseSurface& base) {
  std::vector<double> squares(base.position.size(), 0.0);
  std::vector<double> count(base.position.size(), 0.0);
  for (std::size_t i = 0; i < position.size(); ++i) {
    const std::uint32_t q = base.counterpart[i];
    const Vec3d e = (position[i] - base.position[q]).cast<double>();
    const double height = e.dot(base.normal[q].cast<double>());
    squares[q] += e.squaredNorm() - height * height;
    count[q] += 1.0;
  }
  for (std::size_t q = 0; q < squares.size(); ++q) squares[q] /= 2.0 * std::max(count[q], 1.0);
  return median(std::move(squares));
}

// What the least-squares planes smooth: the median over Q of the variance of their weights (1 - d^2/r^2)^4,
// an axis. That is r^2 / 12 on a disc, r the distance of the first sample beyond the kPlaneNeighbors nearest;
// where Q has no such sample all of it counts, with the weights that decomposition.cpp gives it.
double plane_variance(const BaseSurface& base) {
  std::vector<double> variance(base.position.size());
  parallel_for(variance.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<double> distance_sq;
    for (std::size_t q = begin; q < end; ++q) {
      distance_sq.clear();
      for (std::uint32_t j = 0; j < base.graph.k; ++j) {
        const std::uint32_t other = base.graph.index(q, j);
        if (other == q) break;  // the rest of a short row
        distance_sq.push_back(static_cast<double>((base.position[other] - base.position[q]).squaredNorm()));
      }
      if (distance_sq.size() >= kPlaneNeighbors) {
        variance[q] = distance_sq[kPlaneNeighbors - 1] / 12.0;
        continue;
      }
      const double radius_sq = distance_sq.empty() ? 0.0 : 1.5 * distance_sq.back();
      double sum = 0.0;
      double weights = 1.0;  // the sample itself
      for (const double d_sq : distance_sq) {
        const double weight = radius_sq > 0.0 ? std::pow(1.0 - d_sq / radius_sq, 4) : 1.0;
        sum += weight * d_sq;
        weights += weight;
      }
      variance[q] = 0.5 * sum / weights;
    }
  });
  return median(std::move(variance));
}

}  // namespace

Result<BaseSurface> build_base_surface(const Points& position, const Points& normal, const Vec3d& origin,
                                       float scale, const ExecutionContext& context) {
  POINTWRIGHT_CHECK(scale > 0.0F, "a base needs a scale");
  const double cell = kCellOfScale * static_cast<double>(scale);
  BaseSurface base;
  gather_cells(position, normal, sort_into_cells(position, origin, cell), cell, base);
  base.graph = same_side_graph(base.position, base.normal, kCachedNeighbors, 2 * kCachedNeighbors, &context);
  if (context.is_cancelled()) return cancelled_error();

  // Variances add: the cells and the least-squares planes have theirs, the umbrella supplies the rest of
  // scale^2.
  double variance = cell_variance(position, base);
  const double rest =
      static_cast<double>(scale) * static_cast<double>(scale) - variance - plane_variance(base);
  const NeighborGraph smoothing_graph = narrowed(base.graph, kSmoothingNeighbors);
  if (rest > 0.0 && smoothing_graph.k > 0 && base.position.size() > 2 * kSmoothingNeighbors) {
    auto smoothed =
        smooth_to_scale(base.position, base.normal, smoothing_graph, static_cast<float>(std::sqrt(rest)),
                        SmoothingDirection::kAlongNormal, kMaxIterations, &context);
    if (!smoothed) return smoothed.error();
    const double reached = static_cast<double>(smoothed.value().scale);
    variance += reached * reached;
    base.iterations = smoothed.value().iterations;
    base.position = std::move(smoothed).value().points;
    refit_normals(base.position, smoothing_graph, base.normal);
    base.graph =
        same_side_graph(base.position, base.normal, kCachedNeighbors, 2 * kCachedNeighbors, &context);
    if (context.is_cancelled()) return cancelled_error();
  } else {
    refit_normals(base.position, smoothing_graph, base.normal);
  }
  base.scale = static_cast<float>(std::sqrt(variance + plane_variance(base)));
  return base;
}

}  // namespace pointwright
