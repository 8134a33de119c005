// Spanning-tree propagation after Hoppe et al., "Surface reconstruction from unorganized points", 1992, with
// the reflected edge criterion of König and Gumhold, "Consistent propagation of normal orientations in point
// clouds", 2009.
#include "engine/normals/orientation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/normals/spanning_forest.h"
#include "engine/spatial/kd_tree.h"

namespace pointwright {
namespace {

constexpr std::size_t kSmallComponent = 50;
constexpr std::size_t kPart = std::size_t{1} << 16;  // samples that are looked through at a time

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
      see(side, p[static_cast<Eigen::Index>(side / 2)] * (side % 2 == 0 ? 1.0F : -1.0F), i);
    }
  }
  // Adds the samples of a later part.
  void add(const Extremes& later) {
    size += later.size;
    for (std::size_t side = 0; side < 6; ++side) see(side, later.value[side], later.sample[side]);
  }
  void see(std::size_t side, float along, std::uint32_t i) {
    if (along > value[side]) {
      value[side] = along;
      sample[side] = i;
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

// The components of a forest, numbered by their first samples.
std::vector<std::uint32_t> numbered_components(const std::vector<std::uint32_t>& root) {
  std::vector<std::uint32_t> component(root.size());
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < root.size(); ++i) {
    if (root[i] == i) component[i] = count++;
  }
  parallel_for(root.size(), [&](std::size_t begin, std::size_t end) {
    // The first sample of a component keeps its number: others read it meanwhile.
    for (std::size_t i = begin; i < end; ++i) {
      if (root[i] != i) component[i] = component[root[i]];
    }
  });
  return component;
}

// The extreme samples of every component.
std::vector<Extremes> extremes_of(const Points& points, const std::vector<std::uint32_t>& component,
                                  std::size_t component_count) {
  using Found = std::vector<std::pair<std::uint32_t, Extremes>>;  // in order of first appearance
  std::vector<Found> parts((points.size() + kPart - 1) / kPart);
  parallel_for(
      points.size(),
      [&](std::size_t begin, std::size_t end) {
        Found& part = parts[begin / kPart];
        std::unordered_map<std::uint32_t, std::size_t> place;
        std::size_t at = 0;
        for (std::size_t i = begin; i < end; ++i) {
          if (i == begin || component[i] != component[i - 1]) {
            at = place.try_emplace(component[i], part.size()).first->second;
            if (at == part.size()) part.emplace_back(component[i], Extremes{});
          }
          part[at].second.add(points[i], static_cast<std::uint32_t>(i));
        }
      },
      kPart);
  std::vector<Extremes> result(component_count);
  for (const Found& part : parts) {
    for (const auto& [c, extremes] : part) result[c].add(extremes);
  }
  return result;
}

// Small components (specks between scans) take the side of the nearest samples of the large ones.
void orient_small_components(const Points& points, const std::vector<std::uint32_t>& component,
                             const std::vector<Extremes>& extremes, Points& normals,
                             const ExecutionContext* context) {
  std::vector<std::uint32_t> large;
  std::vector<std::uint32_t> small;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    (extremes[component[i]].size >= kSmallComponent ? large : small).push_back(i);
  }
  if (large.empty() || small.empty()) return;
  const KdTree tree(points, std::move(large));
  std::vector<float> agreement(small.size());
  parallel_for(
      small.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<Neighbor> found;
        for (std::size_t s = begin; s < end; ++s) {
          tree.nearest(points[small[s]], 1, found);
          agreement[s] = normals[small[s]].dot(normals[found[0].index]);
        }
      },
      kSimdBlock, context);
  if (context != nullptr && context->is_cancelled()) return;
  std::vector<float> vote(extremes.size(), 0.0F);
  for (std::size_t s = 0; s < small.size(); ++s) vote[component[small[s]]] += agreement[s];
  for (const std::uint32_t i : small) {
    if (vote[component[i]] < 0.0F) normals.set(i, -normals[i]);
  }
}

// Calls is_wrong(i) for every sample and turns the normals for which it holds.
template <typename IsWrong>
void turn_where(Points& normals, const IsWrong& is_wrong) {
  parallel_for(normals.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (is_wrong(i)) normals.set(i, -normals[i]);
    }
  });
}

}  // namespace

OrientationReport orient_normals(const Points& points, const NeighborGraph& graph, Points& normals,
                                 const ExecutionContext* context) {
  POINTWRIGHT_CHECK(graph.count == points.size() && normals.size() == points.size(),
                    "the graph and the normals must be of these points");
  if (points.empty()) return {};
  const SidedForest forest = span_normals(points, graph, normals, context);
  if (forest.root.empty()) return {};
  const std::vector<std::uint32_t> component = numbered_components(forest.root);
  OrientationReport report;
  report.components = 1U + *std::max_element(component.begin(), component.end());
  const std::vector<Extremes> extremes = extremes_of(points, component, report.components);
  turn_where(normals, [&](std::size_t i) { return forest.opposed[i] != 0; });
  std::vector<char> inward(extremes.size());
  for (std::size_t c = 0; c < extremes.size(); ++c) {
    inward[c] = extremes[c].points_inward(normals) ? 1 : 0;
    if (extremes[c].size < kSmallComponent) ++report.small_components;
  }
  turn_where(normals, [&](std::size_t i) { return inward[component[i]] != 0; });
  if (report.small_components > 0) orient_small_components(points, component, extremes, normals, context);
  return report;
}

void orient_like(const Points& reference, Points& normals) {
  POINTWRIGHT_CHECK(reference.size() == normals.size(), "every normal has its counterpart");
  turn_where(normals, [&](std::size_t i) { return normals[i].dot(reference[i]) < 0.0F; });
}

void orient_toward(const Vec3f& viewpoint, const Points& points, Points& normals) {
  POINTWRIGHT_CHECK(points.size() == normals.size(), "every normal has its sample");
  turn_where(normals, [&](std::size_t i) { return normals[i].dot(viewpoint - points[i]) < 0.0F; });
}

void orient_toward(const Points& viewpoints, const Points& points, Points& normals) {
  POINTWRIGHT_CHECK(points.size() == normals.size() && points.size() == viewpoints.size(),
                    "every normal has its sample and its viewpoint");
  turn_where(normals, [&](std::size_t i) { return normals[i].dot(viewpoints[i] - points[i]) < 0.0F; });
}

}  // namespace pointwright
