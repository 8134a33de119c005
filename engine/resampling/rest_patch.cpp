#include "engine/resampling/rest_patch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "engine/core/parallel.h"
#include "engine/multires/shape_operator.h"
#include "engine/resampling/nearest_few.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kJetNeighbors = 10;
constexpr std::uint32_t kMissing = std::numeric_limits<std::uint32_t>::max();
// Below this the least pivot of the scaled normal equations says that the neighbours determine no jet.
constexpr double kLeastPivot = 1e-6;
constexpr std::size_t kPatchesOfRange = 128;

// The neighbours of sample i and their neighbours, on its side, the nearest kRingSize of them.
void set_ring(const Level& level, const NeighborGraph& graph, std::uint32_t i, RestPatch& patch) {
  NearestFew<kRingSize> nearest(kRingSize);
  const auto consider = [&](std::uint32_t j) {
    const float distance = (level.position[j] - patch.center).squaredNorm();
    // Exact duplicates say nothing, and opposed normals are another sheet.
    if (j == i || !(distance > 0.0F) || level.normal[j].dot(patch.normal) <= 0.0F) return;
    nearest.consider(distance, j);
  };
  for (std::uint32_t a = 0; a < graph.k; ++a) consider(graph.index(i, a));
  if (graph.k < kRingSize) {
    for (std::uint32_t a = 0; a < graph.k; ++a) {
      const std::uint32_t near = graph.index(i, a);
      for (std::uint32_t b = 0; b < graph.k; ++b) consider(graph.index(near, b));
    }
  }
  patch.ring_size = nearest.count();
  for (std::uint32_t r = 0; r < nearest.count(); ++r) patch.ring[r] = nearest[r];
}

void fit_jet(const Level& level, RestPatch& patch) {
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Matrix5 = Eigen::Matrix<double, 5, 5>;
  const std::uint32_t count = std::min(patch.ring_size, kJetNeighbors);
  if (count < 5) return;
  const double reach = static_cast<double>((level.position[patch.ring[count - 1]] - patch.center).norm());
  Matrix5 normal_matrix = Matrix5::Zero();
  Vector5 right = Vector5::Zero();
  for (std::uint32_t j = 0; j < count; ++j) {
    const Vec3d offset = (level.position[patch.ring[j]] - patch.center).cast<double>() / reach;
    const double x = offset.dot(patch.u.cast<double>());
    const double y = offset.dot(patch.v.cast<double>());
    Vector5 row;
    row << x, y, x * x, x * y, y * y;
    normal_matrix += row * row.transpose();
    right += offset.dot(patch.normal.cast<double>()) * row;
  }
  const Eigen::LLT<Matrix5> factored(normal_matrix);
  const double least = factored.matrixLLT().diagonal().minCoeff();
  if (factored.info() != Eigen::Success || least * least < kLeastPivot) return;
  const Vector5 jet = factored.solve(right);
  patch.jet = {static_cast<float>(jet[0]), static_cast<float>(jet[1]), static_cast<float>(jet[2] / reach),
               static_cast<float>(jet[3] / reach), static_cast<float>(jet[4] / reach)};
}

}  // namespace

RestPatch rest_patch(const Level& level, const NeighborGraph& graph, std::uint32_t i) {
  RestPatch patch;
  patch.center = level.position[i];
  patch.normal = level.normal[i];
  const TangentFrame frame = tangent_frame(patch.normal.cast<double>());
  patch.u = frame.u.cast<float>();
  patch.v = frame.v.cast<float>();
  set_ring(level, graph, i, patch);
  fit_jet(level, patch);
  return patch;
}

void RestPatches::require(const std::vector<std::uint32_t>& samples) {
  number_.resize(level_->position.size(), kMissing);
  std::vector<std::uint32_t> missing;
  for (const std::uint32_t sample : samples) {
    if (number_[sample] != kMissing) continue;
    number_[sample] = static_cast<std::uint32_t>(patches_.size() + missing.size());
    missing.push_back(sample);
  }
  const std::size_t before = patches_.size();
  patches_.resize(before + missing.size());
  parallel_for(
      missing.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t m = begin; m < end; ++m)
          patches_[before + m] = rest_patch(*level_, *graph_, missing[m]);
      },
      kPatchesOfRange);
}

}  // namespace pointwright
