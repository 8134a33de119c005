#include "engine/editing/image_shape.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>

#include "engine/editing/shape_checks.h"

namespace pointwright {
namespace {

// Sine of the angle between u and v below which they count as parallel.
constexpr double kMinSine = 1e-9;
// Of coordinates: what culling leaves to the rounding of the exact test.
constexpr double kSlack = 1e-12;

constexpr const char* kParallel = "u and v must not be zero or parallel";

Result<void> validate_one(const TextureProjection&) {
  return {};
}

Result<void> validate_one(const PlanarProjection& plane) {
  if (auto origin = check_numbers(plane.origin.data(), 3, "shape.projection.origin"); !origin) return origin;
  if (auto u = check_numbers(plane.u.data(), 3, "shape.projection.u"); !u) return u;
  if (auto v = check_numbers(plane.v.data(), 3, "shape.projection.v"); !v) return v;
  if (plane.u.cwiseAbs().maxCoeff() < kMinDirectionLength)
    return shape_error(ErrorCode::kInvalidArgument, kParallel, "shape.projection.u");
  if (plane.v.cwiseAbs().maxCoeff() < kMinDirectionLength ||
      plane.u.normalized().cross(plane.v.normalized()).norm() < kMinSine)
    return shape_error(ErrorCode::kInvalidArgument, kParallel, "shape.projection.v");
  if (!plane.depth) return {};
  if (auto depth = check_numbers(plane.depth->data(), 2, "shape.projection.depth"); !depth) return depth;
  if ((*plane.depth)[0] > (*plane.depth)[1])
    return shape_error(ErrorCode::kInvalidArgument, "the depth must not end before it starts",
                       "shape.projection.depth");
  return {};
}

// The two pixels around a coordinate in pixels, and how far it is from the first to the second.
struct Neighbors {
  std::size_t first;
  std::size_t second;
  double part;
};

Neighbors neighbors(double at, std::uint32_t size, bool repeat) {
  const double middle = at - 0.5;
  const double below = std::floor(middle);
  const auto last = static_cast<std::int64_t>(size) - 1;
  const auto i = static_cast<std::int64_t>(below);  // -1 to last
  const std::int64_t first = i >= 0 ? i : (repeat ? last : 0);
  const std::int64_t second = i < last ? i + 1 : (repeat ? 0 : last);
  return {static_cast<std::size_t>(first), static_cast<std::size_t>(second), middle - below};
}

bool is_within_unit(double x) {
  return x >= 0.0 && x <= 1.0;
}

}  // namespace

Result<void> validate_image_shape(const ImageShape& shape) {
  if (auto threshold = check_numbers(&shape.threshold, 1, "shape.threshold"); !threshold) return threshold;
  if (!is_within_unit(shape.threshold)) {
    Error error =
        shape_error(ErrorCode::kOutOfRange, "the threshold must lie between 0 and 1", "shape.threshold");
    error.limit = shape.threshold < 0.0 ? 0.0 : 1.0;
    error.actual = shape.threshold;
    return error;
  }
  return std::visit([](const auto& projection) { return validate_one(projection); }, shape.projection);
}

ImageCover::ImageCover(const ImageShape& shape)
    : shape_(&shape), image_(shape.image.get()), full_(image_->bytes_per_value == 1 ? 255.0 : 65535.0) {
  const auto* plane = std::get_if<PlanarProjection>(&shape.projection);
  if (plane == nullptr) return;
  // Directions and lengths apart: the lengths' products might leave the range of doubles.
  const Vec3d u = plane->u.normalized();
  const Vec3d v = plane->v.normalized();
  const Vec3d across = u.cross(v);
  const double sine_sq = across.squaredNorm();
  u_gradient_ = v.cross(across) / sine_sq / plane->u.norm();
  v_gradient_ = across.cross(u) / sine_sq / plane->v.norm();
  normal_ = across.normalized();
}

bool ImageCover::covers(const Vec3d& point, const TexCoord* texcoord) const {
  if (const auto* plane = std::get_if<PlanarProjection>(&shape_->projection)) {
    const Vec3d from_corner = point - plane->origin;
    if (plane->depth) {
      const double depth = from_corner.dot(normal_);
      if (!(depth >= (*plane->depth)[0] && depth <= (*plane->depth)[1])) return false;
    }
    return covers_at(from_corner.dot(u_gradient_), from_corner.dot(v_gradient_), false);
  }
  if (texcoord == nullptr) return false;
  const bool repeat = std::get<TextureProjection>(shape_->projection).repeat;
  double u = (*texcoord)[0];
  double v = (*texcoord)[1];
  if (repeat) {
    u -= std::floor(u);
    v -= std::floor(v);
  }
  return covers_at(u, v, repeat);
}

bool ImageCover::covers_at(double u, double v, bool repeat) const {
  if (!is_within_unit(u) || !is_within_unit(v)) return false;  // NaN as well
  const Neighbors x = neighbors(u * image_->width, image_->width, repeat);
  const Neighbors y = neighbors((1.0 - v) * image_->height, image_->height, repeat);
  const std::array<Pixel, 4> pixels{pixel(x.first, y.first), pixel(x.second, y.first),
                                    pixel(x.first, y.second), pixel(x.second, y.second)};
  const std::array<double, 4> parts{(1.0 - x.part) * (1.0 - y.part), x.part * (1.0 - y.part),
                                    (1.0 - x.part) * y.part, x.part * y.part};
  double opacity = 0.0;
  double difference = 0.0;  // relative to one pixel: where all are alike, the value is theirs to the bit
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const double weight = parts[k] * pixels[k].weight;
    opacity += weight;
    difference += weight * (pixels[k].value - pixels[0].value);
  }
  if (opacity < 0.5) return false;
  const double value = pixels[0].value + difference / opacity;
  return (value >= shape_->threshold) == shape_->above;
}

