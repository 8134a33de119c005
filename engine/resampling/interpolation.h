#pragma once
// Scalars of inserted samples from the undistorted originals at rest: the zombies of §5.2.

#include <array>
#include <cstdint>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/multires/surface.h"
#include "engine/resampling/rest_patch.h"
#include "engine/resampling/splitting.h"

namespace pointwright {

/// Samples that one value is interpolated from, at most.
inline constexpr std::uint32_t kZombies = 12;

/// What an inserted sample takes from whom.
struct ZombieWeights {
  std::uint32_t count = 0;
  std::array<std::uint32_t, kZombies> sample{};  ///< nearest first
  std::array<float, kZombies> weight{};          ///< sum to 1
};

/// Weights of the quadratic moving least-squares fit at (x, y) of a patch, over the nearest of the sample and
/// its ring at rest: they reproduce quadratic functions of the tangent plane. Where these do not determine a
/// quadric the fit is linear, else a mean.
/// Cost: O(1): 12 samples, one 6 x 6 system
ZombieWeights zombie_weights(const RestPatch& patch, std::uint32_t parent, const Points& position, float x,
                             float y);

/// The weights of all children. Cost: O(C), parallel.
std::vector<ZombieWeights> all_zombie_weights(const Splits& splits, const RestPatches& patches,
                                              const Births& births, const Points& position);

/// Appends the children's entries to the cloud's colours, texture coordinates and further attributes. Colours
/// and floating-point attributes stay within the range of the samples that they come from; whole numbers, and
/// what is NaN somewhere among them, are the nearest sample's. Texture coordinates do not mix over a seam:
/// those samples count that hang together with the nearest one in texture, by steps of ten times the median
/// distance between next neighbours.
/// Cost: O(C) a column, parallel
void append_attributes(const std::vector<ZombieWeights>& weights, Cloud& cloud);

}  // namespace pointwright
