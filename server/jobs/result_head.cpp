#include "server/jobs/result_head.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>

#include "engine/io/las.h"
#include "engine/io/load.h"

namespace pointwright::server {
namespace {

// Bytes of a LAS header, "LAS Specification 1.4 - R15".
constexpr std::size_t kMinorVersionAt = 25;
constexpr std::size_t kHeaderBytesAt = 94;
constexpr std::size_t kFormatAt = 104;
constexpr std::size_t kLegacyCountAt = 107;
constexpr std::size_t kLegacyReturnsAt = 111;
constexpr std::size_t kLegacyReturns = 5;
constexpr std::size_t kWaveformsAt = 227;  // from 1.3 on
constexpr std::size_t kExtendedAt = 235;   // from 1.4 on
constexpr std::size_t kCountAt = 247;
constexpr std::size_t kReturnsAt = 255;
constexpr std::size_t kReturnByte = 14;  // of a record
constexpr std::uint8_t kFirstModernFormat = 6;
constexpr std::uint8_t kFormatBits = 0x3f;

template <typename T>
T at(std::span<const std::byte> head, std::size_t place) {
  return load<T>(head.data() + place);
}
template <typename T>
void put(std::span<std::byte> head, std::size_t place, T value) {
  std::memcpy(head.data() + place, &value, sizeof value);
}

/// Whether the header, which is followed by other records, goes as far as that version's.
bool is_version(std::span<const std::byte> head, std::uint8_t minor, std::size_t bytes) {
  return at<std::uint8_t>(head, kMinorVersionAt) >= minor && at<std::uint16_t>(head, kHeaderBytesAt) >= bytes;
}
bool is_version_14(std::span<const std::byte> head) {
  return is_version(head, 4, kLasHeader14Bytes);
}

/// Points of these formats are not counted in the fields that are older than 1.4.
bool has_legacy_counts(std::span<const std::byte> head) {
  return !is_version_14(head) || (at<std::uint8_t>(head, kFormatAt) & kFormatBits) < kFirstModernFormat;
}

std::uint32_t legacy(std::uint64_t count) {
  return count > std::numeric_limits<std::uint32_t>::max() ? 0U : static_cast<std::uint32_t>(count);
}

/// Moves what a header says of a place behind the points.
void move_place(std::span<std::byte> head, std::size_t field, std::uint64_t old_end, std::uint64_t new_end) {
  const auto place = at<std::uint64_t>(head, field);
  if (place >= old_end) put(head, field, place - old_end + new_end);
}

Result<std::vector<std::byte>> las_head(const ScanRecords& records, std::vector<std::byte> head,
                                        std::uint64_t count) {
  if (!is_version_14(head) && count > std::numeric_limits<std::uint32_t>::max())
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "only LAS 1.4 says more than 4294967295 points",
                 .field = "resampling.max_samples",
                 .limit = static_cast<double>(std::numeric_limits<std::uint32_t>::max()),
                 .actual = static_cast<double>(count)};
  put(std::span(head), kLegacyCountAt, has_legacy_counts(head) ? legacy(count) : 0U);
  const std::uint64_t new_end = records.begin + count * records.record_bytes;
  if (is_version(head, 3, kExtendedAt)) move_place(head, kWaveformsAt, records.end(), new_end);
  if (is_version_14(head)) {
    move_place(head, kExtendedAt, records.end(), new_end);
    put(std::span(head), kCountAt, count);
  }
  return head;
}

/// The header with another number of vertices.
Result<std::vector<std::byte>> ply_head(std::span<const std::byte> head, std::uint64_t count) {
  const auto header = parse_ply_header(head);
  if (!header) return header.error();
  const PlyElement* const vertex = header.value().vertex();
  if (vertex == nullptr)
    return Error{
        .code = ErrorCode::kMalformedData, .message = "the header counts no vertices", .field = "vertex"};
  const std::string text = std::to_string(count);
  const auto number = std::as_bytes(std::span(text.data(), text.size()));
  const auto before = head.first(vertex->count_at);
  const auto behind = head.subspan(vertex->count_at + vertex->count_length);
  std::vector<std::byte> made(before.begin(), before.end());
  made.insert(made.end(), number.begin(), number.end());
  made.insert(made.end(), behind.begin(), behind.end());
  return made;
}

}  // namespace

void add_returns(const ScanRecords& records, std::span<const std::byte> chunk, ReturnCounts& counts) {
  for (std::size_t byte = 0; byte + records.record_bytes <= chunk.size(); byte += records.record_bytes) {
    const unsigned number = std::to_integer<unsigned>(chunk[byte + kReturnByte]) & records.return_mask();
    if (number > 0) ++counts.at(number - 1);
  }
}

Result<std::vector<std::byte>> head_of_result(const ScanRecords& records, std::span<const std::byte> scan,
                                              std::uint64_t count) {
  const auto before = scan.first(static_cast<std::size_t>(records.begin));
  if (count == records.count) return std::vector<std::byte>(before.begin(), before.end());
  if (records.format == CloudFormat::kPly) return ply_head(before, count);
  return las_head(records, {before.begin(), before.end()}, count);
}

void set_returns(std::span<std::byte> head, const ReturnCounts& counts) {
  // Where the older fields count nothing they say so, whatever stood there.
  const bool has_legacy = has_legacy_counts(head);
  if (!has_legacy) put(head, kLegacyCountAt, 0U);
  for (std::size_t k = 0; k < kLegacyReturns; ++k)
    put(head, kLegacyReturnsAt + sizeof(std::uint32_t) * k, has_legacy ? legacy(counts.at(k)) : 0U);
  if (is_version_14(head))
    for (std::size_t k = 0; k < counts.size(); ++k)
      put(head, kReturnsAt + sizeof(std::uint64_t) * k, counts.at(k));
}

}  // namespace pointwright::server
