#pragma once
// ASPRS LAS 1.0 to 1.4, uncompressed, every point format.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "engine/io/columns.h"

namespace pointwright {

/// One dimension of the extra bytes, as its descriptor has it.
struct LasExtraDimension {
  std::string name;
  std::uint8_t data_type = 0;  ///< 1 to 10: u8 i8 u16 i16 u32 i32 u64 i64 f32 f64; 0: so many bytes, unknown
  std::uint32_t components = 1;
  std::uint32_t bytes = 0;  ///< of all components
  bool is_scaled = false;
  std::array<double, 3> scale{1.0, 1.0, 1.0};
  std::array<double, 3> offset{0.0, 0.0, 0.0};
};

struct LasHeader {
  std::uint8_t minor_version = 2;
  std::uint8_t point_format = 0;
  std::uint16_t record_bytes = 20;
  std::uint64_t point_count = 0;
  std::uint64_t point_offset = 0;
  PositionGrid grid;
  std::vector<LasExtraDimension> extra;  ///< of the bytes past the point format's own, as far as described
};

/// Bytes of the header of LAS 1.4.
inline constexpr std::size_t kLasHeader14Bytes = 375;
/// Bytes before the content of a variable length record.
inline constexpr std::size_t kLasRecordHeadBytes = 54;

/// Bytes of a record of that point format (0 to 10) without extra ones.
std::uint16_t las_record_bytes(std::uint8_t point_format);

/// Reads the header and the descriptors of extra bytes, wherever they stand. What the header claims is held
/// against the bytes there are.
/// Errors: kMalformedData (with the byte), kUnsupportedFormat (LAZ among others), kTooLarge, kEmptyCloud
Result<LasHeader> parse_las_header(std::span<const std::byte> bytes, std::uint64_t max_samples);

/// Positions as float64, offset + scale * integer; intensity, return_number, number_of_returns,
/// scan_direction_flag, edge_of_flight_line, classification, synthetic, key_point, withheld, overlap,
/// scanner_channel, scan_angle_rank (degrees, formats 0 to 5) or scan_angle (0.006 degrees, formats 6 to 10),
/// user_data, point_source_id, gps_time, nir, each where any point has one; colours, and where 8 bits do not
/// give the file's 16 back, red_16, green_16 and blue_16; the extra bytes by their names. Waveforms and
/// records between header and points are left out.
/// Errors: those of parse_las_header(), kMalformedData
Result<ImportedCloud> read_las(std::span<const std::byte> bytes, const ImportParams& params);

/// The inverse: columns with those names and types go where the format has them, all others are extra bytes.
/// Version 1.2 with point format 0 to 3, or 1.4 with 6 to 8 where a column needs it.
/// Errors: kUnsupportedFormat (more further columns than extra bytes can describe)
Result<std::vector<std::byte>> write_las(const ExportView& view, const std::optional<PositionGrid>& grid);

/// The grid for these positions: `wanted` where it holds every one to the bit, or halved as often as 32-bit
/// numbers allow; without it decimals, where they hold every one to a step of float64; else the finest power
/// of two. Pre: not empty, finite.
PositionGrid las_grid(const ExportView& view, const std::optional<PositionGrid>& wanted);

/// A standard dimension: where it stands in a record. Bits: `shift` and `bits` of one byte; bits 0: whole.
struct LasDimension {
  const char* name;
  ScalarType type;
  std::uint8_t byte;
  std::uint8_t shift = 0;
  std::uint8_t bits = 0;
};
/// Those of the point format but positions and colours.
std::span<const LasDimension> las_dimensions(std::uint8_t point_format);
/// Where colours and near infrared stand; nullopt without.
std::optional<std::uint16_t> las_color_byte(std::uint8_t point_format);

inline constexpr std::uint16_t kLasExtraRecord = 4;
inline constexpr std::size_t kLasExtraDescriptorBytes = 192;
inline constexpr const char* kLasSpecUser = "LASF_Spec";

}  // namespace pointwright
