// Spanning-tree propagation after Hoppe et al., "Surface reconstruction from unorganized points", 1992, with
// the reflected edge criterion of König and Gumhold, "Consistent propagation of normal orientations in point
// clouds", 2009.
#include "engine/normals/orientation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/spatial/kd_tree.h"

namespace pointwright {
namespace {

constexpr std::size_t kSmallComponent = 50;
constexpr std::uint32_t kWeightLevels = 1U << 16;
constexpr std::size_t kCancelInterval = std::size_t{1} << 16;  // edges or samples of a sequential loop

// Whether a sequential loop that is at `step` should end.
bool is_cancelled_at(std::size_t step, const ExecutionContext* context) {
  return context != nullptr && step % kCancelInterval == 0 && context->is_cancelled();
}

struct Edge {
  std::uint32_t a;
  std::uint32_t b;
  std::uint16_t weight;  // 1 - |r . n_b|, quantised
  bool opposed;          // the sides differ along this edge
};

Edge make_edge(const Points& points, const Points& normals, std::uint32_t a, std::uint32_t b) {
  const Vec3f offset = points[b] - points[a];
  const float length = offset.norm();
  const Vec3f e = length > 0.0F ? Vec3f(offset / length) : Vec3f(Vec3f::Zero());
  const Vec3f na = normals[a];
  const float agreement = (na - 2.0F * e * e.dot(na)).dot(normals[b]);
  const float weight = std::clamp(1.0F - std::abs(agreement), 0.0F, 1.0F);
  return {a, b, static_cast<std::uint16_t>(weight * static_cast<float>(kWeightLevels - 1)), agreement < 0.0F};
}

// Disjoint sets that remember, per sample, whether its side is opposed to that of its set's root.
class SidedSets {
 public:
  explicit SidedSets(std::size_t n) : parent_(n), opposed_(n, 0) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }

  struct Root {
    std::uint32_t index;
    bool opposed;
  };
  Root find(std::uint32_t i) {
    std::uint32_t root = i;
    std::uint8_t side = 0;
    while (parent_[root] != root) {
      side ^= opposed_[root];
      root = parent_[root];
    }
    const Root result{root, side != 0};
    while (parent_[i] != root && i != root) {  // compress
      const std::uint32_t next = parent_[i];
      const std::uint8_t here = opposed_[i];
      parent_[i] = root;
      opposed_[i] = side;
      side ^= here;
      i = next;
    }
    return result;
  }
  void join(std::uint32_t a, std::uint32_t b, bool opposed) {
    const Root ra = find(a);
    const Root rb = find(b);
    if (ra.index == rb.index) return;
    const bool flip = ra.opposed != (rb.opposed != opposed);
    const auto [low, high] = std::minmax(ra.index, rb.index);
    parent_[high] = low;  // the lower index is the root: components are numbered by their first sample
    opposed_[high] = flip ? 1 : 0;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::uint8_t> opposed_;
};

// Every undirected edge of the graph once, ordered by weight, then by (a, j): one stable counting sort. None
// when cancelled.
std::vector<Edge> sorted_edges(const Points& points, const Points& normals, const NeighborGraph& graph,
                               const ExecutionContext* context) {
  const auto n = static_cast<std::uint32_t>(graph.count);
  std::vector<std::uint32_t> first(n + 1, 0);
  const auto is_listed = [&](std::uint32_t i, std::uint32_t neighbor) {
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      if (graph.index(i, j) == neighbor) return true;
    }
    return false;
  };
  const auto keep = [&](std::uint32_t i, std::uint32_t b) { return i < b || !is_listed(b, i); };
  const auto repeats = [&](std::uint32_t i) { return i > 0 && points[i] == points[i - 1]; };
  const auto count_edges = [&](std::size_t begin, std::size_t end) {
    for (auto i = static_cast<std::uint32_t>(begin); i < end; ++i) {
      std::uint32_t count = repeats(i) ? 1 : 0;
      for (std::uint32_t j = 0; j < graph.k; ++j) count += keep(i, graph.index(i, j)) ? 1U : 0U;
      first[i + 1] = count;
    }
  };
  parallel_for(n, count_edges, kParallelBlock, context);
  if (is_cancelled_at(0, context)) return {};
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Edge> edges(first[n]);
  const auto make_edges = [&](std::size_t begin, std::size_t end) {
    for (auto i = static_cast<std::uint32_t>(begin); i < end; ++i) {
      std::uint32_t slot = first[i];
      if (repeats(i)) edges[slot++] = make_edge(points, normals, i - 1, i);
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const std::uint32_t b = graph.index(i, j);
        if (keep(i, b)) edges[slot++] = make_edge(points, normals, i, b);
      }
    }
  };
  parallel_for(n, make_edges, kParallelBlock, context);
  if (is_cancelled_at(0, context)) return {};
  std::vector<std::uint32_t> offset(kWeightLevels + 1, 0);
  for (const Edge& edge : edges) ++offset[edge.weight + 1U];
  std::partial_sum(offset.begin(), offset.end(), offset.begin());
  std::vector<Edge> sorted(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (is_cancelled_at(e, context)) return {};
    sorted[offset[edges[e].weight]++] = edges[e];
  }
  return sorted;
}

