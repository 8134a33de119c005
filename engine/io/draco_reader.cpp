#include <draco/compression/decode.h>
#include <draco/core/decoder_buffer.h>
#include <draco/point_cloud/point_cloud.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <set>

#include "engine/io/draco_codec.h"
#include "engine/io/draco_gate.h"

namespace pointwright {
namespace {

Error malformed(std::string what) {
  return Error{
      .code = ErrorCode::kMalformedData, .message = "the Draco file " + std::move(what), .field = {}};
}

// Column by column out of a decoded point cloud, names made unique on the way.
class ColumnReader {
 public:
  explicit ColumnReader(const draco::PointCloud& cloud) : cloud_(cloud) {}

  Result<std::vector<ScalarAttribute>> read_all() {
    const draco::PointAttribute* position = cloud_.GetNamedAttribute(draco::GeometryAttribute::POSITION);
    if (position == nullptr || position->num_components() != 3)
      return malformed("has no positions of three coordinates");
    if (auto done = add(*position, {"x", "y", "z"}); !done) return done.error();
    for (std::int32_t id = 0; id < cloud_.num_attributes(); ++id) {
      const draco::PointAttribute* attribute = cloud_.attribute(id);
      if (attribute == position) continue;
      if (auto done = add(*attribute, names_of(*attribute, id)); !done) return done.error();
      restore_type(id);
    }
    return std::move(columns_);
  }

 private:
  // The columns' names by what the attribute is; only the first of a kind gets the standard ones.
  std::vector<std::string> names_of(const draco::PointAttribute& attribute, std::int32_t id) {
    const int components = attribute.num_components();
    const auto kind = attribute.attribute_type();
    const bool first = cloud_.GetNamedAttribute(kind) == &attribute;
    std::string base = "generic_" + std::to_string(attribute.unique_id());
    if (kind == draco::GeometryAttribute::POSITION)
      base = "position_" + std::to_string(attribute.unique_id());
    if (kind == draco::GeometryAttribute::NORMAL) {
      if (first && components == 3) return {"nx", "ny", "nz"};
      base = "normal_" + std::to_string(attribute.unique_id());
    }
    if (kind == draco::GeometryAttribute::COLOR) {
      if (first && components == 3) return {"red", "green", "blue"};
      if (first && components == 4) return {"red", "green", "blue", "alpha"};
      base = "color_" + std::to_string(attribute.unique_id());
    }
    if (kind == draco::GeometryAttribute::TEX_COORD) {
      if (first && components == 2) return {"s", "t"};
      base = "texcoord_" + std::to_string(attribute.unique_id());
    }
    const draco::AttributeMetadata* metadata = cloud_.GetAttributeMetadataByAttributeId(id);
    std::string name;
    if (metadata != nullptr && metadata->GetEntryString(kDracoNameKey, &name) && !name.empty())
      base = clean_name(name);
    if (components == 1) return {base};
    std::vector<std::string> names;
    names.reserve(static_cast<std::size_t>(components));
    for (int c = 0; c < components; ++c) names.push_back(base + "_" + std::to_string(c));
    return names;
  }

  Result<void> add(const draco::PointAttribute& attribute, const std::vector<std::string>& names) {
    if (!is_sound(attribute)) return malformed("has an attribute that does not reach all points");
    for (std::size_t c = 0; c < names.size(); ++c) {
      ScalarAttribute column{names[c], {}};
      while (!taken_.insert(column.name).second) column.name = "generic_" + column.name;
      if (auto done = fill(attribute, c, column.values); !done) return done;
      columns_.push_back(std::move(column));
    }
    return {};
  }

  // Integers that our writer kept as float64 because libdraco cannot code them.
  void restore_type(std::int32_t id) {
    const draco::AttributeMetadata* metadata = cloud_.GetAttributeMetadataByAttributeId(id);
    std::string type;
    if (metadata == nullptr || !metadata->GetEntryString(kDracoTypeKey, &type)) return;
    const auto* doubles = std::get_if<std::vector<double>>(&columns_.back().values);
    if (doubles == nullptr) return;
    if (type == "int32") columns_.back().values = as_integers<std::int32_t>(*doubles);
    if (type == "uint32") columns_.back().values = as_integers<std::uint32_t>(*doubles);
  }

  // The same values as integers; as they are where one of them is none.
  template <typename T>
  static ScalarAttribute::Values as_integers(const std::vector<double>& doubles) {
    std::vector<T> integers;
    integers.reserve(doubles.size());
    for (const double value : doubles) {
      const bool fits = value >= static_cast<double>(std::numeric_limits<T>::lowest()) &&
                        value <= static_cast<double>(std::numeric_limits<T>::max()) &&
                        std::floor(value) == value;
      if (!fits) return doubles;
      integers.push_back(static_cast<T>(value));
    }
    return integers;
  }

  // Every point's value lies inside the attribute's buffer.
  [[nodiscard]] bool is_sound(const draco::PointAttribute& attribute) const {
    const std::size_t n = cloud_.num_points();
    const auto value_bytes = static_cast<std::size_t>(draco::DataTypeLength(attribute.data_type())) *
                             static_cast<std::size_t>(attribute.num_components());
    if (attribute.buffer() == nullptr || value_bytes == 0) return false;
    const auto stride = static_cast<std::size_t>(attribute.byte_stride());
    const auto offset = static_cast<std::size_t>(attribute.byte_offset());
    const std::size_t held = attribute.buffer()->data_size();
    if (stride < value_bytes || held < offset || attribute.size() > (held - offset) / stride) return false;
    if (attribute.is_mapping_identity()) return n <= attribute.size();
    if (attribute.indices_map_size() < n) return false;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (attribute.mapped_index(draco::PointIndex(i)).value() >= attribute.size()) return false;
    }
    return true;
  }

