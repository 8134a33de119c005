#include "engine/resampling/interpolation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// The weight of a sample falls to zero at so many times the squared distance of the farthest one.
constexpr double kReach = 1.25;
constexpr double kLeastPivot = 1e-7;  // of the scaled normal equations, as in a patch's jet
constexpr float kSeam = 10.0F;
constexpr std::size_t kChildrenOfRange = 256;

struct Offset {
  double x, y, weight;
};

// The weights of a moving least-squares fit of `Terms` monomials, at the origin. False where they are not
// determined.
template <int Terms>
bool fit(const std::array<Offset, kZombies>& offsets, ZombieWeights& result) {
  using Row = Eigen::Matrix<double, Terms, 1>;
  using Square = Eigen::Matrix<double, Terms, Terms>;
  const auto row_of = [](const Offset& o) {
    Row row;
    if constexpr (Terms == 6)
      row << 1.0, o.x, o.y, o.x * o.x, o.x * o.y, o.y * o.y;
    else
      row << 1.0, o.x, o.y;
    return row;
  };
  if (result.count < Terms) return false;
  Square matrix = Square::Zero();
  double total = 0.0;
  for (std::uint32_t j = 0; j < result.count; ++j) {
    const Row row = row_of(offsets[j]);
    matrix += offsets[j].weight * row * row.transpose();
    total += offsets[j].weight;
  }
  const Eigen::LLT<Square> factored(matrix / total);
  const double least = factored.matrixLLT().diagonal().minCoeff();
  if (factored.info() != Eigen::Success || !(least * least > kLeastPivot)) return false;
  const Row at_origin = factored.solve(Row::Unit(0));
  for (std::uint32_t j = 0; j < result.count; ++j)
    result.weight[j] = static_cast<float>(offsets[j].weight / total * row_of(offsets[j]).dot(at_origin));
  return true;
}

// How far apart in texture; what is no number is infinitely far from everything.
float texture_distance(const TexCoord& a, const TexCoord& b) {
  const float distance = std::max(std::abs(a[0] - b[0]), std::abs(a[1] - b[1]));
  return distance >= 0.0F && std::isfinite(a[1] - b[1]) ? distance : std::numeric_limits<float>::infinity();
}

// Which samples hang together with the nearest one in texture, by steps of at most `limit`.
std::array<bool, kZombies> linked(const ZombieWeights& all, const std::vector<TexCoord>& texcoord,
                                  float limit) {
  std::array<bool, kZombies> found{};
  std::array<std::uint32_t, kZombies> queue{};
  std::uint32_t count = 1;
  found[0] = true;
  for (std::uint32_t next = 0; next < count; ++next) {
    const TexCoord& from = texcoord[all.sample[queue[next]]];
    for (std::uint32_t j = 0; j < all.count; ++j) {
      if (found[j] || !(texture_distance(from, texcoord[all.sample[j]]) <= limit)) continue;
      found[j] = true;
      queue[count++] = j;
    }
  }
  return found;
}

// The samples whose texture coordinates do not lie across a seam from the nearest's, with weights of sum 1.
ZombieWeights without_seam(const ZombieWeights& all, const std::vector<TexCoord>& texcoord) {
  // Two of those that follow each other lie on the same side: where nobody is far away compared to the
  // closest such pair, there is no seam.
  float closest = std::numeric_limits<float>::infinity();
  float farthest = 0.0F;
  for (std::uint32_t j = 1; j < all.count; ++j) {
    const TexCoord& here = texcoord[all.sample[j]];
    closest = std::min(closest, texture_distance(here, texcoord[all.sample[j - 1]]));
    farthest = std::max(farthest, texture_distance(here, texcoord[all.sample[0]]));
  }
  if (farthest <= kSeam * closest && std::isfinite(farthest)) return all;
  std::array<float, kZombies> nearest{};  // in texture, by sample
  nearest.fill(std::numeric_limits<float>::infinity());
  for (std::uint32_t a = 0; a < all.count; ++a) {
    for (std::uint32_t b = 0; b < all.count; ++b)
      if (a != b)
        nearest[a] = std::min(nearest[a], texture_distance(texcoord[all.sample[a]], texcoord[all.sample[b]]));
  }
  const auto middle = nearest.begin() + all.count / 2;
  std::nth_element(nearest.begin(), middle, nearest.begin() + all.count);
  const std::array<bool, kZombies> same_side = linked(all, texcoord, kSeam * *middle);
  ZombieWeights kept;
  for (std::uint32_t j = 0; j < all.count; ++j) {
    if (!same_side[j]) continue;
    kept.sample[kept.count] = all.sample[j];
    kept.weight[kept.count++] = all.weight[j];
  }
  if (kept.count == all.count) return all;
  // Some are gone: what is left of the fit is no fit any more, so a mean.
  float total = 0.0F;
  for (std::uint32_t j = 0; j < kept.count; ++j) total += std::max(kept.weight[j], 0.0F);
  for (std::uint32_t j = 0; j < kept.count; ++j)
    kept.weight[j] = total > 0.0F ? std::max(kept.weight[j], 0.0F) / total : (j == 0 ? 1.0F : 0.0F);
  return kept;
}