ImageCover::Pixel ImageCover::pixel(std::size_t x, std::size_t y) const {
  const std::size_t at = (y * image_->width + x) * image_->channels;
  const double alpha = image_->has_alpha() ? channel_value(at + image_->channels - 1) / full_ : 1.0;
  switch (shape_->channel) {
    case ImageChannel::kAlpha:
      return {.value = alpha};
    case ImageChannel::kLuminance:
      if (!image_->has_colors()) break;
      // Whole numbers, so that white is 1 and grey its own value.
      return {.value = (2126.0 * channel_value(at) + 7152.0 * channel_value(at + 1) +
                        722.0 * channel_value(at + 2)) /
                       (10'000.0 * full_),
              .weight = alpha};
    case ImageChannel::kRed:
      break;
    case ImageChannel::kGreen:
      return {.value = channel_value(image_->has_colors() ? at + 1 : at) / full_, .weight = alpha};
    case ImageChannel::kBlue:
      return {.value = channel_value(image_->has_colors() ? at + 2 : at) / full_, .weight = alpha};
  }
  return {.value = channel_value(at) / full_, .weight = alpha};
}

double ImageCover::channel_value(std::size_t at) const {
  if (image_->bytes_per_value == 1) return static_cast<double>(image_->values[at]);
  std::uint16_t value = 0;
  std::memcpy(&value, image_->values.data() + at * sizeof(value), sizeof(value));
  return value;
}

bool ImageCover::may_cover(const Vec3d& center, const Vec3d& half_edges) const {
  const auto* plane = std::get_if<PlanarProjection>(&shape_->projection);
  if (plane == nullptr) return true;
  const Vec3d from_corner = center - plane->origin;
  const Vec3d rounding = (center.cwiseAbs() + plane->origin.cwiseAbs() + half_edges) * kSlack;
  const auto reaches = [&](const Vec3d& gradient, double low, double high) {
    const double middle = from_corner.dot(gradient);
    const double reach = gradient.cwiseAbs().dot(half_edges + rounding) +
                         kSlack * (std::abs(middle) + std::abs(low) + std::abs(high));
    return middle + reach >= low && middle - reach <= high;
  };
  if (!reaches(u_gradient_, 0.0, 1.0) || !reaches(v_gradient_, 0.0, 1.0)) return false;
  return !plane->depth || reaches(normal_, (*plane->depth)[0], (*plane->depth)[1]);
}

}  // namespace pointwright