  template <typename From, typename To>
  [[nodiscard]] std::vector<To> component(const draco::PointAttribute& attribute, std::size_t c) const {
    std::vector<To> values(cloud_.num_points());
    for (std::uint32_t i = 0; i < values.size(); ++i) {
      From value{};
      std::memcpy(&value,
                  attribute.GetAddress(attribute.mapped_index(draco::PointIndex(i))) + c * sizeof(From),
                  sizeof(From));
      values[i] = static_cast<To>(value);
    }
    return values;
  }

  Result<void> fill(const draco::PointAttribute& attribute, std::size_t c,
                    ScalarAttribute::Values& values) const {
    switch (attribute.data_type()) {
      case draco::DT_INT8:
        values = component<std::int8_t, std::int8_t>(attribute, c);
        return {};
      case draco::DT_BOOL:
      case draco::DT_UINT8:
        values = component<std::uint8_t, std::uint8_t>(attribute, c);
        return {};
      case draco::DT_INT16:
        values = component<std::int16_t, std::int16_t>(attribute, c);
        return {};
      case draco::DT_UINT16:
        values = component<std::uint16_t, std::uint16_t>(attribute, c);
        return {};
      case draco::DT_INT32:
        values = component<std::int32_t, std::int32_t>(attribute, c);
        return {};
      case draco::DT_UINT32:
        values = component<std::uint32_t, std::uint32_t>(attribute, c);
        return {};
      case draco::DT_FLOAT32:
        values = component<float, float>(attribute, c);
        return {};
      case draco::DT_FLOAT64:
        values = component<double, double>(attribute, c);
        return {};
      case draco::DT_INT64:
        return fill_wide<std::int64_t>(attribute, c, values);
      case draco::DT_UINT64:
        return fill_wide<std::uint64_t>(attribute, c, values);
      default:
        return malformed("has an attribute of unknown type");
    }
  }

  // 64-bit integers have no column type of their own; doubles hold them up to 2^53.
  template <typename Wide>
  Result<void> fill_wide(const draco::PointAttribute& attribute, std::size_t c,
                         ScalarAttribute::Values& values) const {
    constexpr double kWhole = 9007199254740992.0;
    auto doubles = component<Wide, double>(attribute, c);
    for (const double value : doubles) {
      if (std::abs(value) >= kWhole) {
        return Error{.code = ErrorCode::kUnsupportedFormat,
                     .message = "the Draco file has a 64-bit attribute with values of 2^53 and more",
                     .field = {}};
      }
    }
    values = std::move(doubles);
    return {};
  }

  const draco::PointCloud& cloud_;
  std::vector<ScalarAttribute> columns_;
  std::set<std::string> taken_;
};

Result<std::unique_ptr<draco::PointCloud>> decode(std::span<const std::byte> bytes) {
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    draco::Decoder decoder;
    auto decoded = decoder.DecodePointCloudFromBuffer(&buffer);
    if (!decoded.ok())
      return malformed("cannot be decoded: " + clean_name(decoded.status().error_msg_string()));
    return std::move(decoded).value();
  } catch (const std::bad_alloc&) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the Draco file asks for more memory than there is",
                 .field = {}};
  } catch (const std::exception&) {
    return malformed("cannot be decoded");
  }
}

// Where our own writer put them: the origin of the positions and what the file before had been.
Result<void> apply_metadata(const draco::PointCloud& source, Cloud& cloud) {
  const draco::GeometryMetadata* metadata = source.GetMetadata();
  if (metadata == nullptr) return {};
  std::int32_t is_double = 0;
  if (metadata->GetEntryInt(kDracoDoubleKey, &is_double) && is_double == 1) cloud.position_is_double = true;
  std::vector<double> origin;
  if (!metadata->GetEntryDoubleArray(kDracoOriginKey, &origin)) return {};
  const bool is_finite =
      origin.size() == 3 && std::isfinite(origin[0]) && std::isfinite(origin[1]) && std::isfinite(origin[2]);
  if (!is_finite) return malformed("has an origin that is not three finite numbers");
  cloud.origin = Vec3d(origin[0], origin[1], origin[2]);
  for (auto& p : cloud.exact_position) {
    for (std::size_t axis = 0; axis < 3; ++axis) p[axis] += origin[axis];
  }
  return {};
}

}  // namespace

Result<ImportedCloud> read_draco(std::span<const std::byte> bytes, const ImportParams& params) {
  auto claim = draco_gate(bytes, params.max_samples);
  if (!claim) return claim.error();
  auto decoded = decode(bytes);
  if (!decoded) return decoded.error();
  const draco::PointCloud& source = *decoded.value();
  if (source.num_points() > params.max_samples) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the file unpacks to " + std::to_string(source.num_points()) +
                            " samples; at most " + std::to_string(params.max_samples) + " are taken",
                 .field = {},
                 .limit = static_cast<double>(params.max_samples),
                 .actual = static_cast<double>(source.num_points())};
  }
  if (!claim.value().is_mesh && source.num_points() != claim.value().points)
    return malformed("holds another number of points than it says");
  auto columns = ColumnReader(source).read_all();
  if (!columns) return columns.error();
  ImportReport report;
  report.format = CloudFormat::kDraco;
  report.encoding = claim.value().encoding;
  report.declared_count = claim.value().points;
  report.from_mesh = claim.value().is_mesh && claim.value().faces > 0;
  auto result = assemble_cloud(std::move(columns).value(), std::move(report));
  if (!result) return result;
  if (auto applied = apply_metadata(source, result.value().cloud); !applied) return applied.error();
  return result;
}

}  // namespace pointwright
