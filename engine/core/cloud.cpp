#include "engine/core/cloud.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/core/gather.h"

namespace pointwright {
namespace {

Error malformed(const char* column, std::size_t expected, std::size_t actual) {
  return Error{.code = ErrorCode::kMalformedData,
               .message = std::string("column '") + column + "' has " + std::to_string(actual) +
                          " entries where the cloud has " + std::to_string(expected) + " samples",
               .field = column};
}

}  // namespace

Vec3d model_position(const Cloud& cloud, std::size_t i) {
  if (!cloud.exact_position.empty()) {
    const auto& p = cloud.exact_position[i];
    return {p[0], p[1], p[2]};
  }
  return cloud.origin + cloud.position[i].cast<double>();
}

Cloud permuted(const Cloud& cloud, const std::vector<std::uint32_t>& order) {
  Cloud result;
  result.origin = cloud.origin;
  result.color_has_alpha = cloud.color_has_alpha;
  result.position_is_double = cloud.position_is_double;
  result.position = gathered(cloud.position, order);
  result.normal = gathered(cloud.normal, order);
  result.color = gathered(cloud.color, order);
  result.texcoord = gathered(cloud.texcoord, order);
  result.id = gathered(cloud.id, order);
  result.exact_position = gathered(cloud.exact_position, order);
  result.scalars.reserve(cloud.scalars.size());
  for (const ScalarAttribute& scalar : cloud.scalars) {
    result.scalars.push_back(
        {scalar.name,
         std::visit([&](const auto& values) { return ScalarAttribute::Values(gathered(values, order)); },
                    scalar.values)});
  }
  return result;
}

Cloud in_caller_order(const Cloud& cloud) {
  std::vector<std::uint32_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return cloud.id[a] < cloud.id[b]; });
  return permuted(cloud, order);
}

std::uint64_t memory_of(const Cloud& cloud) {
  std::uint64_t bytes = (cloud.position.size() + cloud.normal.size()) * 3 * sizeof(float);
  bytes += cloud.color.size() * sizeof(Rgba) + cloud.texcoord.size() * sizeof(TexCoord);
  bytes += cloud.id.size() * sizeof(std::uint32_t) + cloud.exact_position.size() * 3 * sizeof(double);
  for (const ScalarAttribute& scalar : cloud.scalars)
    bytes += std::visit([](const auto& values) { return values.size() * sizeof(values[0]); }, scalar.values);
  return bytes;
}

Result<void> validate(const Cloud& cloud) {
  const std::size_t n = cloud.size();
  const auto wrong = [n](std::size_t size, bool optional) { return size != n && !(optional && size == 0); };
  if (wrong(cloud.normal.size(), true)) return malformed("normal", n, cloud.normal.size());
  if (wrong(cloud.color.size(), true)) return malformed("color", n, cloud.color.size());
  if (wrong(cloud.texcoord.size(), true)) return malformed("texcoord", n, cloud.texcoord.size());
  if (wrong(cloud.id.size(), false)) return malformed("id", n, cloud.id.size());
  if (wrong(cloud.exact_position.size(), true))
    return malformed("exact_position", n, cloud.exact_position.size());
  for (const ScalarAttribute& scalar : cloud.scalars) {
    if (wrong(scalar.size(), false)) return malformed(scalar.name.c_str(), n, scalar.size());
  }
  std::vector<std::uint32_t> ids = cloud.id;
  if (!std::is_sorted(ids.begin(), ids.end())) std::sort(ids.begin(), ids.end());
  const auto twice = std::adjacent_find(ids.begin(), ids.end());
  if (twice != ids.end()) {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "two samples have the id " + std::to_string(*twice),
                 .field = "id"};
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!cloud.position[i].allFinite()) {
      return Error{
          .code = ErrorCode::kNonFinite,
          .message = "sample " + std::to_string(cloud.id[i]) + " has a coordinate that is not finite",
          .field = "position"};
    }
  }
  return {};
}

}  // namespace pointwright
