#pragma once
// The Point Cloud Library's PCD files, versions .5 to .7, in all three encodings.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"

namespace pointwright {

enum class PcdEncoding { kAscii, kBinary, kCompressed };

struct PcdField {
  std::string name;  ///< "_": padding
  char type = 'F';   ///< 'F', 'I' or 'U'
  std::uint32_t size = 4;
  std::uint32_t count = 1;
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t width = 0;
  std::uint64_t height = 1;
  std::uint64_t points = 0;
  PcdEncoding encoding = PcdEncoding::kAscii;
  bool has_viewpoint = false;  ///< other than the origin, looking along z
  std::size_t data_offset = 0;
  std::uint64_t line_count = 0;

  [[nodiscard]] std::uint64_t row_bytes() const;
  [[nodiscard]] std::uint64_t values_per_row() const;
};

/// The bytes start with the comment that the library writes, or with the word VERSION or FIELDS.
bool looks_like_pcd(std::span<const std::byte> bytes);

/// Reads the header, at most 64 KiB: statements in any order, DATA last; at most 256 fields and 1024 values a
/// point; what it claims is held against the bytes there are.
/// Errors: kMalformedData (with the line), kUnsupportedFormat, kTooLarge, kEmptyCloud
Result<PcdHeader> parse_pcd_header(std::span<const std::byte> bytes, std::uint64_t max_samples);

/// Every field as a column: x y z, normal_x normal_y normal_z as normals, a packed rgb or rgba as colours,
/// all others by name (those with a count as name_0, name_1, …) in their type; 8-byte integers as float64.
/// An organised cloud (height > 1) is read row by row.
/// Errors: kMalformedData (with line or byte), kUnsupportedFormat, kTooLarge, kEmptyCloud
Result<ImportedCloud> read_pcd(std::span<const std::byte> bytes, const ImportParams& params);

}  // namespace pointwright
