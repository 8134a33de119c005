#pragma once
// The samples of a session's surface at one point of its history, and what viewers are told of them.

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"

namespace pointwright::server {

/// Immutable once shared. Columns in the order of the surface's.
struct SampleSet {
  std::shared_ptr<const Sampling> sampling;
  std::shared_ptr<const std::vector<std::uint16_t>> splat_radius;  ///< at rest, bfloat16

  [[nodiscard]] std::size_t size() const { return sampling->size(); }
  [[nodiscard]] const Cloud& cloud() const { return *sampling->cloud; }
  [[nodiscard]] const NeighborGraph& graph() const { return *sampling->graph; }
};
using SharedSamples = std::shared_ptr<const SampleSet>;

/// The samples that a session starts with; `rest` is where they stand.
SharedSamples samples_at_rest(Sampling sampling, const Level& rest);

}  // namespace pointwright::server
