#include "engine/editing/visibility.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/spatial/splat_radius.h"

namespace pointwright {
namespace {

constexpr std::size_t kMaxTexels = 2048;  // a side
// Half of a disc's box is at most this many texels of the level it is drawn on, and more than half as many.
constexpr double kDiscTexels = 4.0;
// Texels of the finest level to a mean radius.
constexpr double kTexelsPerRadius = 3.0;
// A disc in front of a sample hides it from this many radii on, measured across the surface.
constexpr double kRadii = 2.0;
// Flatter views of a surface count as this steep: what is farther across is not farther away.
constexpr double kLeastCosine = 0.2;
// Of the distance to the eye's plane: discs that come nearer are drawn as if they did not.
constexpr double kLeastApproach = 0.25;
// Where w changes less than this across the samples the view is a parallel one.
constexpr double kParallel = 1e-9;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A rectangle of normalised device coordinates, or of texels; empty while low > high.
struct Rectangle {
  Vec2d low = Vec2d::Constant(kInfinity);
  Vec2d high = Vec2d::Constant(-kInfinity);

  [[nodiscard]] bool meets(const Vec2d& center, const Vec2d& half) const {
    return (center + half).cwiseMax(low) == center + half && (center - half).cwiseMin(high) == center - half;
  }
  [[nodiscard]] bool holds(const Vec2d& point) const { return meets(point, Vec2d::Zero()); }
};

Rectangle bounds_of_outline(const ScreenShape& shape) {
  Rectangle box;
  const auto extend = [&](const std::vector<Vec2d>& vertices, double reach) {
    for (const Vec2d& vertex : vertices) {
      box.low = box.low.cwiseMin(vertex - Vec2d::Constant(reach));
      box.high = box.high.cwiseMax(vertex + Vec2d::Constant(reach));
    }
  };
  if (const auto* polygon = std::get_if<ScreenPolygon>(&shape.outline)) extend(polygon->vertices, 0.0);
  if (const auto* line = std::get_if<ScreenPolyline>(&shape.outline))
    extend(line->vertices, 0.5 * line->width);
  if (const auto* ellipse = std::get_if<ScreenEllipse>(&shape.outline))
    box = {.low = ellipse->center - ellipse->half_axes, .high = ellipse->center + ellipse->half_axes};
  // The exact tests of outlines round.
  const Vec2d margin = 1e-9 * (box.low.cwiseAbs() + box.high.cwiseAbs());
  return {.low = box.low - margin, .high = box.high + margin};
}

// Where the view shows a sample.
struct Seen {
  Vec2d at = Vec2d::Zero();        // normalised device coordinates
  double depth = 0.0;              // along the axis of the view, model units
  Vec2d per_unit = Vec2d::Zero();  // how far it moves on the screen at most, for a move of one model unit
  Vec2d half = Vec2d::Zero();      // of the box around its disc
};

// The view, relative to the samples' origin.
class View {
 public:
  View(const std::array<double, 16>& rows, const Vec3d& origin, double extent) {
    const Eigen::Matrix4d view = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data());
    to_clip_ = view;
    to_clip_.col(3) += view.leftCols<3>() * origin;
    const Eigen::Matrix4d back = to_clip_.fullPivLu().inverse();
    // Rays: all points of clip-space x / w, y / w are combinations of back (x, y, 0, 1) and of the eye.
    const Eigen::Vector4d eye = back.col(2);
    steepness_ = to_clip_.row(3).head<3>().norm();
    if (steepness_ * extent <= kParallel * std::abs(to_clip_(3, 3))) {
      steepness_ = 0.0;
      const Vec3d axis = eye.head<3>().normalized();
      axis_ = axis;
      dir_.col(2) = axis;
      for (int i = 0; i < 3; ++i) {
        const Vec3d base = back.col(kColumns[i]).head<3>() * to_clip_(3, 3);
        from_.col(i) = base - axis.dot(base) * axis;
      }
    } else {
      from_.col(2) = eye.head<3>() / eye.w();
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector4d h = back.col(kColumns[i]);
        dir_.col(i) = steepness_ * (h.head<3>() - h.w() * from_.col(2));
      }
    }
  }

