#include "server/cli/geometry_commands.h"

#include <sstream>

#include "engine/core/moved_cloud.h"
#include "engine/normals/estimation.h"
#include "engine/normals/rest_surface.h"
#include "engine/simplification/attributes.h"
#include "engine/simplification/simplification.h"
#include "engine/simplification/subsample.h"
#include "engine/smoothing/smoothing_hierarchy.h"
#include "engine/smoothing/umbrella.h"
#include "engine/smoothing/v_cycle.h"

namespace pointwright::server {
namespace {

Error wrong_option(std::string message, std::string field) {
  return Error{.code = ErrorCode::kInvalidArgument, .message = std::move(message), .field = std::move(field)};
}

Result<VolumePreservation> preservation_of(const std::string& name) {
  if (name == "none") return VolumePreservation::kNone;
  if (name == "local") return VolumePreservation::kLocal;
  if (name == "global") return VolumePreservation::kGlobal;
  if (name == "taubin") return VolumePreservation::kTaubin;
  return wrong_option("none, local, global or taubin", "preserve");
}

Result<Points> smoothed_points(const Cloud& cloud, const RestSurface& rest, const SmoothOptions& options,
                               VolumePreservation preserve, std::string& report) {
  std::ostringstream line;
  if (options.iterations) {
    line << *options.iterations << " umbrella steps";
    report = line.str();
    return smooth(cloud.position, rest.normal, rest.graph,
                  {.preserve = preserve, .iterations = *options.iterations});
  }
  const auto diagonal = static_cast<double>(bounds_of(cloud.position).diagonal());
  const auto scale = static_cast<float>(*options.scale * diagonal);
  auto hierarchy =
      build_smoothing_hierarchy(cloud.position, rest.normal, rest.graph, scale, contracting_coarsener());
  if (!hierarchy) return hierarchy.error();
  auto cycle = v_cycle(cloud.position, rest.normal, rest.graph, hierarchy.value(),
                       {.scale = scale, .preserve = preserve});
  if (!cycle) return cycle.error();
  line << "a V-cycle over " << cycle.value().depth << " coarser clouds, scale "
       << static_cast<double>(cycle.value().scale) / (diagonal > 0.0 ? diagonal : 1.0) << " of the diagonal";
  report = line.str();
  return std::move(cycle).value().points;
}

Result<SimplifyTarget> target_of(const Cloud& cloud, const SimplifyOptions& options) {
  if (int{options.count.has_value()} + int{options.ratio.has_value()} + int{options.error.has_value()} != 1)
    return wrong_option("one of --count, --ratio and --error", "");
  if (options.count) return SimplifyTarget(KeepCount{.count = *options.count});
  if (options.ratio) return SimplifyTarget(KeepRatio{.ratio = *options.ratio});
  const auto diagonal = static_cast<double>(bounds_of(cloud.position).diagonal());
  return SimplifyTarget(KeepWithin{.error = static_cast<float>(*options.error * diagonal)});
}

constexpr std::uint32_t kNeighbors = 10;

Result<Cloud> contracted(const Cloud& cloud, const SimplifyOptions& options, const SimplifyTarget& target) {
  const auto rest = rest_surface(cloud, options.neighbors.value_or(kNeighbors), ExecutionContext{});
  if (!rest) return rest.error();
  const auto result = simplify(cloud.position, rest.value().normal, rest.value().graph, {.target = target});
  if (!result) return result.error();
  return simplified_cloud(result.value(), cloud);
}

// Normals tell the sheets of thin parts apart where the cloud has them.
Result<Cloud> chosen_evenly(const Cloud& cloud, const SimplifyOptions& options) {
  if (options.error) return wrong_option("an error bound is for --method quadrics", "error");
  if (options.neighbors) return wrong_option("neighbourhoods are for --method quadrics", "neighbors");
  SubsampleParams params;
  if (options.count) params.target = KeepCount{.count = *options.count};
  if (options.ratio) params.target = KeepRatio{.ratio = *options.ratio};
  const auto kept = subsample(cloud.position, cloud.normal, params);
  if (!kept) return kept.error();
  return chosen_cloud(cloud, kept.value());
}

}  // namespace

Result<Cloud> smoothed(const Cloud& cloud, const SmoothOptions& options, std::string& report) {
  if (options.scale.has_value() == options.iterations.has_value())
    return wrong_option("one of --scale and --iterations", "scale");
  if (options.scale && !(*options.scale > 0.0 && *options.scale <= 0.2))
    return wrong_option("a scale lies between 0 and 0.2 of the diagonal", "scale");
  const auto preserve = preservation_of(options.preserve);
  if (!preserve) return preserve.error();
  const auto rest = rest_surface(cloud, options.neighbors, ExecutionContext{});
  if (!rest) return rest.error();
  auto points = smoothed_points(cloud, rest.value(), options, preserve.value(), report);
  if (!points) return points.error();
  Points normal = rest.value().normal;
  refit_normals(points.value(), rest.value().graph, normal);
  return moved_cloud(cloud, points.value(), normal);
}

Result<Cloud> simplified(const Cloud& cloud, const SimplifyOptions& options, std::string& report) {
  if (options.method != "quadrics" && options.method != "uniform")
    return wrong_option("quadrics or uniform", "method");
  const auto target = target_of(cloud, options);
  if (!target) return target.error();
  auto result = options.method == "uniform" ? chosen_evenly(cloud, options)
                                            : contracted(cloud, options, target.value());
  if (!result) return result.error();
  std::ostringstream line;
  line << cloud.size() << " samples to " << result.value().size();
  report = line.str();
  return result;
}

}  // namespace pointwright::server
