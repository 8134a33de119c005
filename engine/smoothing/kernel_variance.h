#pragma once
// How far smoothing has spread: the variance of the weights that umbrella steps have given to the rest
// neighbourhood of each sample.

#include <cstdint>
#include <vector>

#include "engine/core/points.h"
#include "engine/smoothing/packed.h"
#include "engine/smoothing/umbrella.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// The variance that plain steps have given to the weights of each sample's neighbourhood.
///
/// Free steps: rows of W^n, about the mean, to which samples drift (spread_step). Steps along the normals
/// leave the drift out (level_weights in the source) and keep the mean on the sample: a step adds its gain
/// and carries on, under the same weights, what the neighbours have, in double precision. The first of them
/// takes the normals that it is given for the surface's own, which have no error of a fit: its gain is the
/// plain one. No sample is credited with more than weights can have whose mean is the sample and which stay
/// in the box of all samples that its steps can reach, (p - min)(max - p) an axis: gains alone would go on
/// growing on an object that is smaller than the scale, and in clusters that no neighbour leaves.
/// Cost: O(N k) a step, parallel; bitwise equal for any thread count
class KernelVariance {
 public:
  /// The variance no longer grows where a step adds less than this part of what the first one did.
  static constexpr double kExhausted = 0.01;

  /// Pre: normals only for kAlongNormal; graph.k > 0
  KernelVariance(const Points& points, const Points& normals, const NeighborGraph& graph,
                 SmoothingDirection direction);

  /// Each sample's part of a step's lambda; empty where it is 1.
  [[nodiscard]] const std::vector<double>& rates() const { return rate_; }

  /// What changes from step to step.
  struct State {
    Packed spread;                 ///< free steps
    std::vector<double> variance;  ///< steps along the normals
  };

  /// The state after one more step of lambda.
  [[nodiscard]] State stepped(double lambda) const;
  void take(State stepped);

  /// Median over the samples of the variance per axis of the tangent plane, half of the whole.
  [[nodiscard]] double median(const State& state) const;

 private:
  const NeighborGraph* graph_;
  Packed rest_;  // free steps
  State state_;
  std::vector<float> weights_;  // along the normals, as the next four
  std::vector<double> first_gain_, gain_, rate_, most_;
  bool is_first_ = true;
};

}  // namespace pointwright
