// CGAL: point set processing and spatial searching, with oneTBB where it uses it.
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Search_traits_adapter.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/grid_simplify_point_set.h>
#include <CGAL/hierarchy_simplify_point_set.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>
#include <CGAL/version.h>
#include <CGAL/wlop_simplify_and_regularize_point_set.h>

#include <iterator>
#include <utility>

#include "tests/bench/peers/library.h"

namespace pointwright::peers {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Point = Kernel::Point_3;
using Vector = Kernel::Vector_3;
using Concurrency = CGAL::Parallel_if_available_tag;

Point point_of(const Vec3f& p) {
  return {static_cast<double>(p.x()), static_cast<double>(p.y()), static_cast<double>(p.z())};
}

std::vector<Point> points_of(const Points& points) {
  std::vector<Point> result;
  for (std::size_t i = 0; i < points.size(); ++i) result.push_back(point_of(points[i]));
  return result;
}

template <typename Triple>
Vec3f vec_of(const Triple& p) {
  return Vec3d(p.x(), p.y(), p.z()).cast<float>();
}

template <typename Iterator>
void store(Iterator begin, Iterator end, Points& result) {
  result.resize(static_cast<std::size_t>(std::distance(begin, end)));
  for (std::size_t i = 0; begin != end; ++begin) result.set(i++, vec_of(*begin));
}

using Map = CGAL::Pointer_property_map<Point>::const_type;
using Traits = CGAL::Search_traits_adapter<std::uint32_t, Map, CGAL::Search_traits_3<Kernel>>;
using Search = CGAL::Orthogonal_k_neighbor_search<Traits>;

std::function<void(NeighborLists&)> load_search(const Points& points, std::uint32_t k) {
  return [points = points_of(points), k](NeighborLists& lists) {
    const Map map = CGAL::make_property_map(points);
    std::vector<std::uint32_t> indices(points.size());
    for (std::uint32_t i = 0; i < indices.size(); ++i) indices[i] = i;
    Search::Tree tree(indices.begin(), indices.end(), Search::Splitter(), Traits(map));
    tree.build<Concurrency>();
    const Search::Distance distance(map);
    search_all(points.size(), k, lists, [&](std::size_t i, std::uint32_t* found) {
      const Search search(tree, points[i], k + 1, 0, true, distance);
      for (const auto& neighbor : search) *found++ = neighbor.first;
    });
  };
}

std::function<void(Points&)> load_normals(const Points& points, std::uint32_t k) {
  std::vector<std::pair<Point, Vector>> pairs;
  for (std::size_t i = 0; i < points.size(); ++i) pairs.emplace_back(point_of(points[i]), Vector());
  using Pair = std::pair<Point, Vector>;
  return [pairs = std::move(pairs), k](Points& normal) mutable {
    CGAL::pca_estimate_normals<Concurrency>(
        pairs, k,
        CGAL::parameters::point_map(CGAL::First_of_pair_property_map<Pair>())
            .normal_map(CGAL::Second_of_pair_property_map<Pair>()));
    for (std::size_t i = 0; i < pairs.size(); ++i) normal.set(i, vec_of(pairs[i].second));
  };
}

std::function<void(double, Points&)> load_hierarchy(const Model& model) {
  return [points = points_of(model.samples)](double size, Points& result) {
    std::vector<Point> left = points;
    const auto end = CGAL::hierarchy_simplify_point_set(
        left, CGAL::parameters::size(static_cast<unsigned>(size)).maximum_variation(1.0 / 3.0));
    store(left.begin(), end, result);
  };
}

std::function<void(double, Points&)> load_grid(const Model& model) {
  return [points = points_of(model.samples)](double cell, Points& result) {
    std::vector<Point> left = points;
    store(left.begin(), CGAL::grid_simplify_point_set(left, cell), result);
  };
}

std::function<void(double, Points&)> load_wlop(const Model& model) {
  return [points = points_of(model.samples)](double count, Points& result) {
    std::vector<Point> input = points;
    std::vector<Point> kept;
    CGAL::wlop_simplify_and_regularize_point_set<Concurrency>(
        input, std::back_inserter(kept),
        CGAL::parameters::select_percentage(100.0 * (count + 0.5) / static_cast<double>(points.size())));
    store(kept.begin(), kept.end(), result);
  };
}

}  // namespace

Library cgal_library() {
  return {.name = "CGAL",
          .version = CGAL_VERSION_STR,
          .searches = {{"CGAL", load_search}},
          .estimators = {{"CGAL", load_normals}},
          .simplifiers = {{"CGAL hierarchy", Control::kCluster, false, kAnyCount, load_hierarchy},
                          {"CGAL WLOP", Control::kCount, false, 200'000, load_wlop},
                          {"CGAL grid", Control::kCell, false, kAnyCount, load_grid}}};
}

}  // namespace pointwright::peers
