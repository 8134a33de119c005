#pragma once
// One library as a contestant. Samples are put into a library's own structures beforehand; what is timed is
// its work, up to an answer in the caller's order of samples.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"
#include "tests/bench/peers/models.h"

namespace pointwright::peers {

/// N x k indices, the k nearest others of every sample, nearest first.
using NeighborLists = std::vector<std::uint32_t>;

struct NeighborSearch {
  std::string name;
  /// The work on these points, its structures built inside.
  std::function<std::function<void(NeighborLists&)>(const Points&, std::uint32_t k)> load;
};

struct NormalEstimator {
  std::string name;
  std::function<std::function<void(Points&)>(const Points&, std::uint32_t k)> load;
};

/// What decides how many samples are left.
enum class Control {
  kCount,    ///< the count itself
  kCell,     ///< the width of cells, here and below: the larger, the fewer; it is searched for
  kCluster,  ///< the most samples in a cluster
};

struct Simplifier {
  std::string name;
  Control control = Control::kCount;
  bool wants_mesh = false;
  std::size_t most_samples = 0;  ///< of more it would take minutes; those models it is spared
  /// run(parameter, result): parameter as `control` says.
  std::function<std::function<void(double, Points&)>(const Model&)> load;
};

struct Library {
  std::string name;
  std::string version;
  std::vector<NeighborSearch> searches;
  std::vector<NormalEstimator> estimators;
  std::vector<Simplifier> simplifiers;
};

inline constexpr std::size_t kAnyCount = static_cast<std::size_t>(-1);

/// This engine, from points in any order: ordering, neighbours, normals and their sides included. The first
/// simplifier is what it does by default.
Library our_library();
Library nanoflann_library();
Library cgal_library();
Library pcl_library();
Library open3d_library();

/// Calls search(i, found) for every sample, concurrently, `found` its k + 1 nearest as indices of any
/// integral type, and keeps all but the sample itself.
void search_all(std::size_t samples, std::uint32_t k, NeighborLists& lists,
                const std::function<void(std::size_t, std::uint32_t*)>& search);

}  // namespace pointwright::peers
