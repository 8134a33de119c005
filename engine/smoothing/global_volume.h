#pragma once
// Shrinkage undone by a uniform scaling (§3.1, after Desbrun et al. 1999), for point samples.

#include <cstdint>
#include <vector>

#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/smoothing/packed.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// The enclosed volume of oriented samples: V = 1/3 sum a_i n_i . (p_i - c), c the centroid, a_i the squared
/// local spacing, n_i the normals averaged twice over neighbours of the same side (noise tilts a normal, and
/// less volume than the surface's would seem to pass through it).
///
/// Noise also enlarges the a_i, so two volumes that are measured apart do not compare. Therefore areas and
/// normals are held while the samples move: V is then linear in the positions, its change is that of the true
/// volume to first order, exact where the surface only shrinks, and an error common to all areas cancels. The
/// normals are fitted anew after each restoring that more steps follow, and restoring is done often enough
/// that no more than about half a percent of length is lost between.
class GlobalVolume {
 public:
  /// Errors: kInvalidArgument (field "preserve") for samples that enclose no volume: where the area vectors
  ///         add up to more than 0.1 + 1 / sqrt N of the area, the surface is open (a hole of a tenth of a
  ///         sphere's area gives 0.1, half a sphere 0.5); where the volume is nearly nothing, the samples lie
  ///         in a plane or on a line
  /// Pre:    unit normals on consistent sides, inward or outward
  /// Cost:   O(N k), parallel; bitwise equal for any thread count
  static Result<GlobalVolume> of(const Points& points, const Points& normals, const NeighborGraph& graph);

  /// How many iterations may pass until restore() is due, 1 to 10.
  [[nodiscard]] std::uint32_t steps_until_due() const { return due_; }

  /// Scales the samples about their centroid to the volume that they had before.
  /// Errors: kInvalidArgument (field "preserve") where the steps took all of the volume
  Result<void> restore(Packed& points, std::uint32_t steps);

  /// Fits the normals anew to restored samples, before further steps.
  void follow(const Packed& points);

 private:
  struct Moments {
    double area = 0.0;
    Vec3d area_vector = Vec3d::Zero();
    Vec3d centroid = Vec3d::Zero();
    double volume = 0.0;
    friend Moments operator+(const Moments& a, const Moments& b) {
      return {a.area + b.area, a.area_vector + b.area_vector, a.centroid + b.centroid, a.volume + b.volume};
    }
  };

  GlobalVolume(const NeighborGraph& graph, std::vector<float> area, const Points& normals)
      : graph_(&graph), area_(std::move(area)), normal_(normals) {}
  // Averages normal_ into direction_.
  void average_normals();
  [[nodiscard]] Moments moments(const Packed& points) const;

  const NeighborGraph* graph_;
  std::vector<float> area_;
  Points normal_;
  Packed direction_;
  double volume_ = 0.0;
  std::uint32_t due_ = 1;
};

}  // namespace pointwright