// A weighted sum within the range of what it is made of; the nearest's where one of them is no number.
template <typename Value>
double clamped(const ZombieWeights& weights, const Value& value) {
  const double nearest = value(weights.sample[0]);
  double sum = 0.0;
  double least = nearest;
  double greatest = nearest;
  for (std::uint32_t j = 0; j < weights.count; ++j) {
    const double here = value(weights.sample[j]);
    if (!std::isfinite(here)) return nearest;
    sum += static_cast<double>(weights.weight[j]) * here;
    least = std::min(least, here);
    greatest = std::max(greatest, here);
  }
  return std::clamp(sum, least, greatest);
}

template <typename T, typename Make>
void append(std::vector<T>& column, std::size_t count, const Make& make) {
  const std::size_t before = column.size();
  column.resize(before + count);
  parallel_for(
      count,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) column[before + c] = make(c);
      },
      kChildrenOfRange);
}

}  // namespace

ZombieWeights zombie_weights(const RestPatch& patch, std::uint32_t parent, const Points& position, float x,
                             float y) {
  struct Near {
    float distance;
    std::uint32_t sample;
  };
  const Vec3f here = patch.point(x, y);
  std::array<Near, kRingSize + 1> near{};
  std::uint32_t found = 0;
  near[found++] = {(patch.center - here).squaredNorm(), parent};
  for (std::uint32_t r = 0; r < patch.ring_size; ++r)
    near[found++] = {(position[patch.ring[r]] - here).squaredNorm(), patch.ring[r]};
  std::sort(near.begin(), near.begin() + found, [](const Near& a, const Near& b) {
    return a.distance < b.distance || (a.distance == b.distance && a.sample < b.sample);
  });
  ZombieWeights result;
  result.count = std::min(found, kZombies);
  const double reach = std::sqrt(kReach * static_cast<double>(near[result.count - 1].distance));
  if (!(reach > 0.0)) {
    result.count = 1;
    result.sample[0] = near[0].sample;
    result.weight[0] = 1.0F;
    return result;
  }
  std::array<Offset, kZombies> offsets{};
  double total = 0.0;
  for (std::uint32_t j = 0; j < result.count; ++j) {
    const Vec3d offset = (position[near[j].sample] - here).cast<double>() / reach;
    const double fall = 1.0 - static_cast<double>(near[j].distance) / (reach * reach);
    result.sample[j] = near[j].sample;
    offsets[j] = {.x = offset.dot(patch.u.cast<double>()),
                  .y = offset.dot(patch.v.cast<double>()),
                  .weight = fall * fall * fall * fall};
    total += offsets[j].weight;
  }
  if (fit<6>(offsets, result) || fit<3>(offsets, result)) return result;
  for (std::uint32_t j = 0; j < result.count; ++j)
    result.weight[j] = static_cast<float>(offsets[j].weight / total);
  return result;
}

std::vector<ZombieWeights> all_zombie_weights(const Splits& splits, const RestPatches& patches,
                                              const Births& births, const Points& position) {
  std::vector<ZombieWeights> weights(births.x.size());
  parallel_for(
      weights.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
          const std::uint32_t parent = splits.splits[births.split[c]].sample;
          weights[c] = zombie_weights(patches.of(parent), parent, position, births.x[c], births.y[c]);
        }
      },
      kChildrenOfRange);
  return weights;
}

void append_attributes(const std::vector<ZombieWeights>& weights, Cloud& cloud) {
  const std::size_t count = weights.size();
  if (!cloud.color.empty()) {
    append(cloud.color, count, [&](std::size_t c) {
      Rgba color{};
      for (std::size_t channel = 0; channel < color.size(); ++channel) {
        const double value = clamped(
            weights[c], [&](std::uint32_t i) { return static_cast<double>(cloud.color[i][channel]); });
        color[channel] = static_cast<std::uint8_t>(std::lround(value));
      }
      return color;
    });
  }
  if (!cloud.texcoord.empty()) {
    append(cloud.texcoord, count, [&](std::size_t c) {
      const ZombieWeights kept = without_seam(weights[c], cloud.texcoord);
      TexCoord sum{};
      for (std::uint32_t j = 0; j < kept.count; ++j)
        for (std::size_t axis = 0; axis < 2; ++axis)
          sum[axis] += kept.weight[j] * cloud.texcoord[kept.sample[j]][axis];
      return std::isfinite(sum[0]) && std::isfinite(sum[1]) ? sum : cloud.texcoord[kept.sample[0]];
    });
  }
  for (ScalarAttribute& scalar : cloud.scalars) {
    std::visit(
        [&](auto& values) {
          using T = typename std::remove_reference_t<decltype(values)>::value_type;
          append(values, count, [&](std::size_t c) -> T {
            if constexpr (std::is_floating_point_v<T>)
              return static_cast<T>(
                  clamped(weights[c], [&](std::uint32_t i) { return static_cast<double>(values[i]); }));
            else
              return values[weights[c].sample[0]];
          });
        },
        scalar.values);
  }
}

}  // namespace pointwright
