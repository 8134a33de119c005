// nanoflann as it comes: an adaptor over an array of points, leaves of its default size.
#include <nanoflann.hpp>
#include <string>

#include "tests/bench/peers/library.h"

namespace pointwright::peers {
namespace {

struct Dataset {
  std::vector<Vec3f> points;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Dataset>, Dataset, 3,
                                                 std::uint32_t>;

std::function<void(NeighborLists&)> load_search(const Points& points, std::uint32_t k) {
  Dataset data;
  for (std::size_t i = 0; i < points.size(); ++i) data.points.push_back(points[i]);
  return [data = std::move(data), k](NeighborLists& lists) {
    Tree tree(3, data);
    tree.buildIndex();
    search_all(data.points.size(), k, lists, [&](std::size_t i, std::uint32_t* found) {
      float distances[64];
      tree.knnSearch(data.points[i].data(), k + 1, found, distances);
    });
  };
}

}  // namespace

Library nanoflann_library() {
  const std::string digits = std::to_string(NANOFLANN_VERSION >> 8) + "." +
                             std::to_string(NANOFLANN_VERSION >> 4 & 0xf) + "." +
                             std::to_string(NANOFLANN_VERSION & 0xf);
  return {.name = "nanoflann", .version = digits, .searches = {{"nanoflann", load_search}}};
}

}  // namespace pointwright::peers
