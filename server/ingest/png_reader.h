#pragma once
// PNG files (https://www.w3.org/TR/png-3/) to images, by way of libpng. Foreign bytes reach it in the
// confined decoder alone.

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/core/result.h"
#include "engine/editing/image.h"

namespace pointwright {

/// What an image may be at most.
struct ImageLimits {
  std::uint64_t max_side = 32'768;        ///< pixels of its width, and of its height
  std::uint64_t max_pixels = 67'108'864;  ///< of the whole image
};

/// What the header of a PNG file claims, read by hand before the library sees a byte: a file of a hundred
/// bytes can claim gigabytes.
struct PngClaim {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint64_t value_bytes = 0;  ///< of the decoded image, at most (transparency may be absent)
};

/// Lets a file pass to the library only if it starts as a PNG file with a possible header and what that
/// claims is within the limits.
/// Errors: kEmptyCloud for no bytes; kUnsupportedFormat for another signature; kMalformedData; kTooLarge
Result<PngClaim> png_gate(std::span<const std::byte> bytes, const ImageLimits& limits);

/// The image, every channel as the file has it: palettes become colours, transparent colours an alpha
/// channel, 1 to 4 bits the 8 that mean the same. No gamma, no colour profile. What follows the end of the
/// image is not looked at.
/// Errors: those of png_gate(); kMalformedData for damaged, truncated and inconsistent files
/// Cost:   O(pixels), sequential
Result<Image> read_png(std::span<const std::byte> bytes, const ImageLimits& limits);

}  // namespace pointwright
