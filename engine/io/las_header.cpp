// "LAS Specification 1.4 - R15", American Society for Photogrammetry and Remote Sensing.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "engine/io/las.h"
#include "engine/io/load.h"

namespace pointwright {
namespace {

static_assert(std::endian::native == std::endian::little, "LAS is little-endian, and so are we");

constexpr std::size_t kLeastHeader = 227;
constexpr std::size_t kHeader13 = 235;
constexpr std::size_t kExtendedHead = 60;
constexpr std::uint64_t kMostRecords = 65536;
constexpr std::size_t kMostExtra = 512;

Error malformed(std::uint64_t at, const std::string& what) {
  std::string message = "byte " + std::to_string(at);
  message.append(" of the LAS file: ").append(what);
  return Error{.code = ErrorCode::kMalformedData, .message = std::move(message), .field = "header"};
}
Error unsupported(std::string message) {
  return Error{.code = ErrorCode::kUnsupportedFormat, .message = std::move(message), .field = "header"};
}

template <typename T>
T load(std::span<const std::byte> bytes, std::size_t at) {
  return pointwright::load<T>(bytes.data() + at);
}

std::string text_at(std::span<const std::byte> bytes, std::size_t at, std::size_t length) {
  std::string text(reinterpret_cast<const char*>(bytes.data()) + at, length);
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

// ---- the point formats ----

using enum ScalarType;

constexpr std::array<LasDimension, 11> kLegacy{{{"intensity", kUint16, 12},
                                                {"return_number", kUint8, 14, 0, 3},
                                                {"number_of_returns", kUint8, 14, 3, 3},
                                                {"scan_direction_flag", kUint8, 14, 6, 1},
                                                {"edge_of_flight_line", kUint8, 14, 7, 1},
                                                {"classification", kUint8, 15, 0, 5},
                                                {"synthetic", kUint8, 15, 5, 1},
                                                {"key_point", kUint8, 15, 6, 1},
                                                {"withheld", kUint8, 15, 7, 1},
                                                {"scan_angle_rank", kInt8, 16},
                                                {"user_data", kUint8, 17}}};
constexpr LasDimension kLegacySource{"point_source_id", kUint16, 18};
constexpr LasDimension kLegacyTime{"gps_time", kDouble, 20};
constexpr std::array<LasDimension, 16> kModern{{{"intensity", kUint16, 12},
                                                {"return_number", kUint8, 14, 0, 4},
                                                {"number_of_returns", kUint8, 14, 4, 4},
                                                {"synthetic", kUint8, 15, 0, 1},
                                                {"key_point", kUint8, 15, 1, 1},
                                                {"withheld", kUint8, 15, 2, 1},
                                                {"overlap", kUint8, 15, 3, 1},
                                                {"scanner_channel", kUint8, 15, 4, 2},
                                                {"scan_direction_flag", kUint8, 15, 6, 1},
                                                {"edge_of_flight_line", kUint8, 15, 7, 1},
                                                {"classification", kUint8, 16},
                                                {"user_data", kUint8, 17},
                                                {"scan_angle", kInt16, 18},
                                                {"point_source_id", kUint16, 20},
                                                {"gps_time", kDouble, 22},
                                                {"nir", kUint16, 36}}};

constexpr std::array<LasDimension, 13> kTimed = [] {
  std::array<LasDimension, 13> all{};
  std::copy(kLegacy.begin(), kLegacy.end(), all.begin());
  all[11] = kLegacySource;
  all[12] = kLegacyTime;
  return all;
}();

// ---- records ----

struct Record {
  std::size_t data = 0;  // where its data starts
  std::uint64_t length = 0;
  bool is_extra_bytes = false;
};

// Walks one list of records; those of extra bytes go to `found`.
Result<void> walk(std::span<const std::byte> bytes, std::uint64_t at, std::uint64_t count, bool is_extended,
                  std::vector<Record>& found) {
  const std::size_t head = is_extended ? kExtendedHead : kLasRecordHeadBytes;
  if (count > kMostRecords) return malformed(100, "more than 65536 records");
  for (std::uint64_t i = 0; i < count; ++i) {
    if (at > bytes.size() || head > bytes.size() - at)
      return malformed(at, "a record goes beyond the file's end");
    const auto start = static_cast<std::size_t>(at);
    Record record{.data = start + head};
    record.length =
        is_extended ? load<std::uint64_t>(bytes, start + 20) : load<std::uint16_t>(bytes, start + 20);
    if (record.length > bytes.size() - record.data)
      return malformed(at, "a record goes beyond the file's end");
    const bool is_ours = text_at(bytes, start + 2, 16) == kLasSpecUser;
    if (is_ours && load<std::uint16_t>(bytes, start + 18) == kLasExtraRecord) found.push_back(record);
    at = record.data + record.length;
  }
  return {};
}

LasExtraDimension read_descriptor(std::span<const std::byte> bytes, std::size_t at) {
  constexpr std::array<std::uint32_t, 11> kBytes{0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  constexpr std::uint8_t kSingles = 10;
  LasExtraDimension extra;
  auto type = load<std::uint8_t>(bytes, at + 2);
  const auto options = load<std::uint8_t>(bytes, at + 3);
  extra.name = clean_name(text_at(bytes, at + 4, 32));
  if (type > 3 * kSingles) type = 0;
  if (type == 0) {
    extra.bytes = options;  // so many bytes of whatever
    return extra;
  }
  // Types 11 to 30 are the deprecated pairs and triples.
  extra.components = 1 + (type - 1U) / kSingles;
  extra.data_type = static_cast<std::uint8_t>(1 + (type - 1U) % kSingles);
  extra.bytes = kBytes[extra.data_type] * extra.components;
  constexpr unsigned kHasScale = 8;
  constexpr unsigned kHasOffset = 16;
  extra.is_scaled = (options & (kHasScale | kHasOffset)) != 0;
  for (std::size_t c = 0; c < 3; ++c) {
    if ((options & kHasScale) != 0) extra.scale[c] = load<double>(bytes, at + 112 + 8 * c);
    if ((options & kHasOffset) != 0) extra.offset[c] = load<double>(bytes, at + 136 + 8 * c);
  }
  return extra;
}

Result<void> read_extra(std::span<const std::byte> bytes, LasHeader& header, std::size_t header_size) {
  std::vector<Record> records;
  if (auto done = walk(bytes, header_size, load<std::uint32_t>(bytes, 100), false, records); !done)
    return done;
  if (header.minor_version >= 4 && header_size >= kLasHeader14Bytes) {
    const auto at = load<std::uint64_t>(bytes, 235);
    const auto count = load<std::uint32_t>(bytes, 243);
    if (count > 0)
      if (auto done = walk(bytes, at, count, true, records); !done) return done;
  }
  std::uint32_t left = header.record_bytes - las_record_bytes(header.point_format);
  for (const Record& record : records) {
    for (std::uint64_t d = 0; d + kLasExtraDescriptorBytes <= record.length; d += kLasExtraDescriptorBytes) {
      auto extra = read_descriptor(bytes, record.data + static_cast<std::size_t>(d));
      if (extra.bytes > left) return malformed(record.data + d, "extra bytes go beyond the points' records");
      if (header.extra.size() == kMostExtra)
        return malformed(record.data + d, "more than 512 extra dimensions");
      left -= extra.bytes;
      header.extra.push_back(std::move(extra));
    }
  }
  // What no descriptor names is bytes of whatever.
  if (left > 0) header.extra.push_back({.name = "extra_bytes", .bytes = left});
  return {};
}

Result<void> check_points(const LasHeader& header, std::span<const std::byte> bytes,
                          std::uint64_t max_samples) {
  if (header.point_count == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the file has no points", .field = "header"};
  if (header.point_count > max_samples || header.point_count > std::numeric_limits<std::uint32_t>::max())
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the file claims " + std::to_string(header.point_count) + " samples; at most " +
                            std::to_string(max_samples) + " are taken",
                 .field = "header",
                 .limit = static_cast<double>(max_samples),
                 .actual = static_cast<double>(header.point_count)};
  const std::uint64_t left = bytes.size() - std::min<std::uint64_t>(bytes.size(), header.point_offset);
  if (header.point_count > left / header.record_bytes)
    return malformed(bytes.size(),
                     "the file ends before all " + std::to_string(header.point_count) + " points");
  return {};
}

}  // namespace

std::uint16_t las_record_bytes(std::uint8_t point_format) {
  constexpr std::array<std::uint16_t, 11> kBytes{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
  return kBytes[point_format];
}

std::span<const LasDimension> las_dimensions(std::uint8_t point_format) {
  const std::span<const LasDimension> timed(kTimed);
  const std::span<const LasDimension> modern(kModern);
  if (point_format >= 6) return modern.first(point_format == 8 || point_format == 10 ? 16 : 15);
  return timed.first(point_format == 0 || point_format == 2 ? 12 : 13);
}

std::optional<std::uint16_t> las_color_byte(std::uint8_t point_format) {
  switch (point_format) {
    case 2:
      return std::uint16_t{20};
    case 3:
    case 5:
      return std::uint16_t{28};
    case 7:
    case 8:
    case 10:
      return std::uint16_t{30};
    default:
      return std::nullopt;
  }
}

Result<LasHeader> parse_las_header(std::span<const std::byte> bytes, std::uint64_t max_samples) {
  if (bytes.size() < kLeastHeader || text_at(bytes, 0, 4) != "LASF")
    return malformed(bytes.size(), "it is too short for a header");
  LasHeader header;
  const auto major = load<std::uint8_t>(bytes, 24);
  header.minor_version = load<std::uint8_t>(bytes, 25);
  if (major != 1 || header.minor_version > 4)
    return unsupported("LAS " + std::to_string(major) + "." + std::to_string(header.minor_version) +
                       " is not known; 1.0 to 1.4 are");
  const std::size_t header_size = load<std::uint16_t>(bytes, 94);
  const std::size_t least = header.minor_version >= 4   ? kLasHeader14Bytes
                            : header.minor_version == 3 ? kHeader13
                                                        : kLeastHeader;
  if (header_size < least || header_size > bytes.size()) return malformed(94, "the header's size is wrong");
  header.point_offset = load<std::uint32_t>(bytes, 96);
  header.point_format = load<std::uint8_t>(bytes, 104);
  header.record_bytes = load<std::uint16_t>(bytes, 105);
  constexpr unsigned kCompressedBits = 0xC0;
  if ((header.point_format & kCompressedBits) != 0)
    return unsupported(
        "LAZ (compressed LAS) files are not read: unpack to LAS first, with 'laszip -i in.laz -o out.las' or "
        "'pdal translate in.laz out.las'");
  if (header.point_format > 10)
    return unsupported("LAS point format " + std::to_string(header.point_format) +
                       " is not known; 0 to 10 are");
  if (header.record_bytes < las_record_bytes(header.point_format))
    return malformed(105, "the points' records are shorter than their format");
  if (header.point_offset < header_size) return malformed(96, "the points start within the header");
  header.point_count = load<std::uint32_t>(bytes, 107);
  if (header.minor_version >= 4) {
    const auto count = load<std::uint64_t>(bytes, 247);
    if (count != 0 || header.point_format >= 6) header.point_count = count;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    header.grid.scale[i] = load<double>(bytes, 131 + 8 * axis);
    header.grid.offset[i] = load<double>(bytes, 155 + 8 * axis);
    if (!std::isfinite(header.grid.scale[i]) || header.grid.scale[i] == 0.0)
      return malformed(131 + 8 * axis, "the scale is none");
    if (!std::isfinite(header.grid.offset[i])) return malformed(155 + 8 * axis, "the offset is not finite");
  }
  if (auto done = check_points(header, bytes, max_samples); !done) return done.error();
  if (auto done = read_extra(bytes, header, header_size); !done) return done.error();
  return header;
}

}  // namespace pointwright
