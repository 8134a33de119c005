#pragma once
// Who is near whom among inserted samples, and how they push each other away
// (engine/resampling/relaxation.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Neighbours of a list: a disc of the radius that lists are made with holds about 20.
inline constexpr std::uint32_t kMostRepelling = 32;
/// A sample and its ring.
inline constexpr std::uint32_t kMostFamilies = 17;

/// The families among which one family's members look for neighbours: samples that were there before, each
/// with a range of places of its children.
struct FamilyRing {
  std::uint32_t count;
  std::uint32_t sample[kMostFamilies];
  std::uint32_t begin[kMostFamilies];
  std::uint32_t end[kMostFamilies];
};

/// Places: those of the samples that were there before, then of children; kSimdBlock readable entries behind
/// the last. Columns of children are padded to whole blocks.
struct NearArgs {
  const float* place[3];
  std::uint32_t first_child;  ///< the place of child 0
  const FamilyRing* ring;
  const std::uint32_t* ring_of;  ///< by child
  const float* radius;           ///< by child: strictly nearer ones are listed
  std::uint32_t* list;           ///< [block of children][neighbour][lane], places
  std::uint32_t* count;          ///< by child
};

/// What the neighbours in the lists do to children.
struct RepelArgs {
  const float* place[3];
  std::uint32_t first_child;
  const std::uint32_t* list;
  const std::uint32_t* count;
  const float* radius;    ///< of repulsion
  const float* aside[3];  ///< by child: where to go from one that stands at the very same place
  float* push[3];
};

}  // namespace pointwright

/// Lists the neighbours of the children [begin, end). Where more are near than a list holds the nearest stay.
POINTWRIGHT_DECLARE_KERNEL(void list_near(const NearArgs& args, std::size_t begin, std::size_t end))
/// R / max(W, 4) times the sum over the W neighbours nearer than R of (1 - d / R) (p_i - p_j) / d, for the
/// blocks [begin, end) of children.
POINTWRIGHT_DECLARE_KERNEL(void repel(const RepelArgs& args, std::size_t begin, std::size_t end))
