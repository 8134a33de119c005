#include "server/jobs/scan_records.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <string_view>

#include "engine/io/las.h"
#include "engine/io/ply.h"

namespace pointwright::server {
namespace {

constexpr std::size_t kMostHeaderBytes = std::size_t{1} << 20;

template <typename T>
T load_as(const std::byte* from, bool swap) {
  std::array<std::byte, sizeof(T)> raw{};
  std::memcpy(raw.data(), from, sizeof(T));
  if (swap) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

template <typename T>
void store_as(std::byte* to, T value, bool swap) {
  auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  if (swap) std::reverse(raw.begin(), raw.end());
  std::memcpy(to, raw.data(), sizeof(T));
}

bool is_floating(ScalarType type) {
  return type == ScalarType::kFloat || type == ScalarType::kDouble;
}

/// Calls work with a value of the type.
template <typename Work>
auto with_type(ScalarType type, const Work& work) {
  switch (type) {
    case ScalarType::kInt8:
      return work(std::int8_t{});
    case ScalarType::kUint8:
      return work(std::uint8_t{});
    case ScalarType::kInt16:
      return work(std::int16_t{});
    case ScalarType::kUint16:
      return work(std::uint16_t{});
    case ScalarType::kInt32:
      return work(std::int32_t{});
    case ScalarType::kUint32:
      return work(std::uint32_t{});
    case ScalarType::kDouble:
      return work(double{});
    case ScalarType::kFloat:
      break;
  }
  return work(float{});
}

}  // namespace

double ScanRecords::number(const std::byte* record, const Place& place) const {
  return with_type(place.type, [&](auto zero) {
    return static_cast<double>(load_as<decltype(zero)>(record + place.byte, swap_));
  });
}

void ScanRecords::set_number(std::byte* record, const Place& place, double value) const {
  with_type(place.type, [&](auto zero) {
    using T = decltype(zero);
    if constexpr (std::is_integral_v<T>) {
      constexpr double kLeast = std::numeric_limits<T>::lowest();
      constexpr double kGreatest = std::numeric_limits<T>::max();
      store_as(record + place.byte, static_cast<T>(std::clamp(std::nearbyint(value), kLeast, kGreatest)),
               swap_);
    } else {
      store_as(record + place.byte, static_cast<T>(value), swap_);
    }
  });
}

Vec3d ScanRecords::position(const std::byte* record) const {
  Vec3d p(number(record, position_[0]), number(record, position_[1]), number(record, position_[2]));
  if (grid_) p = grid_->offset + grid_->scale.cwiseProduct(p);
  return p;
}

Vec3f ScanRecords::normal(const std::byte* record) const {
  return Vec3d(number(record, normal_[0]), number(record, normal_[1]), number(record, normal_[2]))
      .cast<float>();
}

void ScanRecords::set_position(std::byte* record, const Vec3d& position) const {
  const Vec3d p = grid_ ? Vec3d((position - grid_->offset).cwiseQuotient(grid_->scale)) : position;
  for (std::size_t axis = 0; axis < 3; ++axis)
    set_number(record, position_[axis], p[static_cast<Eigen::Index>(axis)]);
}

void ScanRecords::set_normal(std::byte* record, const Vec3f& normal) const {
  for (std::size_t axis = 0; axis < 3; ++axis)
    set_number(record, normal_[axis], static_cast<double>(normal[static_cast<Eigen::Index>(axis)]));
}

bool ScanRecords::can_say(const Vec3d& position) const {
  if (!grid_) return true;
  const Vec3d steps = (position - grid_->offset).cwiseQuotient(grid_->scale).cwiseAbs();
  return steps.maxCoeff() < static_cast<double>(std::numeric_limits<std::int32_t>::max());
}

Result<std::optional<ScanRecords>> ScanRecords::of(std::span<const std::byte> bytes) {
  const auto format = detect_format(bytes.first(std::min(bytes.size(), kMostHeaderBytes)));
  if (!format) return format.error();
  if (format.value() == CloudFormat::kPly) return of_ply(bytes);
  if (format.value() == CloudFormat::kLas) return of_las(bytes);
  return std::optional<ScanRecords>();
}

Result<std::optional<ScanRecords>> ScanRecords::of_ply(std::span<const std::byte> bytes) {
  const auto header = parse_ply_header(bytes);
  if (!header) return header.error();
  const PlyElement* const vertex = header.value().vertex();
  if (vertex == nullptr || vertex != header.value().elements.data() || vertex->has_lists() ||
      header.value().encoding == PlyEncoding::kAscii)
    return std::optional<ScanRecords>();
  ScanRecords records;
  records.can_grow_ = header.value().elements.size() == 1;
  records.count = vertex->count;
  records.record_bytes = vertex->least_row_bytes();
  records.begin = header.value().data_offset;
  records.swap_ = header.value().encoding == PlyEncoding::kBinaryBigEndian;
  constexpr std::array<const char*, 6> kNames{"x", "y", "z", "nx", "ny", "nz"};
  std::array<bool, 6> found{};
  std::uint64_t at = 0;
  for (const PlyProperty& property : vertex->properties) {
    for (std::size_t k = 0; k < kNames.size(); ++k) {
      if (property.name != kNames[k]) continue;
      (k < 3 ? records.position_[k] : records.normal_[k - 3]) = {.byte = at, .type = property.type};
      found[k] = true;
    }
    at += size_of(property.type);
  }
  if (!found[0] || !found[1] || !found[2])
    return Error{
        .code = ErrorCode::kMalformedData, .message = "the vertices have no x, y and z", .field = "vertex"};
  // Whole numbers cannot say a direction that has turned.
  const auto is_real = [](const Place& place) { return is_floating(place.type); };
  records.has_normals_ = found[3] && found[4] && found[5] &&
                         std::all_of(records.normal_.begin(), records.normal_.end(), is_real);
  if (!std::all_of(records.position_.begin(), records.position_.end(), is_real))
    return std::optional<ScanRecords>();
  records.find_mixed(*vertex);
  if (records.count == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the file has no samples", .field = "vertex"};
  if (records.count > (bytes.size() - records.begin) / records.record_bytes)
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "the file ends before all " + std::to_string(records.count) + " samples",
                 .field = "vertex"};
  return std::optional(records);
}

void ScanRecords::find_mixed(const PlyElement& vertex) {
  constexpr std::array<std::string_view, 3> kColors{"red", "green", "blue"};
  std::map<std::string_view, Place> rest;
  std::uint64_t at = 0;
  for (const PlyProperty& property : vertex.properties) {
    rest.emplace(property.name, Place{.byte = at, .type = property.type});
    at += size_of(property.type);
  }
  for (const char* const name : {"x", "y", "z"}) rest.erase(name);
  if (has_normals_)
    for (const char* const name : {"nx", "ny", "nz"}) rest.erase(name);
  for (const auto& [first, second] : kTexCoordNames) {
    const auto s = rest.find(first);
    const auto t = rest.find(second);
    if (s == rest.end() || t == rest.end() || s->second.type != ScalarType::kFloat ||
        t->second.type != ScalarType::kFloat)
      continue;
    texture_ = {s->second, t->second};
    rest.erase(s);
    rest.erase(t);
    break;
  }
  const bool has_colors =
      std::ranges::all_of(kColors, [&](std::string_view name) { return rest.contains(name); });
  for (const auto& [name, place] : rest) {
    const bool is_color = has_colors && (name == "alpha" || std::ranges::count(kColors, name) > 0);
    if (is_floating(place.type) || is_color) mixed_.push_back(place);
  }
}

Result<std::optional<ScanRecords>> ScanRecords::of_las(std::span<const std::byte> bytes) {
  const auto header = parse_las_header(bytes, std::numeric_limits<std::uint64_t>::max());
  if (!header) return header.error();
  ScanRecords records;
  records.format = CloudFormat::kLas;
  records.count = header.value().point_count;
  records.record_bytes = header.value().record_bytes;
  records.begin = header.value().point_offset;
  for (std::size_t axis = 0; axis < 3; ++axis)
    records.position_[axis] = {.byte = 4 * axis, .type = ScalarType::kInt32};
  records.grid_ = header.value().grid;
  for (const LasDimension& dimension : las_dimensions(header.value().point_format))
    if (std::string_view(dimension.name) == "return_number")
      records.return_mask_ = (1U << dimension.bits) - 1U;
    else if (dimension.bits == 0 && is_floating(dimension.type))
      records.mixed_.push_back({.byte = dimension.byte, .type = dimension.type});
  if (const auto color = las_color_byte(header.value().point_format))
    for (std::uint64_t channel = 0; channel < 3; ++channel)
      records.mixed_.push_back({.byte = *color + 2 * channel, .type = ScalarType::kUint16});
  std::uint64_t at = las_record_bytes(header.value().point_format);
  for (const LasExtraDimension& extra : header.value().extra) {
    constexpr std::uint8_t kFloatType = 9;
    constexpr std::uint8_t kDoubleType = 10;
    const bool is_double = extra.data_type == kDoubleType;
    for (std::uint32_t k = 0; k < extra.components && (is_double || extra.data_type == kFloatType); ++k)
      records.mixed_.push_back({.byte = at + (is_double ? 8U : 4U) * std::uint64_t{k},
                                .type = is_double ? ScalarType::kDouble : ScalarType::kFloat});
    at += extra.bytes;
  }
  return std::optional(records);
}

}  // namespace pointwright::server
