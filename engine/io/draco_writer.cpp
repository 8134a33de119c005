#include <draco/compression/expert_encode.h>
#include <draco/core/encoder_buffer.h>
#include <draco/metadata/geometry_metadata.h>
#include <draco/point_cloud/point_cloud.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <type_traits>

#include "engine/io/draco_codec.h"

namespace pointwright {
namespace {

template <typename T>
constexpr draco::DataType data_type_of() {
  if constexpr (std::is_same_v<T, std::int8_t>) return draco::DT_INT8;
  if constexpr (std::is_same_v<T, std::uint8_t>) return draco::DT_UINT8;
  if constexpr (std::is_same_v<T, std::int16_t>) return draco::DT_INT16;
  if constexpr (std::is_same_v<T, std::uint16_t>) return draco::DT_UINT16;
  if constexpr (std::is_same_v<T, std::int32_t>) return draco::DT_INT32;
  if constexpr (std::is_same_v<T, std::uint32_t>) return draco::DT_UINT32;
  if constexpr (std::is_same_v<T, float>) return draco::DT_FLOAT32;
  return draco::DT_FLOAT64;
}

class CloudBuilder {
 public:
  explicit CloudBuilder(const ExportView& view) : view_(view) {
    target_.set_num_points(static_cast<draco::PointIndex::ValueType>(view.size()));
  }

  // One attribute of `components` values of type T a sample; put(sample, out) writes them. Returns its id.
  template <typename T, typename Put>
  int add(draco::GeometryAttribute::Type kind, std::uint8_t components, const Put& put) {
    draco::GeometryAttribute shape;
    const auto stride = static_cast<std::int64_t>(sizeof(T)) * components;
    shape.Init(kind, nullptr, components, data_type_of<T>(), false, stride, 0);
    const int id =
        target_.AddAttribute(shape, true, static_cast<draco::AttributeValueIndex::ValueType>(view_.size()));
    std::uint8_t* out = target_.attribute(id)->GetAddress(draco::AttributeValueIndex(0));
    std::array<T, 4> values{};
    for (std::size_t row = 0; row < view_.size(); ++row) {
      put(view_.sample(row), values.data());
      std::memcpy(out, values.data(), static_cast<std::size_t>(stride));
      out += stride;
    }
    return id;
  }

  void describe(int id, const std::string& name, const char* type) {
    auto metadata = std::make_unique<draco::AttributeMetadata>();
    metadata->AddEntryString(kDracoNameKey, name);
    if (type != nullptr) metadata->AddEntryString(kDracoTypeKey, type);
    if (target_.GetMetadata() == nullptr) target_.AddMetadata(std::make_unique<draco::GeometryMetadata>());
    target_.AddAttributeMetadata(id, std::move(metadata));
  }

  draco::PointCloud& target() { return target_; }
  draco::GeometryMetadata& metadata() {
    if (target_.GetMetadata() == nullptr) target_.AddMetadata(std::make_unique<draco::GeometryMetadata>());
    return *target_.metadata();
  }

 private:
  const ExportView& view_;
  draco::PointCloud target_;
};

// Positions: around the origin where that gives them back to the bit (or bits are given up anyway), else as
// they are.
int add_positions(const ExportView& view, bool quantised, CloudBuilder& builder) {
  const Cloud& cloud = view.cloud();
  constexpr auto kPosition = draco::GeometryAttribute::POSITION;
  const bool relative = cloud.exact_position.empty() || quantised;
  if (!relative && view.needs_double()) {
    return builder.add<double>(kPosition, 3, [&](std::uint32_t i, double* out) {
      const auto p = view.position(i);
      std::copy(p.begin(), p.end(), out);
    });
  }
  if (relative) {
    if (!cloud.origin.isZero(0.0)) {
      builder.metadata().AddEntryDoubleArray(kDracoOriginKey,
                                             {cloud.origin.x(), cloud.origin.y(), cloud.origin.z()});
    }
    if (cloud.position_is_double) builder.metadata().AddEntryInt(kDracoDoubleKey, 1);
  }
  return builder.add<float>(kPosition, 3, [&](std::uint32_t i, float* out) {
    const auto p = view.position(i);
    const Vec3f local = cloud.position[i];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      out[axis] = relative ? local[static_cast<Eigen::Index>(axis)] : static_cast<float>(p[axis]);
    }
  });
}

void add_standard_columns(const Cloud& cloud, CloudBuilder& builder) {
  if (cloud.has_normals()) {
    builder.add<float>(draco::GeometryAttribute::NORMAL, 3, [&](std::uint32_t i, float* out) {
      out[0] = cloud.normal.x()[i];
      out[1] = cloud.normal.y()[i];
      out[2] = cloud.normal.z()[i];
    });
  }
  if (cloud.has_colors()) {
    const std::uint8_t channels = cloud.color_has_alpha ? 4 : 3;
    builder.add<std::uint8_t>(draco::GeometryAttribute::COLOR, channels,
                              [&](std::uint32_t i, std::uint8_t* out) {
                                std::copy(cloud.color[i].begin(), cloud.color[i].begin() + channels, out);
                              });
  }
  if (!cloud.texcoord.empty()) {
    builder.add<float>(draco::GeometryAttribute::TEX_COORD, 2, [&](std::uint32_t i, float* out) {
      std::copy(cloud.texcoord[i].begin(), cloud.texcoord[i].end(), out);
    });
  }
}

// libdraco codes integers as differences that it folds and shifts in 32 bits. Spans from somewhat below 2^31
// on come back wrong without a word; a quarter of that leaves room for whatever it does on the way.
template <typename T>
bool spans_too_much(const std::vector<T>& values) {
  if constexpr (std::is_integral_v<T> && sizeof(T) == 4) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    constexpr std::int64_t kMost = std::int64_t{1} << 29;
    return std::int64_t{*high} > kMost || std::int64_t{*low} < -kMost ||
           std::int64_t{*high} - std::int64_t{*low} >= kMost;
  }
  return false;
}

