// PNG files of every kind, damaged ones, and the confined decoder for them.
#include <doctest/doctest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "server/ingest/confined.h"
#include "server/ingest/png_reader.h"
#include "tests/fuzz/targets.h"
#include "tests/io/io_support.h"
#include "tests/support/png_file.h"

namespace pointwright::io_test {
namespace {

using test::png_file;
using test::PngSpec;

Image read(const std::string& file) {
  auto image = read_png(bytes_of(file), {});
  REQUIRE_MESSAGE(image.ok(), why(image));
  return std::move(image).value();
}

std::vector<unsigned> values(const Image& image) {
  std::vector<unsigned> list;
  for (std::size_t i = 0; i < image.values.size(); i += image.bytes_per_value) {
    std::uint16_t wide = 0;
    if (image.bytes_per_value == 2) std::memcpy(&wide, image.values.data() + i, 2);
    list.push_back(image.bytes_per_value == 2 ? wide : static_cast<unsigned>(image.values[i]));
  }
  return list;
}

Error refusal(const std::string& file, const ImageLimits& limits = {}) {
  const auto image = read_png(bytes_of(file), limits);
  REQUIRE_FALSE(image.ok());
  return image.error();
}

using Values = std::vector<unsigned>;

std::string color_file(bool interlaced = false, std::uint32_t side = 20) {
  PngSpec spec{.width = side,
               .height = side,
               .color_type = PNG_COLOR_TYPE_RGB_ALPHA,
               .rows = {},
               .is_interlaced = interlaced};
  for (std::uint32_t i = 0; i < side * side * 4; ++i)
    spec.rows.push_back(static_cast<std::uint8_t>(i * 37 % 251));
  return png_file(spec);
}

TEST_CASE("grey of 1 to 16 bits comes as it is stored, few bits as the eight that mean the same") {
  const Image one = read(png_file({.width = 9, .height = 1, .bits = 1, .rows = {0xA0, 0x80}}));
  CHECK(one.channels == 1);
  CHECK(values(one) == Values{255, 0, 255, 0, 0, 0, 0, 0, 255});
  CHECK(values(read(png_file({.width = 4, .height = 1, .bits = 2, .rows = {0x1B}}))) ==
        Values{0, 85, 170, 255});
  CHECK(values(read(png_file({.width = 2, .height = 1, .bits = 4, .rows = {0x3F}}))) == Values{51, 255});
  CHECK(values(read(png_file({.width = 2, .height = 1, .rows = {7, 200}}))) == Values{7, 200});
  const Image wide = read(png_file({.width = 2, .height = 1, .bits = 16, .rows = {0x12, 0x34, 0xFF, 0xFE}}));
  CHECK(wide.bytes_per_value == 2);
  CHECK(values(wide) == Values{0x1234, 0xFFFE});
}

TEST_CASE("colours, palettes and transparency come as channels") {
  const Image rgb =
      read(png_file({.width = 1, .height = 2, .color_type = PNG_COLOR_TYPE_RGB, .rows = {1, 2, 3, 4, 5, 6}}));
  CHECK(rgb.channels == 3);
  CHECK(values(rgb) == Values{1, 2, 3, 4, 5, 6});
  const Image grey_alpha = read(png_file(
      {.width = 1, .height = 1, .bits = 16, .color_type = PNG_COLOR_TYPE_GRAY_ALPHA, .rows = {0, 9, 1, 0}}));
  CHECK(grey_alpha.channels == 2);
  CHECK(values(grey_alpha) == Values{9, 256});
  PngSpec palette{.width = 4,
                  .height = 1,
                  .bits = 2,
                  .color_type = PNG_COLOR_TYPE_PALETTE,
                  .rows = {0x1B},
                  .palette = {{10, 20, 30}, {40, 50, 60}, {70, 80, 90}, {100, 110, 120}}};
  CHECK(values(read(png_file(palette))) == Values{10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120});
  palette.palette_alpha = {0, 128};
  const Image see_through = read(png_file(palette));
  CHECK(see_through.channels == 4);
  CHECK(values(see_through) == Values{10, 20, 30, 0, 40, 50, 60, 128, 70, 80, 90, 255, 100, 110, 120, 255});
  PngSpec keyed{.width = 2, .height = 1, .rows = {7, 200}, .has_transparent_color = true};
  keyed.transparent_color.gray = 200;
  const Image key = read(png_file(keyed));
  CHECK(key.channels == 2);
  CHECK(values(key) == Values{7, 255, 200, 0});
}

TEST_CASE("an interlaced file is the same image") {
  const Image plain = read(color_file(false));
  const Image interlaced = read(color_file(true));
  CHECK(plain.values == interlaced.values);
  CHECK(plain.values.size() == 20 * 20 * 4);
}

TEST_CASE("the header is judged before anything is decoded") {
  std::string file = color_file();
  const auto with = [&](std::size_t at, const std::string& bytes) {
    std::string changed = file;
    changed.replace(at, bytes.size(), bytes);
    return changed;
  };
  CHECK(refusal("").code == ErrorCode::kEmptyCloud);
  CHECK(refusal("\x89PN").code == ErrorCode::kUnsupportedFormat);
  CHECK(refusal("GIF89a and more").code == ErrorCode::kUnsupportedFormat);
  CHECK(refusal(file.substr(0, 8)).code == ErrorCode::kMalformedData);
  CHECK(refusal(with(12, "JHDR")).code == ErrorCode::kMalformedData);
  CHECK(refusal(with(16, std::string(4, '\0'))).code == ErrorCode::kMalformedData);
  CHECK(refusal(with(20, "\xFF\xFF\xFF\xFF")).code == ErrorCode::kMalformedData);
  for (const char* kind : {"\x03\x06", "\x10\x03", "\x08\x01", "\x08\x07", "\x21\x02"})
    CHECK(refusal(with(24, std::string(kind, 2))).code == ErrorCode::kMalformedData);
  CHECK(refusal(with(28, "\x02")).code == ErrorCode::kMalformedData);
  // A gigapixel in a kilobyte, and one side too long.
  const Error many = refusal(with(16, std::string("\0\0\x70\x00\0\0\x70\x00", 8)));
  CHECK(many.code == ErrorCode::kTooLarge);
  CHECK(many.limit == 67'108'864.0);
  CHECK(many.actual == 28'672.0 * 28'672.0);
  const Error side = refusal(with(16, std::string("\0\x01\0\0", 4)));
  CHECK(side.code == ErrorCode::kTooLarge);
  CHECK(side.limit == 32'768.0);
  CHECK(refusal(file, {.max_side = 19}).code == ErrorCode::kTooLarge);
  CHECK(refusal(file, {.max_pixels = 399}).code == ErrorCode::kTooLarge);
  CHECK(read_png(bytes_of(file), {.max_side = 20, .max_pixels = 400}).ok());
}

TEST_CASE("a file that is cut anywhere is refused, one that is changed anywhere never stops the reader") {
  for (const bool interlaced : {false, true}) {
    const std::string file = color_file(interlaced, 6);
    for (std::size_t length = 0; length < file.size(); ++length) {
      CAPTURE(length);
      CHECK_FALSE(read_png(bytes_of(file.substr(0, length)), {}).ok());
    }
    Random random(7);
    for (int round = 0; round < 3000; ++round) {
      std::string changed = file;
      for (std::uint64_t k = 0; k <= random.below(3); ++k)
        changed[random.below(changed.size())] = static_cast<char>(random.below(256));
      CHECK_NOTHROW(fuzz::try_png(bytes_of(changed)));
    }
  }
}

TEST_CASE("the fuzzing corpus passes through the reader") {
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(POINTWRIGHT_CORPUS_DIR) / "png")) {
    CAPTURE(entry.path().string());
    std::ifstream file(entry.path(), std::ios::binary);
    CHECK_NOTHROW(fuzz::try_png(bytes_of(std::string(std::istreambuf_iterator<char>(file), {}))));
    ++files;
  }
  CHECK(files >= 13);
}

TEST_CASE("an image comes out of the confined decoder as it does without, and errors say the same") {
  ConfineLimits limits;
  limits.program = POINTWRIGHT_TEST_DECODER;
  for (const std::string& file :
       {color_file(true, 300), png_file({.width = 2, .height = 1, .bits = 16, .rows = {1, 2, 3, 4}})}) {
    const auto confined = decode_image_confined(bytes_of(file), {}, limits);
    REQUIRE_MESSAGE(confined.ok(), why(confined));
    const Image direct = read(file);
    CHECK(confined.value().width == direct.width);
    CHECK(confined.value().channels == direct.channels);
    CHECK(confined.value().bytes_per_value == direct.bytes_per_value);
    CHECK(confined.value().values == direct.values);
  }
  const std::string file = color_file();
  const auto large = decode_image_confined(bytes_of(file), {.max_pixels = 100}, limits);
  CHECK(large.error().code == ErrorCode::kTooLarge);
  CHECK(large.error().actual == 400.0);
  const auto cut = decode_image_confined(bytes_of(file.substr(0, 100)), {}, limits);
  CHECK(cut.error().code == ErrorCode::kMalformedData);
  CHECK(cut.error().message == refusal(file.substr(0, 100)).message);
  CHECK(decode_image_confined({}, {}, limits).error().code == ErrorCode::kEmptyCloud);
  // The largest that the header may claim fits into what the decoder is given.
  const std::string white = test::grey_png(4096, 4096, [](std::uint32_t, std::uint32_t) { return 255; });
  CHECK(decode_image_confined(bytes_of(white), {}, limits).ok());
}

}  // namespace
}  // namespace pointwright::io_test