  // Nothing where the view does not show the place.
  [[nodiscard]] std::optional<Seen> see(const Vec3d& place, double radius) const {
    const Eigen::Vector4d clip = to_clip_ * place.homogeneous();
    const double w = clip.w();
    if (!(w > 0.0) || !(std::abs(clip.z()) <= w)) return {};
    Seen seen{.at = clip.head<2>() / w};
    seen.depth = steepness_ > 0.0 ? w / steepness_ : axis_.dot(place);
    for (int axis = 0; axis < 2; ++axis) {
      const Vec3d slope = to_clip_.row(axis).head<3>() - seen.at[axis] * to_clip_.row(3).head<3>();
      seen.per_unit[axis] = slope.norm() / w;
    }
    seen.half = seen.per_unit * (radius * w / std::max(w - radius * steepness_, kLeastApproach * w));
    if (!seen.at.allFinite() || !seen.half.allFinite() || !std::isfinite(seen.depth)) return {};
    return seen;
  }

  // By how much what the screen shows at one size is smaller at the depth `to`.
  [[nodiscard]] double shrinkage(double from, double to) const {
    return steepness_ > 0.0 ? std::max(to, 0.0) / from : 1.0;
  }

  // The ray through a point of the screen: the place at depth s is from + s dir.
  struct Ray {
    Vec3d from;
    Vec3d dir;
  };
  [[nodiscard]] Ray ray(const Vec2d& at) const {
    const Vec3d weight(at.x(), at.y(), 1.0);
    return {.from = from_ * weight, .dir = dir_ * weight};
  }

 private:
  static constexpr std::array<int, 3> kColumns{0, 1, 3};  // of (x, y, 0, 1)
  Eigen::Matrix4d to_clip_;
  double steepness_ = 0.0;  // length of the gradient of w; 0 for parallel views
  Vec3d axis_ = Vec3d::Zero();
  Mat3d from_ = Mat3d::Zero();  // by (x, y, 1)
  Mat3d dir_ = Mat3d::Zero();
};

// A sample as a disc.
struct Disc {
  Vec3d center;
  Vec3d normal;
  double radius;

  // The depth at which the ray passes its plane, where that is no farther off than `reach`.
  [[nodiscard]] std::optional<double> depth(const View::Ray& ray, double reach) const {
    const Vec3d to_center = center - ray.from;
    const double s = normal.dot(to_center) / normal.dot(ray.dir);
    if (!((s * ray.dir - to_center).squaredNorm() <= reach * reach)) return {};
    return s;
  }
};

// What is drawn, and looked up: the samples in the box around the outline.
struct Scene {
  Rectangle box;  // of their places
  double least_depth = kInfinity;
  double greatest_depth = -kInfinity;
  Vec2d half_sum = Vec2d::Zero();
  double count = 0.0;

  friend Scene operator+(Scene a, const Scene& b) {
    a.box.low = a.box.low.cwiseMin(b.box.low);
    a.box.high = a.box.high.cwiseMax(b.box.high);
    a.least_depth = std::min(a.least_depth, b.least_depth);
    a.greatest_depth = std::max(a.greatest_depth, b.greatest_depth);
    a.half_sum += b.half_sum;
    a.count += b.count;
    return a;
  }
};

// The least depth of every texel, on levels of half as many texels a side each.
class DepthPyramid {
 public:
  explicit DepthPyramid(const Scene& scene) : low_(scene.box.low), least_(scene.least_depth) {
    const double range = scene.greatest_depth - scene.least_depth;
    step_ = range > 0.0 ? range / kSteps : 1.0;
    const Vec2d size = scene.box.high - scene.box.low;
    std::array<std::size_t, 2> side{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      const double wanted = size[i] / (scene.half_sum[i] / scene.count) * kTexelsPerRadius;
      side[axis] = wanted >= 1.0 ? static_cast<std::size_t>(std::min(wanted, double{kMaxTexels})) : 1;
      // A narrow outline is one texel wide, and that as wide as those of a broad one: discs cover it alike.
      const double least = scene.half_sum[i] / scene.count / kTexelsPerRadius;
      texel_[i] = std::max(size[i] / static_cast<double>(side[axis]), least);
      if (!(texel_[i] > 0.0)) texel_[i] = 1.0;
    }
    for (;;) {
      levels_.push_back({.columns = side[0], .rows = side[1], .least = {}});
      levels_.back().least.assign(side[0] * side[1], kEmpty);
      if (side[0] == 1 && side[1] == 1) break;
      for (std::size_t& count : side) count = (count + 1) / 2;
    }
  }

