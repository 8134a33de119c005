#pragma once
// PNG files of every kind, written by libpng.

#include <png.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace pointwright::test {

/// What a file is made of. Rows are packed as the format packs them: 1 to 4 bits share bytes, 16 bits are
/// big-endian.
struct PngSpec {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int bits = 8;
  int color_type = PNG_COLOR_TYPE_GRAY;
  std::vector<std::uint8_t> rows;
  bool is_interlaced = false;
  std::vector<png_color> palette = {};
  std::vector<std::uint8_t> palette_alpha = {};
  bool has_transparent_color = false;  ///< of grey and colour images without an alpha channel
  png_color_16 transparent_color = {};
};

inline std::string png_file(const PngSpec& spec) {
  std::string file;
  png_structp png = png_create_write_struct(
      PNG_LIBPNG_VER_STRING, nullptr,
      [](png_structp, png_const_charp message) { throw std::runtime_error(message); }, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &file,
      [](png_structp writer, png_bytep bytes, std::size_t count) {
        static_cast<std::string*>(png_get_io_ptr(writer))->append(reinterpret_cast<char*>(bytes), count);
      },
      nullptr);
  png_set_IHDR(png, info, spec.width, spec.height, spec.bits, spec.color_type,
               spec.is_interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  if (!spec.palette.empty())
    png_set_PLTE(png, info, spec.palette.data(), static_cast<int>(spec.palette.size()));
  if (!spec.palette_alpha.empty())
    png_set_tRNS(png, info, spec.palette_alpha.data(), static_cast<int>(spec.palette_alpha.size()), nullptr);
  if (spec.has_transparent_color) png_set_tRNS(png, info, nullptr, 0, &spec.transparent_color);
  png_write_info(png, info);
  std::vector<std::uint8_t> rows = spec.rows;
  const std::size_t row_bytes = rows.size() / spec.height;
  std::vector<png_bytep> starts;
  for (std::uint32_t y = 0; y < spec.height; ++y) starts.push_back(rows.data() + y * row_bytes);
  png_write_image(png, starts.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return file;
}

/// An 8-bit grey file; value(x, y) with y from the top.
template <typename Value>
std::string grey_png(std::uint32_t width, std::uint32_t height, const Value& value) {
  PngSpec spec{.width = width, .height = height, .rows = {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) spec.rows.push_back(static_cast<std::uint8_t>(value(x, y)));
  return png_file(spec);
}

}  // namespace pointwright::test
