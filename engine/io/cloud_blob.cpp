#include "engine/io/cloud_blob.h"

#include <cstdint>
#include <cstring>
#include <string>

#include "engine/io/text.h"

namespace pointwright {
namespace {

constexpr std::uint64_t kMagic = 0x32424c4254575054ULL;  // changes with the layout
constexpr std::uint64_t kMostScalars = 4096;
constexpr std::uint64_t kMostStrings = 65536;
constexpr std::uint64_t kLongestString = 4096;

enum Column : std::uint32_t {
  kNormal = 1,
  kColor = 2,
  kTexCoord = 4,
  kExactPosition = 8,
  kHasAlpha = 16,
  kIsDouble = 32,
};
constexpr std::uint32_t kEveryFlag = 63;

class Writer {
 public:
  explicit Writer(const BlobSink& sink) : sink_(sink) {}

  template <typename T>
  void value(const T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    sink_(std::as_bytes(std::span(&v, 1)));
  }
  template <typename T>
  void array(const T* data, std::size_t count) {
    if (count > 0) sink_(std::as_bytes(std::span(data, count)));
  }
  void text(const std::string& s) {
    value(static_cast<std::uint64_t>(s.size()));
    array(s.data(), s.size());
  }
  void points(const Points& points) {
    for (const float* column : {points.x(), points.y(), points.z()}) array(column, points.size());
  }
  void vector(const Vec3d& v) { array(v.data(), 3); }
  void texts(const std::vector<std::string>& list) {
    value(static_cast<std::uint64_t>(list.size()));
    for (const std::string& s : list) text(s);
  }

 private:
  const BlobSink& sink_;
};

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <typename T>
  bool value(T& v) {
    return array(&v, 1);
  }
  template <typename T>
  bool array(T* data, std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!has(count, sizeof(T))) return false;
    if (count > 0) std::memcpy(static_cast<void*>(data), bytes_.data(), count * sizeof(T));
    bytes_ = bytes_.subspan(count * sizeof(T));
    return true;
  }
  template <typename T>
  bool column(std::vector<T>& values, std::uint64_t count) {
    if (!has(count, sizeof(T))) return false;
    values.resize(count);
    return array(values.data(), values.size());
  }
  bool points(Points& points, std::uint64_t count) {
    if (!has(count, 3 * sizeof(float))) return false;
    points.resize(count);
    return array(points.x(), count) && array(points.y(), count) && array(points.z(), count);
  }
  bool text(std::string& s) {
    std::uint64_t length = 0;
    if (!value(length) || length > kLongestString || !has(length, 1)) return false;
    s.resize(length);
    return array(s.data(), s.size()) && clean_text(s) == s;
  }
  bool texts(std::vector<std::string>& list) {
    std::uint64_t count = 0;
    if (!value(count) || count > kMostStrings) return false;
    for (std::uint64_t i = 0; i < count; ++i) {
      if (!text(list.emplace_back())) return false;
    }
    return true;
  }
  bool vector(Vec3d& v) { return array(v.data(), 3); }
  [[nodiscard]] bool is_done() const { return bytes_.empty(); }

 private:
  [[nodiscard]] bool has(std::uint64_t count, std::size_t size) const {
    return count <= bytes_.size() / size;
  }
  std::span<const std::byte> bytes_;
};

std::uint32_t flags_of(const Cloud& cloud) {
  std::uint32_t flags = 0;
  if (cloud.has_normals()) flags |= kNormal;
  if (cloud.has_colors()) flags |= kColor;
  if (!cloud.texcoord.empty()) flags |= kTexCoord;
  if (!cloud.exact_position.empty()) flags |= kExactPosition;
  if (cloud.color_has_alpha) flags |= kHasAlpha;
  if (cloud.position_is_double) flags |= kIsDouble;
  return flags;
}

void write_report(const ImportReport& report, Writer& out) {
  out.value(static_cast<std::uint32_t>(report.format));
  out.value(static_cast<std::uint32_t>((report.from_mesh ? 1U : 0U) | (report.position_is_double ? 2U : 0U) |
                                       (report.grid ? 4U : 0U)));
  out.value(static_cast<std::uint32_t>(report.normals));
  if (report.grid) {
    out.vector(report.grid->scale);
    out.vector(report.grid->offset);
  }
  out.text(report.encoding);
  for (const std::uint64_t count :
       {report.declared_count, report.sample_count, report.dropped_non_finite, report.duplicate_count}) {
    out.value(count);
  }
  out.texts(report.attributes);
  out.texts(report.skipped);
  out.vector(report.bounds_min);
  out.vector(report.bounds_max);
}

