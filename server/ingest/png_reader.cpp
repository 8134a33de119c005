#include "server/ingest/png_reader.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <string>
#include <vector>

#include "engine/io/text.h"

namespace pointwright {
namespace {

constexpr std::array<unsigned char, 8> kSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::size_t kHeaderBytes = 33;  // the signature and the chunk IHDR
// Of one compressed chunk beside the pixels (none of which is kept).
constexpr std::size_t kMaxChunkBytes = std::size_t{1} << 20;

Error malformed(std::string message) {
  return Error{.code = ErrorCode::kMalformedData, .message = std::move(message), .field = {}};
}

Error too_large(std::string message, std::uint64_t limit, std::uint64_t actual) {
  return Error{.code = ErrorCode::kTooLarge,
               .message = std::move(message),
               .field = {},
               .limit = static_cast<double>(limit),
               .actual = static_cast<double>(actual)};
}

std::uint32_t big_endian(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8U | static_cast<std::uint32_t>(bytes[at + i]);
  return value;
}

// Bits that the colour type may have (PNG, table 11.1), and the channels that it becomes with transparency.
struct ColorType {
  std::uint32_t depths = 0;  // bit k: k bits a value
  std::uint32_t channels = 0;
};
ColorType color_type(std::uint32_t type) {
  constexpr auto kBits = [](auto... depth) { return ((1U << depth) | ...); };
  switch (type) {
    case 0:
      return {kBits(1U, 2U, 4U, 8U, 16U), 2};
    case 2:
      return {kBits(8U, 16U), 4};
    case 3:
      return {kBits(1U, 2U, 4U, 8U), 4};
    case 4:
      return {kBits(8U, 16U), 2};
    case 6:
      return {kBits(8U, 16U), 4};
    default:
      return {};
  }
}

// What libpng works on. Everything with a destructor lives here, outside of the functions that a failure
// jumps out of.
struct Decoding {
  std::span<const std::byte> bytes;
  std::size_t at = 0;
  std::string failure;
  png_structp png = nullptr;
  png_infop info = nullptr;
  Image image;
  std::vector<png_bytep> rows;