template <typename T>
void add_scalar(const std::vector<T>& values, const std::string& name, CloudBuilder& builder) {
  constexpr auto kGeneric = draco::GeometryAttribute::GENERIC;
  if (spans_too_much(values)) {
    const int wide = builder.add<double>(
        kGeneric, 1, [&](std::uint32_t i, double* out) { *out = static_cast<double>(values[i]); });
    builder.describe(wide, name, std::is_signed_v<T> ? "int32" : "uint32");
    return;
  }
  const int id = builder.add<T>(kGeneric, 1, [&](std::uint32_t i, T* out) { *out = values[i]; });
  builder.describe(id, name, nullptr);
}

void add_scalars(const ExportView& view, CloudBuilder& builder) {
  for (std::size_t s = 0; s < view.cloud().scalars.size(); ++s) {
    std::visit([&](const auto& values) { add_scalar(values, view.scalar_names()[s], builder); },
               view.cloud().scalars[s].values);
  }
}

// How integers, and with them quantised positions, are written.
enum class Coding {
  kEntropy,  // as differences from the sample before, in the bits that their frequencies call for
  kPlain,    // as they are, in whole bytes
};

// The look-up tables of libdraco's decoder take four bytes for each of up to 2^20 states; one that outgrows
// the cache costs a miss a coordinate. At this speed the tables are a quarter as large as at the middle one,
// for 0 to 5 percent more bytes.
constexpr int kFastestDecoding = 10;

draco::Status encode(draco::PointCloud& cloud, int position, int position_bits, Coding coding,
                     draco::EncoderBuffer& buffer) {
  draco::ExpertEncoder encoder(cloud);
  encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
  encoder.SetSpeedOptions(kFastestDecoding, kFastestDecoding);
  if (position_bits > 0) encoder.SetAttributeQuantization(position, position_bits);
  if (coding == Coding::kPlain) {
    encoder.SetUseBuiltInAttributeCompression(false);
    draco::Status set = encoder.SetAttributePredictionScheme(position, draco::PREDICTION_NONE);
    if (!set.ok()) return set;
  }
  return encoder.EncodeToBuffer(&buffer);
}

// Entropy coding has to save more than a sixth. In a coherent order it saves over a half; of 14 bits in
// random order an eighth, and takes seven times as long to decode.
bool is_worth_decoding(const draco::EncoderBuffer& coded, const draco::EncoderBuffer& plain) {
  return 6 * coded.size() < 5 * plain.size();
}

}  // namespace

Result<std::vector<std::byte>> write_draco(const ExportView& view, int position_bits) {
  CloudBuilder builder(view);
  const int position = add_positions(view, position_bits > 0, builder);
  add_standard_columns(view.cloud(), builder);
  add_scalars(view, builder);
  draco::EncoderBuffer buffer;
  draco::Status status = encode(builder.target(), position, position_bits, Coding::kEntropy, buffer);
  if (status.ok() && position_bits > 0) {
    draco::EncoderBuffer plain;
    status = encode(builder.target(), position, position_bits, Coding::kPlain, plain);
    if (status.ok() && !is_worth_decoding(buffer, plain)) std::swap(buffer, plain);
  }
  if (!status.ok()) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "Draco cannot hold this cloud: " + status.error_msg_string(),
                 .field = {}};
  }
  const auto* begin = reinterpret_cast<const std::byte*>(buffer.data());
  return std::vector<std::byte>(begin, begin + buffer.size());
}

}  // namespace pointwright
