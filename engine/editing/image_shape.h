#pragma once
// Regions drawn in an image that is mapped onto the surface (§4, Figure 10: "texture-mapping the zero- and
// one-regions onto a plane").

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "engine/core/cloud.h"
#include "engine/core/result.h"
#include "engine/core/vector.h"
#include "engine/editing/image.h"

namespace pointwright {

/// What of a pixel counts, from 0 to 1. Grey images give their grey for every colour; without an alpha
/// channel alpha is 1.
enum class ImageChannel {
  kLuminance,  ///< 0.2126 red + 0.7152 green + 0.0722 blue of the stored values
  kRed,
  kGreen,
  kBlue,
  kAlpha,
};

/// By the samples' own texture coordinates: (0, 0) is the image's lower left corner, (1, 1) its upper right.
struct TextureProjection {
  bool repeat = false;  ///< modulo 1; otherwise what is outside [0, 1]^2 is outside the shape
};
/// Laid on a plane, and through space along its normal.
struct PlanarProjection {
  Vec3d origin = Vec3d::Zero();  ///< the image's lower left corner, model space
  Vec3d u = Vec3d::UnitX();      ///< its whole width
  Vec3d v = Vec3d::UnitY();      ///< its whole height; need not be perpendicular to u
  /// Nearest and farthest distance from the plane along u x v, model units; everything where not given.
  std::optional<std::array<double, 2>> depth;
};

/// All places whose value in the image, bilinear between the middles of its pixels, is on one side of a
/// threshold. Colours count by their alpha, so that what hides under transparency does not shine through; a
/// place that is more than half transparent is outside on both sides, unless alpha itself is the channel.
struct ImageShape {
  std::string source;                  ///< the caller's name of the image; nothing here reads it
  std::shared_ptr<const Image> image;  ///< null until it was found: nothing is painted with it then
  ImageChannel channel = ImageChannel::kLuminance;
  double threshold = 0.5;
  bool above = true;  ///< value >= threshold; otherwise value < threshold
  std::variant<TextureProjection, PlanarProjection> projection;
};

/// Of everything but the image.
/// Errors: kNonFinite, kOutOfRange for a threshold beyond 0 and 1 and for numbers beyond 1e12;
///         kInvalidArgument for u and v that are zero or parallel and for a depth whose end is before its
///         start. Fields "shape.threshold", "shape.projection.origin" and the like.
Result<void> validate_image_shape(const ImageShape& shape);

/// The places that an image covers. It refers to the shape, which must be valid and have its image.
class ImageCover {
 public:
  explicit ImageCover(const ImageShape& shape);

  /// Whether the shape holds a sample. `texcoord`: null where it has none; then no texture covers it.
  /// Cost: O(1)
  [[nodiscard]] bool covers(const Vec3d& point, const TexCoord* texcoord) const;
  /// Whether a box around `center` may hold a point of the shape; true for a texture.
  [[nodiscard]] bool may_cover(const Vec3d& center, const Vec3d& half_edges) const;

 private:
  struct Pixel {
    double value = 0.0;
    double weight = 1.0;  // alpha; 1 where alpha is the value
  };
  [[nodiscard]] bool covers_at(double u, double v, bool repeat) const;
  [[nodiscard]] Pixel pixel(std::size_t x, std::size_t y) const;
  [[nodiscard]] double channel_value(std::size_t at) const;

  const ImageShape* shape_;
  const Image* image_;
  double full_ = 255.0;  // the greatest stored value
  // Of a plane: the gradients of the image's coordinates and of the depth.
  Vec3d u_gradient_ = Vec3d::Zero();
  Vec3d v_gradient_ = Vec3d::Zero();
  Vec3d normal_ = Vec3d::Zero();
};

}  // namespace pointwright
