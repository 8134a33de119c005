#include "engine/resampling/splitting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

constexpr std::size_t kBlocksOfRange = kParallelBlock / kSimdBlock;
constexpr std::size_t kSplitsOfRange = 512;
// Rounding divides from one and a half of the spacing wanted on.
constexpr float kRoundsUp = 1.5F;
constexpr float kMostLength = 1e6F;  // of an axis, in spacings: beyond it rounding says nothing
constexpr std::size_t kMostSamples = std::size_t{1} << 31;

std::uint32_t parts(float length, float wanted, std::uint32_t most) {
  const float rounded = std::floor(std::min(length / wanted, kMostLength) + 0.5F);
  return std::clamp(rounded >= 1.0F ? static_cast<std::uint32_t>(rounded) : 1U, 1U, most);
}

// Where the minor axis is squeezed a stretch counts as major * minor^0.75: the latter, of correctly rounded
// operations alone.
float shear_factor(float minor) {
  const float root = std::sqrt(minor);
  return root * std::sqrt(root);
}

Split split_of(std::uint32_t sample, const Sampling& sampling, const Cells& mapped,
               const ResamplingParams& params, float coarser) {
  Split split{.sample = sample};
  const float spacing = sampling.spacing[sample];
  if (!(spacing > 0.0F) || sampling.graph->k == 0) return split;
  PrincipalStretch stretch = principal_stretch(mapped.u[sample], mapped.v[sample]);
  if (params.shear_aware && stretch.minor < 1.0F) stretch.major *= shear_factor(stretch.minor);
  const float wanted = wanted_spacing(spacing, params, coarser);
  split.major = parts(stretch.major * spacing, wanted, kMostParts);
  split.minor = parts(stretch.minor * spacing, wanted, kMostParts / split.major);
  return split;
}

}  // namespace

float wanted_spacing(float spacing, const ResamplingParams& params, float coarser) {
  const auto bound = static_cast<float>(params.bound);
  const auto least = static_cast<float>(params.min_spacing);
  return coarser * std::max(spacing * (bound / kRoundsUp), least / kRoundsUp);
}

Result<Splits> find_splits(const Sampling& sampling, const Cells& mapped, const ScaleField& field,
                           const std::vector<std::uint32_t>& blocks, const ResamplingParams& params,
                           float coarser) {
  const std::size_t n = sampling.size();
  std::vector<std::vector<Split>> found((blocks.size() + kBlocksOfRange - 1) / kBlocksOfRange);
  parallel_for(
      blocks.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<Split>& here = found[begin / kBlocksOfRange];
        for (std::size_t entry = begin; entry < end; ++entry) {
          const std::size_t first = std::size_t{blocks[entry]} * kSimdBlock;
          for (std::size_t i = first; i < std::min(first + kSimdBlock, n); ++i) {
            if (!(field.t[i] > 0.0F)) continue;
            const Split split = split_of(static_cast<std::uint32_t>(i), sampling, mapped, params, coarser);
            if (split.children() > 0) here.push_back(split);
          }
        }
      },
      kBlocksOfRange);
  Splits all;
  for (const std::vector<Split>& part : found) {
    for (Split split : part) {
      split.first_child = static_cast<std::uint32_t>(all.inserted);
      all.inserted += split.children();
      all.splits.push_back(split);
    }
  }
  const std::size_t ids = std::numeric_limits<std::uint32_t>::max() - sampling.next_id;
  const std::size_t most = std::min(
      {params.max_samples > 0 ? std::size_t{params.max_samples} : kMostSamples, kMostSamples, n + ids});
  if (all.inserted > 0 && n + all.inserted > most) {
    return too_large("resampling would give " + std::to_string(n + all.inserted) +
                         " samples, more than the limit of " + std::to_string(most),
                     "resampling.max_samples", static_cast<double>(most),
                     static_cast<double>(n + all.inserted));
  }
  return all;
}

float rest_area(const Vec3f& u, const Vec3f& v, float spacing) {
  return u.cross(v).norm() * spacing * spacing;
}

Births give_birth(const Splits& splits, const RestPatches& patches, const Sampling& sampling,
                  const Cells& rest, const Cells& mapped, const ScaleField& field) {
  Births births{.split = std::vector<std::uint32_t>(splits.inserted),
                .x = std::vector<float>(splits.inserted),
                .y = std::vector<float>(splits.inserted)};
  parallel_for(
      splits.splits.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
          const Split& split = splits.splits[s];
          const std::uint32_t i = split.sample;
          const RestPatch& patch = patches.of(i);
          const PrincipalStretch stretch = principal_stretch(mapped.u[i], mapped.v[i]);
          Vec3f along = stretch.cosine * rest.u[i] + stretch.sine * rest.v[i];
          Vec3f across = stretch.cosine * rest.v[i] - stretch.sine * rest.u[i];
          // Which end is which must not be left to rounding: toward the one-region, else toward +x, +y, +z.
          float direction = along.dot(field.gradient[i]);
          for (int c = 0; c < 3 && direction == 0.0F; ++c) direction = along[c];
          const float sign = direction < 0.0F ? -1.0F : 1.0F;
          along *= sign * sampling.spacing[i] / static_cast<float>(split.major);
          across *= sign * sampling.spacing[i] / static_cast<float>(split.minor);
          const auto own_a = static_cast<int>((split.major - 1) / 2);
          const auto own_b = static_cast<int>((split.minor - 1) / 2);
          std::size_t child = split.first_child;
          for (int b = 0; b < static_cast<int>(split.minor); ++b) {
            for (int a = 0; a < static_cast<int>(split.major); ++a) {
              if (a == own_a && b == own_b) continue;
              const Vec3f offset =
                  static_cast<float>(a - own_a) * along + static_cast<float>(b - own_b) * across;
              births.split[child] = static_cast<std::uint32_t>(s);
              births.x[child] = offset.dot(patch.u);
              births.y[child] = offset.dot(patch.v);
              ++child;
            }
          }
        }
      },
      kSplitsOfRange);
  return births;
}

}  // namespace pointwright
