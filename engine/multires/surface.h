#pragma once
// The multiresolution surface of §3: the same samples on every level, level 0 the smoothest.

#include <cstddef>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

/// One level k of the hierarchy: the samples p_k of S_k and their unit normals n_k.
struct Level {
  Points position;
  Points normal;

  friend bool operator==(const Level&, const Level&) = default;
};

/// Levels 0..n and the detail coefficients between them: p_{k+1} = p_k + d_k n_k (Eq. 5). All columns have N
/// entries; positions are relative to the cloud's origin.
struct MultiresSurface {
  std::vector<Level> levels;               ///< n + 1 levels; the last one is the full surface
  std::vector<std::vector<float>> detail;  ///< n columns d_0 .. d_{n-1}, signed along n_k, model units

  [[nodiscard]] std::size_t band_count() const { return detail.size(); }
  [[nodiscard]] std::size_t sample_count() const {
    return levels.empty() ? 0 : levels.back().position.size();
  }
  [[nodiscard]] const Level& finest() const { return levels.back(); }
};

}  // namespace pointwright
