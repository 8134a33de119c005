// Desbrun et al., "Implicit fairing of irregular meshes using diffusion and curvature flow", 1999, section
// 3.4: the volume by the divergence theorem, and the scaling that restores it.
#include "engine/smoothing/global_volume.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"

namespace pointwright {
namespace {

constexpr int kAverages = 2;
// Length lost between two restorings, and the iterations between them at most.
constexpr double kLossBetween = 0.005;
constexpr double kMostSteps = 10.0;
// Volume over area^(3/2), 0.094 for a sphere: a plate of 2e-4 of its width has less than this.
constexpr double kLeastVolume = 1e-4;

Error no_volume(std::string why) {
  return Error{.code = ErrorCode::kInvalidArgument, .message = std::move(why), .field = "preserve"};
}

}  // namespace

void GlobalVolume::average_normals() {
  Packed from(normal_);
  Packed to(normal_.size());
  for (int pass = 0; pass < kAverages; ++pass) {
    parallel_for(normal_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3f own = from[i];
        Vec3f sum = own;
        for (std::uint32_t j = 0; j < graph_->k; ++j) {
          const Vec3f other = from[graph_->index(i, j)];
          if (own.dot(other) > 0.0F) sum += other;
        }
        sum.normalize();
        to.data()[i] = Float4{sum.x(), sum.y(), sum.z(), 0.0F};
      }
    });
    std::swap(from, to);
  }
  direction_ = std::move(from);
}

// In two passes: positions may lie far from 0.
GlobalVolume::Moments GlobalVolume::moments(const Packed& points) const {
  const auto sum = [&](const Vec3d& center) {
    return parallel_sum<Moments>(points.size(), Moments{}, [&](std::size_t begin, std::size_t end) {
      Moments part;
      for (std::size_t i = begin; i < end; ++i) {
        const auto area = static_cast<double>(area_[i]);
        const Vec3d a = area * direction_[i].cast<double>();
        const Vec3d p = points[i].cast<double>() - center;
        part.area += area;
        part.area_vector += a;
        part.centroid += area * p;
        part.volume += a.dot(p);
      }
      return part;
    });
  };
  const Moments first = sum(Vec3d::Zero());
  const Vec3d center = first.area > 0.0 ? Vec3d(first.centroid / first.area) : Vec3d(Vec3d::Zero());
  Moments result = sum(center);
  result.centroid = center;
  result.volume /= 3.0;
  return result;
}

Result<GlobalVolume> GlobalVolume::of(const Points& points, const Points& normals,
                                      const NeighborGraph& graph) {
  std::vector<float> area = local_spacing(points, graph);
  for (float& a : area) a *= a;
  GlobalVolume result(graph, std::move(area), normals);
  result.average_normals();
  const Moments now = result.moments(Packed(points));
  if (!(now.area > 0.0 && std::abs(now.volume) > kLeastVolume * now.area * std::sqrt(now.area))) {
    return no_volume(
        "global rescaling needs samples that enclose a volume, with normals on consistent sides");
  }
  const double open = now.area_vector.norm() / now.area;
  const double limit = 0.1 + 1.0 / std::sqrt(static_cast<double>(points.size()));
  if (open > limit) {
    Error error = no_volume("global rescaling needs a closed surface; local preservation does not");
    error.limit = limit;
    error.actual = open;
    return error;
  }
  result.volume_ = now.volume;
  return result;
}

Result<void> GlobalVolume::restore(Packed& points, std::uint32_t steps) {
  const Moments now = moments(points);
  const double factor = volume_ / now.volume;  // linear in the positions, so not its cube root
  if (!(factor > 0.0 && factor < 1e6)) {
    return no_volume("smoothing takes all of the volume; use fewer iterations or fewer neighbours");
  }
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d p = now.centroid + factor * (points[i].cast<double>() - now.centroid);
      const Vec3f q = p.cast<float>();
      points.data()[i] = Float4{q.x(), q.y(), q.z(), 0.0F};
    }
  });
  const double loss = std::abs(1.0 - 1.0 / factor) / static_cast<double>(std::max(steps, 1U));
  due_ = static_cast<std::uint32_t>(std::clamp(kLossBetween / std::max(loss, 1e-9), 1.0, kMostSteps));
  return {};
}

void GlobalVolume::follow(const Packed& points) {
  Points fitted;
  estimate_normals(points.unpacked(), *graph_, NormalParams{}, fitted);
  parallel_for(fitted.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f n = fitted[i];
      normal_.set(i, n.dot(direction_[i]) < 0.0F ? Vec3f(-n) : n);
    }
  });
  average_normals();
  volume_ = moments(points).volume;
}

}  // namespace pointwright