bool read_report(Reader& in, ImportReport& report) {
  std::uint32_t format = 0;
  std::uint32_t flags = 0;
  if (!in.value(format) || format > static_cast<std::uint32_t>(kLastCloudFormat)) return false;
  report.format = static_cast<CloudFormat>(format);
  std::uint32_t normals = 0;
  if (!in.value(flags) || flags > 7) return false;
  if (!in.value(normals) || normals > static_cast<std::uint32_t>(NormalQuality::kScaled)) return false;
  report.normals = static_cast<NormalQuality>(normals);
  if ((flags & 4U) != 0) {
    PositionGrid& grid = report.grid.emplace();
    if (!in.vector(grid.scale) || !in.vector(grid.offset)) return false;
  }
  report.from_mesh = (flags & 1U) != 0;
  report.position_is_double = (flags & 2U) != 0;
  const bool read = in.text(report.encoding) && in.value(report.declared_count) &&
                    in.value(report.sample_count) && in.value(report.dropped_non_finite) &&
                    in.value(report.duplicate_count) && in.texts(report.attributes) &&
                    in.texts(report.skipped) && in.vector(report.bounds_min) && in.vector(report.bounds_max);
  return read;
}

bool read_scalars(Reader& in, std::uint64_t n, std::vector<ScalarAttribute>& scalars) {
  std::uint64_t count = 0;
  if (!in.value(count) || count > kMostScalars) return false;
  for (std::uint64_t s = 0; s < count; ++s) {
    ScalarAttribute& scalar = scalars.emplace_back();
    std::uint32_t type = 0;
    if (!in.text(scalar.name) || clean_name(scalar.name) != scalar.name) return false;
    if (!in.value(type) || type > static_cast<std::uint32_t>(ScalarType::kDouble)) return false;
    scalar.values = make_values(static_cast<ScalarType>(type));
    if (!std::visit([&](auto& values) { return in.column(values, n); }, scalar.values)) return false;
  }
  return true;
}

bool is_permutation(const std::vector<std::uint32_t>& ids) {
  std::vector<bool> seen(ids.size(), false);
  for (const std::uint32_t id : ids) {
    if (id >= ids.size() || seen[id]) return false;
    seen[id] = true;
  }
  return true;
}

bool read_all(Reader& in, ImportedCloud& imported) {
  Cloud& cloud = imported.cloud;
  std::uint64_t magic = 0;
  std::uint64_t n = 0;
  std::uint32_t flags = 0;
  if (!in.value(magic) || magic != kMagic || !in.value(n) || !in.value(flags) || (flags & ~kEveryFlag) != 0)
    return false;
  if (!read_report(in, imported.report) || !in.vector(cloud.origin)) return false;
  cloud.color_has_alpha = (flags & kHasAlpha) != 0;
  cloud.position_is_double = (flags & kIsDouble) != 0;
  if (!in.column(cloud.id, n) || !in.points(cloud.position, n)) return false;
  if ((flags & kNormal) != 0 && !in.points(cloud.normal, n)) return false;
  if ((flags & kColor) != 0 && !in.column(cloud.color, n)) return false;
  if ((flags & kTexCoord) != 0 && !in.column(cloud.texcoord, n)) return false;
  if ((flags & kExactPosition) != 0 && !in.column(cloud.exact_position, n)) return false;
  return read_scalars(in, n, cloud.scalars) && in.is_done() && is_permutation(cloud.id);
}

}  // namespace

void write_cloud_blob(const ImportedCloud& imported, const BlobSink& sink) {
  const Cloud& cloud = imported.cloud;
  Writer out(sink);
  out.value(kMagic);
  out.value(static_cast<std::uint64_t>(cloud.size()));
  out.value(flags_of(cloud));
  write_report(imported.report, out);
  out.vector(cloud.origin);
  out.array(cloud.id.data(), cloud.id.size());
  out.points(cloud.position);
  out.points(cloud.normal);
  out.array(cloud.color.data(), cloud.color.size());
  out.array(cloud.texcoord.data(), cloud.texcoord.size());
  out.array(cloud.exact_position.data(), cloud.exact_position.size());
  out.value(static_cast<std::uint64_t>(cloud.scalars.size()));
  for (const ScalarAttribute& scalar : cloud.scalars) {
    out.text(scalar.name);
    out.value(static_cast<std::uint32_t>(scalar.values.index()));
    std::visit([&](const auto& values) { out.array(values.data(), values.size()); }, scalar.values);
  }
}

std::vector<std::byte> cloud_blob(const ImportedCloud& imported) {
  std::vector<std::byte> blob;
  write_cloud_blob(imported, [&](std::span<const std::byte> piece) {
    blob.insert(blob.end(), piece.begin(), piece.end());
  });
  return blob;
}

Result<ImportedCloud> read_cloud_blob(std::span<const std::byte> bytes) {
  Reader in(bytes);
  ImportedCloud imported;
  if (read_all(in, imported)) return imported;
  return Error{.code = ErrorCode::kMalformedData, .message = "the bytes are no decoded cloud", .field = {}};
}

}  // namespace pointwright
