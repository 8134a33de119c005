#pragma once
// How far smoothing has spread: the variance of the weights that umbrella steps have given to the rest
// neighbourhood of each sample.

#include <cstdint>
#include <vector>

#include "engine/core/points.h"
#include "engine/smoothing/umbrella.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// The variance that plain steps have given to the weights of each sample's neighbourhood, in double
/// precision.
///
/// Free steps: rows of W^n; |p|^2 and p under the same steps give it about the mean, and samples drift to
/// that mean. Steps along the normals leave the drift out (level_weights in the source) and keep the mean on
/// the sample: a step adds its gain and carries on, under the same weights, what the neighbours have. The
/// first of them takes the normals that it is given for the surface's own, which have no error of a fit: its
/// gain is the plain one. No sample is credited with more than weights can have whose mean is the sample and
/// which stay in the box of all samples that its steps can reach, (p - min)(max - p) an axis: gains alone
/// would go on growing on an object that is smaller than the scale, and in clusters that no neighbour leaves.
/// Cost: O(N k) a step, parallel; bitwise equal for any thread count
class KernelVariance {
 public:
  /// Pre: normals only for kAlongNormal; graph.k > 0
  KernelVariance(const Points& points, const Points& normals, const NeighborGraph& graph,
                 SmoothingDirection direction);

  /// Each sample's part of a step's lambda; empty where it is 1.
  [[nodiscard]] const std::vector<double>& rates() const { return rate_; }

  /// What changes from step to step: x y z |p|^2, or the variance itself.
  using Columns = std::vector<std::vector<double>>;

  /// The columns after one more step of lambda.
  [[nodiscard]] Columns stepped(double lambda) const;
  void take(Columns stepped);

  /// Median over the samples of the variance per axis of the tangent plane, half of the whole.
  [[nodiscard]] double median(const Columns& columns) const;

 private:
  const NeighborGraph* graph_;
  bool is_free_;
  Columns columns_;
  std::vector<float> weights_;  // along the normals, as the next four
  std::vector<double> first_gain_, gain_, rate_, most_;
  bool is_first_ = true;
};

}  // namespace pointwright
