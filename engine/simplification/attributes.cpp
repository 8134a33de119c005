#include "engine/simplification/attributes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <type_traits>

namespace pointwright {
namespace {

// Means of one component, value(i) of every sample.
template <typename Value>
std::vector<double> means(const Simplification& simplified, const Value& value) {
  std::vector<double> sum(simplified.kept.size(), 0.0);
  std::vector<double> count(simplified.kept.size(), 0.0);
  for (std::size_t i = 0; i < simplified.parent.size(); ++i) {
    sum[simplified.parent[i]] += value(i);
    count[simplified.parent[i]] += 1.0;
  }
  for (std::size_t m = 0; m < sum.size(); ++m) sum[m] /= count[m];
  return sum;
}

template <typename Scalar>
std::vector<Scalar> converted(const std::vector<double>& values) {
  std::vector<Scalar> result(values.size());
  for (std::size_t m = 0; m < values.size(); ++m) result[m] = static_cast<Scalar>(values[m]);
  return result;
}

}  // namespace

std::vector<std::uint32_t> representatives(const Simplification& simplified, const Points& position) {
  POINTWRIGHT_CHECK(simplified.parent.size() == position.size(), "these are not the simplified points");
  std::vector<std::uint32_t> result(simplified.kept.size(), 0);
  std::vector<float> nearest(simplified.kept.size(), std::numeric_limits<float>::infinity());
  for (std::uint32_t i = 0; i < position.size(); ++i) {
    const std::uint32_t m = simplified.parent[i];
    const float distance_sq = (position[i] - simplified.position[m]).squaredNorm();
    if (!(distance_sq < nearest[m])) continue;
    nearest[m] = distance_sq;
    result[m] = i;
  }
  return result;
}

std::vector<float> averaged(const Simplification& simplified, std::span<const float> values,
                            std::size_t components) {
  POINTWRIGHT_CHECK(values.size() == simplified.parent.size() * components,
                    "one value a sample and component");
  std::vector<float> result(simplified.kept.size() * components);
  for (std::size_t c = 0; c < components; ++c) {
    const std::vector<double> mean =
        means(simplified, [&](std::size_t i) { return static_cast<double>(values[i * components + c]); });
    for (std::size_t m = 0; m < mean.size(); ++m) result[m * components + c] = static_cast<float>(mean[m]);
  }
  return result;
}

Cloud simplified_cloud(const Simplification& simplified, const Cloud& cloud) {
  const std::vector<std::uint32_t> representative = representatives(simplified, cloud.position);
  Cloud result = permuted(cloud, representative);
  result.position = simplified.position;
  result.normal = simplified.normal;
  result.exact_position.clear();
  std::iota(result.id.begin(), result.id.end(), 0U);
  for (std::size_t c = 0; c < 4 && cloud.has_colors(); ++c) {
    const std::vector<double> mean =
        means(simplified, [&](std::size_t i) { return static_cast<double>(cloud.color[i][c]); });
    for (std::size_t m = 0; m < mean.size(); ++m) {
      result.color[m][c] = static_cast<std::uint8_t>(std::floor(mean[m] + 0.5));
    }
  }
  for (std::size_t c = 0; c < 2 && !cloud.texcoord.empty(); ++c) {
    const std::vector<double> mean =
        means(simplified, [&](std::size_t i) { return static_cast<double>(cloud.texcoord[i][c]); });
    for (std::size_t m = 0; m < mean.size(); ++m) result.texcoord[m][c] = static_cast<float>(mean[m]);
  }
  for (std::size_t a = 0; a < cloud.scalars.size(); ++a) {
    std::visit(
        [&](const auto& values) {
          using Column = std::decay_t<decltype(values)>;
          using Scalar = typename Column::value_type;
          if constexpr (std::is_floating_point_v<Scalar>) {
            const std::vector<double> mean =
                means(simplified, [&](std::size_t i) { return static_cast<double>(values[i]); });
            result.scalars[a].values = converted<Scalar>(mean);
          }
        },
        cloud.scalars[a].values);
  }
  return result;
}

Cloud chosen_cloud(const Cloud& cloud, const std::vector<std::uint32_t>& kept) {
  Cloud result = permuted(cloud, kept);
  std::vector<std::uint32_t> rank(kept.size());
  std::iota(rank.begin(), rank.end(), 0U);
  std::sort(rank.begin(), rank.end(),
            [&](std::uint32_t a, std::uint32_t b) { return cloud.id[kept[a]] < cloud.id[kept[b]]; });
  for (std::uint32_t r = 0; r < rank.size(); ++r) result.id[rank[r]] = r;
  return result;
}

}  // namespace pointwright
