#include "engine/spatial/splat_radius.h"

#include <algorithm>
#include <array>
#include <limits>

#include "engine/core/parallel.h"

namespace pointwright {
namespace {

/// Of the distance across the widest gap: 0.9 leaves under 0.02 % of the Stanford dragon's surface open.
constexpr float kCover = 0.9F;
constexpr float kRim = 0.5F;
constexpr float kLargestOfMedian = 3.0F;
constexpr float kNone = std::numeric_limits<float>::infinity();

/// Squared distance to the nearest sample of each quadrant of a tangent plane.
class Quadrants {
 public:
  Quadrants(const Vec3f& center, const Vec3f& normal) : center_(center) {
    // The axis that the normal leans on least gives the steadiest tangent.
    int axis = 0;
    normal.cwiseAbs().minCoeff(&axis);
    u_ = normal.cross(Vec3f::Unit(axis));
    v_ = normal.cross(u_);
    nearest_.fill(kNone);
  }

  void see(const Vec3f& sample) {
    const Vec3f offset = sample - center_;
    const float square = offset.squaredNorm();
    if (square <= 0.0F) return;  // a duplicate lies in no quadrant
    const std::size_t quadrant = (u_.dot(offset) < 0.0F ? 1U : 0U) + (v_.dot(offset) < 0.0F ? 2U : 0U);
    nearest_[quadrant] = std::min(nearest_[quadrant], square);
  }

  [[nodiscard]] bool has_empty() const { return std::ranges::find(nearest_, kNone) != nearest_.end(); }

  /// The largest of the four distances, `missing` (squared) standing in for quadrants without a sample.
  [[nodiscard]] float gap(float missing) const {
    float largest = 0.0F;
    for (const float square : nearest_) largest = std::max(largest, square == kNone ? missing : square);
    return std::sqrt(largest);
  }

 private:
  Vec3f center_, u_, v_;
  std::array<float, 4> nearest_{};
};

/// Calls see(sample) for the neighbours of i, for their neighbours, and so on, `rings` steps away.
template <typename See>
void for_each_in_ring(std::size_t i, int rings, const NeighborGraph& graph, const See& see) {
  for (std::uint32_t j = 0; j < graph.k; ++j) {
    const std::size_t neighbor = graph.index(i, j);
    if (rings == 1)
      see(neighbor);
    else
      for_each_in_ring(neighbor, rings - 1, graph, see);
  }
}

float radius_of(std::size_t i, const Points& position, const Points& normal, const NeighborGraph& graph) {
  Quadrants quadrants(position[i], normal[i]);
  // The disc of a sample that faces the other way closes nothing on this side of a thin sheet.
  bool two_sided = false;
  const auto see = [&](std::size_t sample) {
    if (normal[sample].dot(normal[i]) > 0.0F)
      quadrants.see(position[sample]);
    else
      two_sided = true;
  };
  for_each_in_ring(i, 1, graph, see);
  if (quadrants.has_empty()) for_each_in_ring(i, 2, graph, see);
  // Between two sides half of each ring is lost.
  if (two_sided && quadrants.has_empty()) for_each_in_ring(i, 3, graph, see);
  const float farthest = (position[graph.index(i, graph.k - 1)] - position[i]).squaredNorm();
  return kCover * quadrants.gap(kRim * kRim * farthest);
}

float median_of_neighbors(std::size_t i, const std::vector<float>& radius, const NeighborGraph& graph,
                          std::vector<float>& scratch) {
  scratch.clear();
  for (std::uint32_t j = 0; j < graph.k; ++j) scratch.push_back(radius[graph.index(i, j)]);
  const auto middle = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 2);
  std::nth_element(scratch.begin(), middle, scratch.end());
  return *middle;
}

}  // namespace

std::vector<float> splat_radii(const Points& position, const Points& normal, const NeighborGraph& graph) {
  const std::size_t n = position.size();
  std::vector<float> wanted(n, 0.0F);
  if (graph.k == 0) return wanted;
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) wanted[i] = radius_of(i, position, normal, graph);
  });
  std::vector<float> radius(n);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    std::vector<float> scratch;
    scratch.reserve(graph.k);
    for (std::size_t i = begin; i < end; ++i) {
      radius[i] = std::min(wanted[i], kLargestOfMedian * median_of_neighbors(i, wanted, graph, scratch));
    }
  });
  return radius;
}

}  // namespace pointwright
