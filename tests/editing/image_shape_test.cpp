#include "engine/editing/image_shape.h"

#include <doctest/doctest.h>

#include <cstring>
#include <limits>
#include <random>

#include "engine/editing/painting.h"
#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

using namespace pointwright::test;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// An 8-bit image; value(x, y, channel) with y from the top.
template <typename Value>
std::shared_ptr<const Image> image_of(std::uint32_t width, std::uint32_t height, std::uint32_t channels,
                                      const Value& value) {
  Image image{.width = width, .height = height, .channels = channels, .values = {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        image.values.push_back(static_cast<std::byte>(value(x, y, c)));
  REQUIRE(is_valid(image));
  return std::make_shared<const Image>(std::move(image));
}

std::shared_ptr<const Image> checkerboard(std::uint32_t side) {
  return image_of(side, side, 1, [](auto x, auto y, auto) { return (x + y) % 2 == 0 ? 255 : 0; });
}

// One pixel, or a row of them.
std::shared_ptr<const Image> row_of(std::uint32_t channels, const std::vector<int>& values) {
  return image_of(static_cast<std::uint32_t>(values.size()) / channels, 1, channels,
                  [&](auto x, auto, auto c) { return values[x * channels + c]; });
}

ImageShape on_plane(std::shared_ptr<const Image> image, const PlanarProjection& plane = {}) {
  return {.source = {}, .image = std::move(image), .projection = plane};
}

ImageShape on_texture(std::shared_ptr<const Image> image, bool repeat) {
  return {.source = {}, .image = std::move(image), .projection = TextureProjection{.repeat = repeat}};
}

bool at(const ImageShape& shape, float u, float v) {
  const TexCoord texcoord{u, v};
  return contains(shape, Vec3d::Zero(), &texcoord);
}

void check_refused(const ImageShape& shape, ErrorCode code, const char* field) {
  const Result<void> result = validate(Shape(shape));
  REQUIRE(!result.ok());
  CHECK(result.error().code == code);
  CHECK(result.error().field == field);
}

TEST_CASE("a checkerboard paints its fields, the first row on top") {
  const ImageShape shape = on_plane(checkerboard(8));
  ImageShape other = shape;
  other.above = false;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      const Vec3d middle((x + 0.5) / 8.0, 1.0 - (y + 0.5) / 8.0, 3.0);
      CHECK(contains(shape, middle) == ((x + y) % 2 == 0));
      CHECK(contains(other, middle) == ((x + y) % 2 != 0));
    }
  }
  for (const Vec3d& outside : {Vec3d(-1e-9, 0.5, 0.0), Vec3d(1.0 + 1e-9, 0.5, 0.0), Vec3d(0.5, -1e-9, 0.0),
                               Vec3d(0.5, 1.0 + 1e-9, 0.0)}) {
    CHECK_FALSE(contains(shape, outside));
    CHECK_FALSE(contains(other, outside));
  }
}

TEST_CASE("between the middles of pixels values are linear, beyond the outer ones constant") {
  // Middles at 1/8, 3/8, 5/8, 7/8 with 0, 64, 128, 192 of 255: value = 64 (4 u - 1/2) / 255.
  ImageShape ramp = on_plane(row_of(1, {0, 64, 128, 192}));
  for (int k = 0; k <= 192; k += 3) {
    ramp.threshold = k / 255.0;
    const double border = (k / 64.0 + 0.5) / 4.0;
    CHECK(contains(ramp, Vec3d(border + 1e-9, 0.5, 0.0)));
    if (k > 0) CHECK_FALSE(contains(ramp, Vec3d(border - 1e-9, 0.5, 0.0)));
    ramp.above = false;
    CHECK_FALSE(contains(ramp, Vec3d(border + 1e-9, 0.5, 0.0)));
    if (k > 0) CHECK(contains(ramp, Vec3d(border - 1e-9, 0.5, 0.0)));
    ramp.above = true;
  }
  ramp.threshold = 192 / 255.0;
  CHECK(contains(ramp, Vec3d(1.0, 1.0, 0.0)));
  CHECK(contains(ramp, Vec3d(0.9, 0.0, 0.0)));
  // In both directions: u v of four pixels' middles, along the diagonal.
  ImageShape saddle =
      on_plane(image_of(2, 2, 1, [](auto x, auto y, auto) { return x == 1 && y == 0 ? 255 : 0; }));
  saddle.threshold = 0.25;
  CHECK(contains(saddle, Vec3d(0.5 + 1e-9, 0.5 + 1e-9, 0.0)));
  CHECK_FALSE(contains(saddle, Vec3d(0.5 - 1e-9, 0.5 - 1e-9, 0.0)));
}