  explicit Decoding(std::span<const std::byte> file) : bytes(file) {}
  Decoding(const Decoding&) = delete;
  Decoding& operator=(const Decoding&) = delete;
  ~Decoding() {
    if (png != nullptr) png_destroy_read_struct(&png, &info, nullptr);
  }
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  auto* decoding = static_cast<Decoding*>(png_get_error_ptr(png));
  decoding->failure = message;
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

void give_bytes(png_structp png, png_bytep target, std::size_t count) {
  auto* decoding = static_cast<Decoding*>(png_get_io_ptr(png));
  if (count > decoding->bytes.size() - decoding->at) png_error(png, "the file ends too early");
  std::memcpy(target, decoding->bytes.data() + decoding->at, count);
  decoding->at += count;
}

// No object with a destructor may live in here: failures jump out of it.
bool read_header(Decoding& decoding) {
  // NOLINTNEXTLINE(cert-err52-cpp): libpng knows no other way to fail.
  if (setjmp(png_jmpbuf(decoding.png)) != 0) return false;
  png_set_read_fn(decoding.png, &decoding, give_bytes);
  png_set_chunk_malloc_max(decoding.png, kMaxChunkBytes);
  // Texts, profiles and the like are passed over unread.
  png_set_keep_unknown_chunks(decoding.png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_read_info(decoding.png, decoding.info);
  png_set_expand(decoding.png);
  if constexpr (std::endian::native == std::endian::little) png_set_swap(decoding.png);
  png_set_interlace_handling(decoding.png);
  png_read_update_info(decoding.png, decoding.info);
  return true;
}

bool read_pixels(Decoding& decoding) {
  // NOLINTNEXTLINE(cert-err52-cpp): as above
  if (setjmp(png_jmpbuf(decoding.png)) != 0) return false;
  png_read_image(decoding.png, decoding.rows.data());
  png_read_end(decoding.png, nullptr);
  return true;
}

Error failure_of(const Decoding& decoding) {
  return malformed("the image is damaged: " + clean_text(decoding.failure));
}

}  // namespace

Result<PngClaim> png_gate(std::span<const std::byte> bytes, const ImageLimits& limits) {
  if (bytes.empty())
    return Error{.code = ErrorCode::kEmptyCloud, .message = "there are no bytes", .field = {}};
  const bool is_png = std::equal(kSignature.begin(), kSignature.end(), bytes.begin(),
                                 bytes.begin() + std::min<std::ptrdiff_t>(8, std::ssize(bytes)),
                                 [](unsigned char a, std::byte b) { return std::byte{a} == b; });
  if (!is_png)
    return Error{
        .code = ErrorCode::kUnsupportedFormat, .message = "the file is not a PNG image", .field = {}};
  if (bytes.size() < kHeaderBytes) return malformed("the file ends within its header");
  constexpr std::uint32_t kHeaderName = 0x49484452;  // IHDR
  if (big_endian(bytes, 8) != 13 || big_endian(bytes, 12) != kHeaderName)
    return malformed("the file does not start with a header");
  const PngClaim claim{.width = big_endian(bytes, 16), .height = big_endian(bytes, 20)};
  const auto depth = static_cast<std::uint32_t>(bytes[24]);
  const ColorType type = color_type(static_cast<std::uint32_t>(bytes[25]));
  constexpr std::uint32_t kMaxSide = 0x7FFFFFFF;
  if (claim.width == 0 || claim.height == 0 || claim.width > kMaxSide || claim.height > kMaxSide)
    return malformed("the header claims a width or height that no image has");
  if (depth > 16 || (type.depths >> depth & 1U) == 0)
    return malformed("the header claims a kind of colour that there is not");
  if (bytes[26] != std::byte{0} || bytes[27] != std::byte{0} || bytes[28] > std::byte{1})
    return malformed("the header claims a compression, filter or interlacing that there is not");
  const std::uint64_t side = std::max(claim.width, claim.height);
  if (side > limits.max_side)
    return too_large("the image is larger than " + std::to_string(limits.max_side) + " pixels on a side",
                     limits.max_side, side);
  const std::uint64_t pixels = std::uint64_t{claim.width} * claim.height;
  if (pixels > limits.max_pixels)
    return too_large("the image has more than " + std::to_string(limits.max_pixels) + " pixels",
                     limits.max_pixels, pixels);
  PngClaim result = claim;
  result.value_bytes = pixels * type.channels * (depth == 16 ? 2 : 1);
  return result;
}

Result<Image> read_png(std::span<const std::byte> bytes, const ImageLimits& limits) {
  const auto claim = png_gate(bytes, limits);
  if (!claim) return claim.error();
  Decoding decoding(bytes);
  decoding.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &decoding, on_error, on_warning);
  if (decoding.png == nullptr) return malformed("the image cannot be decoded");
  decoding.info = png_create_info_struct(decoding.png);
  if (decoding.info == nullptr) return malformed("the image cannot be decoded");
  if (!read_header(decoding)) return failure_of(decoding);

  Image& image = decoding.image;
  image.width = png_get_image_width(decoding.png, decoding.info);
  image.height = png_get_image_height(decoding.png, decoding.info);
  image.channels = png_get_channels(decoding.png, decoding.info);
  image.bytes_per_value = png_get_bit_depth(decoding.png, decoding.info) == 16 ? 2 : 1;
  const std::size_t row_bytes = std::size_t{image.width} * image.channels * image.bytes_per_value;
  const bool is_as_claimed = image.width == claim.value().width && image.height == claim.value().height &&
                             png_get_rowbytes(decoding.png, decoding.info) == row_bytes &&
                             value_bytes(image) <= claim.value().value_bytes;
  if (!is_as_claimed) return malformed("the image is not what its header claims");
  image.values.resize(value_bytes(image));
  decoding.rows.resize(image.height);
  for (std::size_t y = 0; y < image.height; ++y)
    decoding.rows[y] = reinterpret_cast<png_bytep>(image.values.data() + y * row_bytes);
  if (!read_pixels(decoding)) return failure_of(decoding);
  return std::move(decoding.image);
}

}  // namespace pointwright