// Of a component's samples that are extreme along x, y or z, the one whose normal points most along that axis
// tells the outside.
struct Extremes {
  std::array<float, 6> value;
  std::array<std::uint32_t, 6> sample{};
  std::size_t size = 0;

  Extremes() { value.fill(-std::numeric_limits<float>::max()); }
  void add(const Vec3f& p, std::uint32_t i) {
    ++size;
    for (std::size_t side = 0; side < 6; ++side) {
      const float along = p[static_cast<Eigen::Index>(side / 2)] * (side % 2 == 0 ? 1.0F : -1.0F);
      if (along > value[side]) {
        value[side] = along;
        sample[side] = i;
      }
    }
  }
  [[nodiscard]] bool points_inward(const Points& normals) const {
    float best = 0.0F;
    bool inward = false;
    for (std::size_t side = 0; side < 6; ++side) {
      const float along =
          normals[sample[side]][static_cast<Eigen::Index>(side / 2)] * (side % 2 == 0 ? 1.0F : -1.0F);
      if (std::abs(along) > best) {
        best = std::abs(along);
        inward = along < 0.0F;
      }
    }
    return inward;
  }
};

// Small components (specks between scans) take the side of the nearest samples of the large ones.
void orient_small_components(const Points& points, const std::vector<std::uint32_t>& component,
                             const std::vector<Extremes>& extremes, Points& normals,
                             const ExecutionContext* context) {
  std::vector<std::uint32_t> large;
  std::vector<float> vote(extremes.size(), 0.0F);
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (extremes[component[i]].size >= kSmallComponent) large.push_back(i);
  }
  if (large.empty() || large.size() == points.size()) return;
  const KdTree tree(points, large);
  std::vector<Neighbor> found;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (is_cancelled_at(i, context)) return;
    if (extremes[component[i]].size >= kSmallComponent) continue;
    tree.nearest(points[i], 1, found);
    vote[component[i]] += normals[i].dot(normals[found[0].index]);
  }
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (vote[component[i]] < 0.0F) normals.set(i, -normals[i]);
  }
}

}  // namespace

OrientationReport orient_normals(const Points& points, const NeighborGraph& graph, Points& normals,
                                 const ExecutionContext* context) {
  const auto n = static_cast<std::uint32_t>(points.size());
  SidedSets sets(n);
  const std::vector<Edge> edges = sorted_edges(points, normals, graph, context);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (is_cancelled_at(e, context)) break;
    sets.join(edges[e].a, edges[e].b, edges[e].opposed);
  }
  if (is_cancelled_at(0, context)) return {};

  std::vector<std::uint32_t> component(n);
  std::vector<Extremes> extremes;
  for (std::uint32_t i = 0; i < n; ++i) {
    const auto root = sets.find(i);
    if (root.index == i) {  // roots are the first of their component
      component[i] = static_cast<std::uint32_t>(extremes.size());
      extremes.emplace_back();
    } else {
      component[i] = component[root.index];
    }
    if (root.opposed) normals.set(i, -normals[i]);
    extremes[component[i]].add(points[i], i);
  }
  OrientationReport report{.components = extremes.size(), .small_components = 0};
  std::vector<char> inward(extremes.size());
  for (std::size_t c = 0; c < extremes.size(); ++c) {
    inward[c] = extremes[c].points_inward(normals) ? 1 : 0;
    if (extremes[c].size < kSmallComponent) ++report.small_components;
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    if (inward[component[i]] != 0) normals.set(i, -normals[i]);
  }
  if (report.small_components > 0) orient_small_components(points, component, extremes, normals, context);
  return report;
}

void orient_like(const Points& reference, Points& normals) {
  parallel_for(normals.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (normals[i].dot(reference[i]) < 0.0F) normals.set(i, -normals[i]);
    }
  });
}

}  // namespace pointwright