TEST_CASE("uniform values meet a threshold of the same value, whatever the channel") {
  const auto colors = image_of(3, 3, 3, [](auto, auto, auto c) { return c == 0 ? 10 : c == 1 ? 100 : 250; });
  const auto check = [&](const std::shared_ptr<const Image>& image, ImageChannel channel, double value) {
    ImageShape shape = on_plane(image);
    shape.channel = channel;
    shape.threshold = value;
    for (const double u : {0.0, 0.13, 0.5, 0.77, 1.0}) {
      CHECK(contains(shape, Vec3d(u, 1.0 - 0.9 * u, 0.0)));
      shape.threshold = std::nextafter(value, 2.0);
      if (shape.threshold <= 1.0) CHECK_FALSE(contains(shape, Vec3d(u, 1.0 - 0.9 * u, 0.0)));
      shape.threshold = value;
    }
  };
  check(colors, ImageChannel::kRed, 10 / 255.0);
  check(colors, ImageChannel::kGreen, 100 / 255.0);
  check(colors, ImageChannel::kBlue, 250 / 255.0);
  check(colors, ImageChannel::kAlpha, 1.0);
  check(colors, ImageChannel::kLuminance, (2126.0 * 10 + 7152.0 * 100 + 722.0 * 250) / (10'000.0 * 255.0));
  const auto white = image_of(2, 2, 3, [](auto, auto, auto) { return 255; });
  check(white, ImageChannel::kLuminance, 1.0);
  const auto grey = image_of(2, 2, 1, [](auto, auto, auto) { return 77; });
  for (const auto channel :
       {ImageChannel::kLuminance, ImageChannel::kRed, ImageChannel::kGreen, ImageChannel::kBlue})
    check(grey, channel, 77 / 255.0);
  Image wide{
      .width = 1, .height = 1, .channels = 1, .bytes_per_value = 2, .values = std::vector<std::byte>(2)};
  const std::uint16_t value = 12'345;
  std::memcpy(wide.values.data(), &value, sizeof(value));
  check(std::make_shared<const Image>(wide), ImageChannel::kLuminance, 12'345 / 65'535.0);
}

TEST_CASE("transparency paints nothing on either side, and its colour does not shine through") {
  // White, opaque; black, transparent: whatever is at least half opaque is white.
  ImageShape shape = on_plane(row_of(2, {255, 255, 0, 0}));
  shape.threshold = 1.0;
  CHECK(contains(shape, Vec3d(0.25, 0.5, 0.0)));
  CHECK(contains(shape, Vec3d(0.5 - 1e-9, 0.5, 0.0)));
  CHECK_FALSE(contains(shape, Vec3d(0.5 + 1e-9, 0.5, 0.0)));
  shape.above = false;
  for (const double u : {0.1, 0.4, 0.6, 0.9}) CHECK_FALSE(contains(shape, Vec3d(u, 0.5, 0.0)));
  shape.channel = ImageChannel::kAlpha;
  shape.threshold = 0.5;
  CHECK_FALSE(contains(shape, Vec3d(0.5 - 1e-9, 0.5, 0.0)));
  CHECK(contains(shape, Vec3d(0.9, 0.5, 0.0)));
}

TEST_CASE("texture coordinates end at the border, or go round") {
  const auto image = row_of(1, {255, 0, 0, 0});
  const ImageShape once = on_texture(image, false);
  CHECK(at(once, 0.0F, 0.5F));
  CHECK(at(once, 0.125F, 1.0F));
  CHECK_FALSE(at(once, 0.26F, 0.5F));
  CHECK_FALSE(at(once, 0.99F, 0.5F));
  for (const float u :
       {-0.01F, 1.01F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    CHECK_FALSE(at(once, u, 0.5F));
    CHECK_FALSE(at(once, 0.125F, u));
  }
  // The white pixel's middle is at 1/8: half its value is reached half a pixel before and after, across the
  // seam too.
  const ImageShape around = on_texture(image, true);
  for (const float turn : {-3.0F, -1.0F, 0.0F, 1.0F, 7.0F}) {
    CHECK(at(around, turn + 0.125F, turn + 0.5F));
    CHECK(at(around, turn + 0.01F, 0.5F));
    CHECK(at(around, turn + 0.24F, 0.5F));
    CHECK_FALSE(at(around, turn + 0.26F, 0.5F));
    CHECK_FALSE(at(around, turn + 0.99F, 0.5F));
  }
  ImageShape low = around;
  low.threshold = 0.25;  // the ramp from the last pixel's middle at 7/8 over the seam to 9/8
  CHECK(at(low, 0.94F, 0.5F));
  CHECK_FALSE(at(low, 0.93F, 0.5F));
  CHECK_FALSE(at(on_texture(image, false), 0.94F, 0.5F));
  CHECK_FALSE(at(around, std::numeric_limits<float>::quiet_NaN(), 0.5F));
  CHECK_FALSE(at(around, std::numeric_limits<float>::infinity(), 0.5F));
  CHECK_FALSE(contains(around, Vec3d::Zero()));
}

TEST_CASE("a plane may be skewed, turned and far from zero, and end in depth") {
  const Vec3d origin(500'000.25, 5'400'000.5, -120.125);
  const PlanarProjection plane{
      .origin = origin, .u = Vec3d(3.0, 4.0, 0.0), .v = Vec3d(1.0, 2.0, 6.0), .depth = {{-0.5, 2.0}}};
  const ImageShape shape = on_plane(checkerboard(4), plane);
  REQUIRE(validate(Shape(shape)).ok());
  const Vec3d normal = plane.u.cross(plane.v).normalized();
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      const double u = (x + 0.5) / 4.0;
      const double v = 1.0 - (y + 0.5) / 4.0;
      for (const double depth : {-0.49, 0.0, 1.99})
        CHECK(contains(shape, origin + u * plane.u + v * plane.v + depth * normal) == ((x + y) % 2 == 0));
      for (const double depth : {-0.51, 2.01})
        CHECK_FALSE(contains(shape, origin + u * plane.u + v * plane.v + depth * normal));
    }
  }
}

TEST_CASE("painting is the exact test for every sample, sides apart, with any number of threads") {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> byte(0, 255);
  const auto noise = image_of(37, 23, 4, [&](auto, auto, auto) { return byte(random); });
  const Vec3d origin(500'000.0, 5'400'000.0, 0.0);
  const Points position = random_points(20'000, 3);
  std::vector<TexCoord> texcoord(position.size());
  std::uniform_real_distribution<float> coordinate(-1.5F, 2.5F);
  for (TexCoord& each : texcoord) each = {coordinate(random), coordinate(random)};
  const PaintSurface surface{
      .position = position, .normal = position, .origin = origin, .texcoord = &texcoord};
  const PlanarProjection plane{.origin = origin + Vec3d(-0.6, -0.3, 0.2),
                               .u = Vec3d(0.9, 0.4, -0.1),
                               .v = Vec3d(0.1, 0.7, 0.5),
                               .depth = {{-0.3, 0.4}}};
  for (const bool on_the_plane : {true, false}) {
    for (const bool above : {true, false}) {
      ImageShape shape = on_the_plane ? on_plane(noise, plane) : on_texture(noise, true);
      shape.above = above;
      const PaintOperation operation{.shape = shape};
      REQUIRE(validate(operation).ok());
      Marks expected(position.size(), 0);
      std::size_t inside = 0;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        if (!contains(operation.shape, origin + position[i].cast<double>(), &texcoord[i])) continue;
        expected[i] = 2;
        ++inside;
      }
      CHECK(inside > 100);
      for (const int threads : {1, 2, 3}) {
        Marks marks(position.size(), 0);
        with_threads(threads, [&] { CHECK(paint(operation, RegionKind::kOne, surface, marks) == inside); });
        CHECK(marks == expected);
      }
    }
  }
  Marks none;
  const Points no_samples;
  CHECK(paint({.shape = on_plane(noise)}, RegionKind::kOne,
              {.position = no_samples, .normal = no_samples, .origin = origin}, none) == 0);
}

TEST_CASE("images are refused with the member that is wrong") {
  ImageShape shape = on_plane(checkerboard(2));
  CHECK(validate(Shape(shape)).ok());
  CHECK_FALSE(needs_texcoord(shape));
  CHECK(needs_texcoord(on_texture(nullptr, true)));
  CHECK(has_its_data(shape));
  CHECK_FALSE(has_its_data(without_data(shape)));
  for (const double threshold : {-0.001, 1.001}) {
    shape.threshold = threshold;
    check_refused(shape, ErrorCode::kOutOfRange, "shape.threshold");
  }
  shape.threshold = kNan;
  check_refused(shape, ErrorCode::kNonFinite, "shape.threshold");
  const auto refused_plane = [&](const PlanarProjection& plane, ErrorCode code, const char* field) {
    check_refused(on_plane(checkerboard(2), plane), code, field);
  };
  refused_plane({.origin = Vec3d(kNan, 0, 0)}, ErrorCode::kNonFinite, "shape.projection.origin");
  refused_plane({.origin = Vec3d(0, 1.1e12, 0)}, ErrorCode::kOutOfRange, "shape.projection.origin");
  refused_plane({.u = Vec3d::Zero()}, ErrorCode::kInvalidArgument, "shape.projection.u");
  refused_plane({.v = Vec3d::Zero()}, ErrorCode::kInvalidArgument, "shape.projection.v");
  refused_plane({.u = Vec3d(1, 2, 3), .v = Vec3d(-2, -4, -6)}, ErrorCode::kInvalidArgument,
                "shape.projection.v");
  refused_plane({.depth = {{1.0, 0.5}}}, ErrorCode::kInvalidArgument, "shape.projection.depth");
  refused_plane({.depth = {{kNan, 0.5}}}, ErrorCode::kNonFinite, "shape.projection.depth");
  CHECK(validate(Shape(on_plane(nullptr, {.u = Vec3d(1e-90, 0, 0), .v = Vec3d(0, 1e12, 0)}))).ok());
}

}  // namespace
}  // namespace pointwright