  [[nodiscard]] std::size_t level_count() const { return levels_.size(); }
  [[nodiscard]] Vec2d texel(std::size_t level) const {
    return texel_ * static_cast<double>(std::size_t{1} << level);
  }

  struct Texel {
    std::size_t column;
    std::size_t row;
  };
  // The nearest texel for places outside.
  [[nodiscard]] Texel texel_at(std::size_t level, const Vec2d& at) const {
    const Vec2d place = (at - low_).cwiseQuotient(texel(level));
    return {.column = clamped(place.x(), levels_[level].columns),
            .row = clamped(place.y(), levels_[level].rows)};
  }
  [[nodiscard]] Vec2d center(std::size_t level, const Texel& at) const {
    const Vec2d place(static_cast<double>(at.column) + 0.5, static_cast<double>(at.row) + 0.5);
    return low_ + place.cwiseProduct(texel(level));
  }

  // The finest level on which the half box is few texels.
  [[nodiscard]] std::size_t level_of(const Vec2d& half) const {
    std::size_t level = 0;
    while (level + 1 < levels_.size() && half.cwiseQuotient(texel(level)).maxCoeff() > kDiscTexels) ++level;
    return level;
  }

  // Any thread.
  void lower(std::size_t level, const Texel& at, double depth) {
    const std::atomic_ref<std::uint32_t> least(slot(level, at));
    const std::uint32_t mine = stepped(depth);
    std::uint32_t now = least.load(std::memory_order_relaxed);
    while (mine < now && !least.compare_exchange_weak(now, mine, std::memory_order_relaxed)) {
    }
  }
  // Infinite where nothing was drawn.
  [[nodiscard]] double least(std::size_t level, const Texel& at) const {
    const std::uint32_t steps = levels_[level].least[at.row * levels_[level].columns + at.column];
    return steps == kEmpty ? kInfinity : least_ + static_cast<double>(steps) * step_;
  }

 private:
  static constexpr std::uint32_t kEmpty = std::numeric_limits<std::uint32_t>::max();
  static constexpr double kSteps = 4294967294.0;

  struct Level {
    std::size_t columns;
    std::size_t rows;
    std::vector<std::uint32_t> least;  // in steps, row after row
  };

  static std::size_t clamped(double place, std::size_t count) {
    return static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(count - 1)));
  }
  [[nodiscard]] std::uint32_t stepped(double depth) const {
    return static_cast<std::uint32_t>(std::clamp((depth - least_) / step_, 0.0, kSteps));
  }
  std::uint32_t& slot(std::size_t level, const Texel& at) {
    return levels_[level].least[at.row * levels_[level].columns + at.column];
  }

  Vec2d low_;
  Vec2d texel_;
  double least_;
  double step_ = 1.0;
  std::vector<Level> levels_;
};

// One look at the surface.
class Look {
 public:
  Look(const ScreenShape& shape, const PaintSurface& surface)
      : surface_(surface),
        box_(bounds_of_outline(shape)),
        radius_(splat_radii(surface.position, surface.normal, *surface.graph)),
        view_(shape.view, surface.origin, static_cast<double>(bounds_of(surface.position).diagonal())) {}

  [[nodiscard]] Scene scene(const ExecutionContext* context) const {
    return parallel_sum<Scene>(surface_.position.size(), {}, [&](std::size_t begin, std::size_t end) {
      Scene part;
      if (context != nullptr && context->is_cancelled()) return part;
      for (std::size_t i = begin; i < end; ++i) {
        const std::optional<Seen> seen = see(i);
        if (!seen) continue;
        part.least_depth = std::min(part.least_depth, seen->depth);
        part.greatest_depth = std::max(part.greatest_depth, seen->depth);
        // Discs far off the axis, whose boxes are huge, say nothing about the texels that are needed.
        if (!box_.holds(seen->at)) continue;
        part.box.low = part.box.low.cwiseMin(seen->at);
        part.box.high = part.box.high.cwiseMax(seen->at);
        part.half_sum += seen->half;
        part.count += 1.0;
      }
      return part;
    });
  }

