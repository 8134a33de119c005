#include "engine/normals/rest_surface.h"

#include <cmath>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"

namespace pointwright {
namespace {

// Uploaded normals, made unit; estimated ones where an uploaded one is no direction.
Points adopt_normals(const Points& uploaded, const Points& estimated) {
  Points result(uploaded.size());
  parallel_for(uploaded.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f n = uploaded[i];
      const float length = n.norm();
      const bool usable = std::isfinite(length) && length > 1e-6F;
      const bool is_unit = std::abs(length - 1.0F) < 1e-5F;  // keeps the bits of what is unit already
      result.set(i, !usable ? estimated[i] : is_unit ? n : Vec3f(n / length));
    }
  });
  return result;
}

}  // namespace

Result<void> validate_neighbors(std::uint32_t neighbors) {
  if (neighbors < 4 || neighbors > 32) {
    return out_of_range("neighbors must lie between 4 and 32", "neighbors", 32,
                        static_cast<double>(neighbors));
  }
  return {};
}

Points usable_normals(const Cloud& cloud, const NeighborGraph& graph, const ExecutionContext& context) {
  Points normal;
  estimate_normals(cloud.position, graph, NormalParams{}, normal, &context);
  if (context.is_cancelled() || !cloud.has_normals()) return normal;
  return adopt_normals(cloud.normal, normal);
}

Result<RestSurface> rest_surface(const Cloud& cloud, std::uint32_t neighbors,
                                 const ExecutionContext& context) {
  if (const auto valid = validate_neighbors(neighbors); !valid) return valid.error();
  if (cloud.size() == 0) {
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the cloud has no samples", .field = "cloud"};
  }
  RestSurface rest;
  context.begin_phase("neighbours", 0.0);
  rest.graph = build_neighbor_graph(cloud.position, neighbors, &context);
  if (context.is_cancelled()) return cancelled_error();
  context.begin_phase("normals", 0.35);
  rest.normal = usable_normals(cloud, rest.graph, context);
  if (context.is_cancelled()) return cancelled_error();
  if (!cloud.has_normals()) {
    rest.component_count = orient_normals(cloud.position, rest.graph, rest.normal, &context).components;
  }
  if (context.is_cancelled()) return cancelled_error();
  return rest;
}

}  // namespace pointwright
