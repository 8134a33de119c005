#pragma once
// Pictures as decoded files give them: what an image paints with.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pointwright {

/// Values as the file stores them (no gamma applied), channels interleaved, rows from the top.
struct Image {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t channels = 0;         ///< 1: grey; 2: grey, alpha; 3: red, green, blue; 4: and alpha
  std::uint32_t bytes_per_value = 1;  ///< 1: 0 to 255; 2: 0 to 65535 in the machine's order
  std::vector<std::byte> values;      ///< height * width * channels * bytes_per_value

  [[nodiscard]] bool has_alpha() const { return channels % 2 == 0; }
  [[nodiscard]] bool has_colors() const { return channels >= 3; }
};

/// Bytes of the values of such an image; all numbers of a valid one are greater than 0.
inline std::uint64_t value_bytes(const Image& image) {
  return std::uint64_t{image.width} * image.height * image.channels * image.bytes_per_value;
}

/// Whether the numbers are those of an image and its values are all there.
inline bool is_valid(const Image& image) {
  constexpr std::uint32_t kMaxSide = 1U << 20;  // far beyond every limit; keeps products in 64 bits
  const auto side_fits = [](std::uint32_t side) { return side >= 1 && side <= kMaxSide; };
  return side_fits(image.width) && side_fits(image.height) && image.channels >= 1 && image.channels <= 4 &&
         image.bytes_per_value >= 1 && image.bytes_per_value <= 2 &&
         image.values.size() == value_bytes(image);
}

}  // namespace pointwright