  void draw(std::size_t i, DepthPyramid& pyramid) const {
    const std::optional<Seen> seen = see(i);
    if (!seen) return;
    const Disc disc = disc_of(i);
    const std::size_t level = pyramid.level_of(seen->half);
    const DepthPyramid::Texel low = pyramid.texel_at(level, seen->at - seen->half);
    const DepthPyramid::Texel high = pyramid.texel_at(level, seen->at + seen->half);
    for (std::size_t row = low.row; row <= high.row; ++row) {
      for (std::size_t column = low.column; column <= high.column; ++column) {
        const DepthPyramid::Texel texel{.column = column, .row = row};
        const auto depth = disc.depth(view_.ray(pyramid.center(level, texel)), disc.radius);
        if (depth) pyramid.lower(level, texel, *depth);
      }
    }
    // However small it is, or seen from its edge.
    if (box_.holds(seen->at)) pyramid.lower(level, pyramid.texel_at(level, seen->at), seen->depth);
  }

  [[nodiscard]] bool is_visible(std::size_t i, const DepthPyramid& pyramid) const {
    const std::optional<Seen> seen = see(i);
    if (!seen || !box_.holds(seen->at)) return false;
    const Disc disc = disc_of(i);
    for (std::size_t level = 0; level < pyramid.level_count(); ++level) {
      const DepthPyramid::Texel texel = pyramid.texel_at(level, seen->at);
      const double least = pyramid.least(level, texel);
      if (least >= seen->depth) continue;
      // The size of a texel here, and where it was drawn; discs of coarse levels are larger than two of
      // theirs.
      const double size = pyramid.texel(level).cwiseQuotient(seen->per_unit).maxCoeff();
      const double drawn = size * view_.shrinkage(seen->depth, least);
      const View::Ray ray = view_.ray(pyramid.center(level, texel));
      const double own = disc.depth(ray, std::max(disc.radius, 2.0 * size)).value_or(seen->depth);
      const double reach = std::max({disc.radius, size, level > 0 ? 0.5 * kDiscTexels * drawn : 0.0});
      const double length = ray.dir.norm();
      const double cosine = std::abs(disc.normal.dot(ray.dir)) / length;
      const double tolerance = kRadii * reach / (std::max(cosine, kLeastCosine) * length);
      if (least < std::min(own, seen->depth) - tolerance) return false;
    }
    return true;
  }

 private:
  [[nodiscard]] std::optional<Seen> see(std::size_t i) const {
    const std::optional<Seen> seen = view_.see(surface_.position[i].cast<double>(), double{radius_[i]});
    return seen && box_.meets(seen->at, seen->half) ? seen : std::nullopt;
  }
  [[nodiscard]] Disc disc_of(std::size_t i) const {
    return {.center = surface_.position[i].cast<double>(),
            .normal = surface_.normal[i].cast<double>(),
            .radius = double{radius_[i]}};
  }

  const PaintSurface& surface_;
  Rectangle box_;
  std::vector<float> radius_;
  View view_;
};

}  // namespace

SampleMask visible_samples(const ScreenShape& shape, const PaintSurface& surface,
                           const ExecutionContext* context) {
  const std::size_t n = surface.position.size();
  POINTWRIGHT_CHECK(surface.normal.size() == n, "one normal per sample");
  POINTWRIGHT_CHECK(surface.graph != nullptr && surface.graph->count == n, "the graph of the samples");
  SampleMask visible(n, 0);
  const Look look(shape, surface);
  const Scene scene = look.scene(context);
  if (scene.count <= 0.0 || (context != nullptr && context->is_cancelled())) return visible;
  DepthPyramid pyramid(scene);
  const auto for_each_sample = [&](const auto& work) {
    parallel_for(
        n,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) work(i);
        },
        kParallelBlock, context);
  };
  for_each_sample([&](std::size_t i) { look.draw(i, pyramid); });
  for_each_sample([&](std::size_t i) { visible[i] = look.is_visible(i, pyramid) ? 1 : 0; });
  return visible;
}

}  // namespace pointwright
