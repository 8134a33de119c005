#pragma once
// Stanford PLY, all three encodings: http://paulbourke.net/dataformats/ply/

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "engine/io/columns.h"
#include "engine/io/text.h"

namespace pointwright {

enum class PlyEncoding { kAscii, kBinaryLittleEndian, kBinaryBigEndian };

std::string_view encoding_name(PlyEncoding encoding);

struct PlyProperty {
  std::string name;
  ScalarType type = ScalarType::kFloat;
  bool is_list = false;
  ScalarType count_type = ScalarType::kUint8;  ///< of a list's length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::size_t count_at = 0;      ///< the first byte of the count in the header
  std::size_t count_length = 0;  ///< of its word
  std::vector<PlyProperty> properties;

  [[nodiscard]] bool has_lists() const;
  /// Bytes that a row takes in binary; of a list, its length alone.
  [[nodiscard]] std::uint64_t least_row_bytes() const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::size_t data_offset = 0;   ///< of the first byte after the header's last line end
  std::uint64_t line_count = 0;  ///< lines of the header
  char line_end = '\n';          ///< what ends a line: '\n' (a '\r' before it is a blank), or '\r' alone

  /// The first element named "vertex"; nullptr without one.
  [[nodiscard]] const PlyElement* vertex() const;
};

/// Reads the header: at most 1 MiB, 256 elements and 1024 properties an element.
/// Errors: kMalformedData (with the line), kUnsupportedFormat
Result<PlyHeader> parse_ply_header(std::span<const std::byte> bytes);

/// Every scalar property of the vertices; the rest of the file is walked over, so a cut file is noticed.
/// Errors: kMalformedData, kUnsupportedFormat, kTooLarge, kEmptyCloud
Result<ImportedCloud> read_ply(std::span<const std::byte> bytes, const ImportParams& params);

/// Rows and lines of a part of an ASCII file: lines of blanks are no rows.
struct PlyRowCount {
  std::uint64_t rows = 0;
  std::uint64_t lines = 0;
};
PlyRowCount count_ply_rows(std::string_view text, char line_end);

/// The next `count` of the vertices' rows of an ASCII file, for files that are read piece by piece: `text`
/// begins with the first of them, in line `first_line`. The scalar properties in their order; lists are left
/// out. Errors: kMalformedData (with the line)
Result<std::vector<ScalarAttribute>> read_ply_rows(std::string_view text, const PlyHeader& header,
                                                   std::uint64_t count, std::uint64_t first_line);

/// Rows of the vertices of a binary file, as decode_cloud() reads them. Pre: the vertices have no lists
Result<ImportedCloud> read_ply_vertices(std::span<const std::byte> rows, const PlyHeader& header);

/// The header of a binary little-endian file that holds nothing but vertices with these properties.
std::string ply_header_text(std::uint64_t count, std::span<const PlyProperty> properties);

/// x y z [nx ny nz] [red green blue [alpha]] [s t] and the scalars in their types.
std::vector<std::byte> write_ply(const ExportView& view, bool ascii);

}  // namespace pointwright
