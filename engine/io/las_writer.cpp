#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "engine/io/las.h"

namespace pointwright {
namespace {

constexpr double kLargestInteger = 2147483647.0;
constexpr std::size_t kHeader12 = 227;
constexpr std::size_t kLongestName = 32;
constexpr std::size_t kMostDescriptors = 65535 / kLasExtraDescriptorBytes;

struct AxisRange {
  double min = std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::lowest();
};

std::array<AxisRange, 3> ranges_of(const ExportView& view) {
  std::array<AxisRange, 3> ranges;
  for (std::size_t row = 0; row < view.size(); ++row) {
    const auto p = view.position(view.sample(row));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ranges[axis].min = std::min(ranges[axis].min, p[axis]);
      ranges[axis].max = std::max(ranges[axis].max, p[axis]);
    }
  }
  return ranges;
}

double integer_of(double p, double scale, double offset) {
  return std::round((p - offset) / scale);
}
double place_of(double integer, double scale, double offset) {
  return integer * scale + offset;
}

bool spans(const AxisRange& range, double scale, double offset) {
  return std::abs(integer_of(range.min, scale, offset)) <= kLargestInteger &&
         std::abs(integer_of(range.max, scale, offset)) <= kLargestInteger;
}

// Whether the grid holds every position of the axis: to the bit, or to `steps` steps of its float64.
bool holds(const ExportView& view, std::size_t axis, double scale, double offset, double steps) {
  for (std::size_t row = 0; row < view.size(); ++row) {
    const double p = view.position(view.sample(row))[axis];
    const double there = place_of(integer_of(p, scale, offset), scale, offset);
    const double step = std::nextafter(std::abs(p), std::numeric_limits<double>::max()) - std::abs(p);
    if (std::abs(there - p) > steps * step) return false;
  }
  return true;
}

struct AxisGrid {
  double scale = 1.0;
  double offset = 0.0;
};

// The finest power of two that spans the range, its offset a multiple of it: sums are then exact.
AxisGrid finest_grid(const AxisRange& range) {
  constexpr double kMostStep = 1.0 / 4294967290.0;
  const double farthest = std::max(std::abs(range.min), std::abs(range.max));
  if (farthest == 0.0) return {.scale = 0x1.0p-20, .offset = 0.0};
  // Float64 makes no smaller step at the farthest coordinate.
  const double least = std::exp2(std::floor(std::log2(farthest)) - 52.0);
  const double extent = range.max - range.min;
  double scale = extent > 0.0 ? std::exp2(std::ceil(std::log2(extent * kMostStep))) : least;
  scale = std::max(scale, least);
  const double offset = std::round(0.5 * range.min / scale + 0.5 * range.max / scale) * scale;
  if (!spans(range, scale, offset)) scale *= 2.0;
  return {.scale = scale, .offset = std::round(offset / scale) * scale};
}

AxisGrid grid_of_axis(const ExportView& view, std::size_t axis, const AxisRange& range,
                      const std::optional<PositionGrid>& wanted) {
  if (wanted) {
    const auto i = static_cast<Eigen::Index>(axis);
    AxisGrid grid{.scale = std::abs(wanted->scale[i]), .offset = wanted->offset[i]};
    if (wanted->scale.allFinite() && wanted->offset.allFinite() && grid.scale > 0.0 &&
        spans(range, grid.scale, grid.offset)) {
      if (holds(view, axis, grid.scale, grid.offset, 0.0)) return grid;
      // Halves of it hold all that it holds, to the bit. Below a step of float64 they add nothing.
      const double farthest = std::max({std::abs(range.min), std::abs(range.max), grid.scale});
      const double least = farthest * 0x1.0p-53;
      while (grid.scale > least && spans(range, 0.5 * grid.scale, grid.offset)) grid.scale *= 0.5;
      return grid;
    }
  }
  for (const double scale : {1.0, 0.1, 0.01, 0.001, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9}) {
    // An offset where zero is too far off: a multiple of a round number, so that decimals stay decimals.
    const double round_number = scale * 1e9;
    const double offset = spans(range, scale, 0.0)
                              ? 0.0
                              : std::round(0.5 * (range.min + range.max) / round_number) * round_number;
    if (spans(range, scale, offset) && holds(view, axis, scale, offset, 1.0))
      return {.scale = scale, .offset = offset};
  }
  return finest_grid(range);
}

// ---- what goes where ----

// A scalar and its place in a record.
struct Placed {
  const ScalarAttribute* scalar = nullptr;
  LasDimension at{};
};

const ScalarAttribute* scalar_named(const Cloud& cloud, std::string_view name, ScalarType type) {
  for (const ScalarAttribute& scalar : cloud.scalars) {
    if (scalar.name == name && type_of(scalar) == type) return &scalar;
  }
  return nullptr;
}

template <typename T>
const std::vector<T>& values_of(const ScalarAttribute& scalar) {
  return std::get<std::vector<T>>(scalar.values);
}

bool fits_bits(const ScalarAttribute& scalar, unsigned bits) {
  const auto& values = values_of<std::uint8_t>(scalar);
  return std::all_of(values.begin(), values.end(), [&](unsigned v) { return v < (1U << bits); });
}

const ScalarAttribute* standard(const Cloud& cloud, const LasDimension& dimension) {
  const ScalarAttribute* scalar = scalar_named(cloud, dimension.name, dimension.type);
  if (scalar == nullptr || (dimension.bits > 0 && !fits_bits(*scalar, dimension.bits))) return nullptr;
  return scalar;
}

std::array<const ScalarAttribute*, 3> wide_colors(const Cloud& cloud) {
  std::array<const ScalarAttribute*, 3> wide{scalar_named(cloud, "red_16", ScalarType::kUint16),
                                             scalar_named(cloud, "green_16", ScalarType::kUint16),
                                             scalar_named(cloud, "blue_16", ScalarType::kUint16)};
  const bool all = cloud.has_colors() && wide[0] != nullptr && wide[1] != nullptr && wide[2] != nullptr;
  return all ? wide : std::array<const ScalarAttribute*, 3>{};
}

// Whether a column needs version 1.4: one that older formats lack, or more of one than they hold.
bool needs_modern(const Cloud& cloud) {
  for (const LasDimension& modern : las_dimensions(8)) {
    if (standard(cloud, modern) == nullptr) continue;
    const auto legacy = las_dimensions(1);
    const auto same = std::find_if(legacy.begin(), legacy.end(), [&](const LasDimension& d) {
      return std::string_view(d.name) == modern.name;
    });
    if (same == legacy.end() || standard(cloud, *same) == nullptr) return true;
  }
  return false;
}

std::uint8_t chosen_format(const Cloud& cloud) {
  if (needs_modern(cloud)) {
    if (scalar_named(cloud, "nir", ScalarType::kUint16) != nullptr) return 8;
    return cloud.has_colors() ? 7 : 6;
  }
  const bool has_time = scalar_named(cloud, "gps_time", ScalarType::kDouble) != nullptr;
  return static_cast<std::uint8_t>((has_time ? 1 : 0) + (cloud.has_colors() ? 2 : 0));
}

struct ExtraColumn {
  std::string name;
  ScalarType type;
  std::function<void(std::uint32_t, std::byte*)> put;  // the sample's value
};

std::uint8_t extra_type(ScalarType type) {
  constexpr std::array<std::uint8_t, 8> kTypes{2, 1, 4, 3, 6, 5, 9, 10};
  return kTypes[static_cast<std::size_t>(type)];
}

template <typename T>
void store(std::byte* to, T value) {
  std::memcpy(to, &value, sizeof(T));
}

class LasWriter {
 public:
  LasWriter(const ExportView& view, const PositionGrid& grid)
      : view_(view), cloud_(view.cloud()), grid_(grid), format_(chosen_format(view.cloud())) {
    place();
  }

  Result<std::vector<std::byte>> write() {
    if (extra_.size() > kMostDescriptors)
      return Error{.code = ErrorCode::kUnsupportedFormat,
                   .message = "LAS describes at most 341 further attributes; the cloud has " +
                              std::to_string(extra_.size()),
                   .field = {},
                   .limit = static_cast<double>(kMostDescriptors),
                   .actual = static_cast<double>(extra_.size())};
    const std::size_t extra_record =
        extra_.empty() ? 0 : kLasRecordHeadBytes + extra_.size() * kLasExtraDescriptorBytes;
    const std::size_t header = format_ >= 6 ? kLasHeader14Bytes : kHeader12;
    out_.assign(header + extra_record, std::byte{0});
    if (!extra_.empty()) write_descriptors(out_.data() + header);
    const std::size_t points = out_.size();
    out_.resize(points + view_.size() * record_bytes_);
    for (std::size_t row = 0; row < view_.size(); ++row)
      write_point(view_.sample(row), out_.data() + points + row * record_bytes_);
    write_header(header, points);
    return std::move(out_);
  }

 private:
  void place() {
    std::vector<const ScalarAttribute*> taken;
    for (const LasDimension& dimension : las_dimensions(format_)) {
      const ScalarAttribute* scalar = standard(cloud_, dimension);
      if (scalar == nullptr) continue;
      placed_.push_back({.scalar = scalar, .at = dimension});
      taken.push_back(scalar);
    }
    wide_ = wide_colors(cloud_);
    for (const ScalarAttribute* scalar : wide_) taken.push_back(scalar);
    if (cloud_.has_normals()) {
      constexpr std::array<const char*, 3> kNames{"nx", "ny", "nz"};
      const std::array<const float*, 3> from{cloud_.normal.x(), cloud_.normal.y(), cloud_.normal.z()};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float* column = from[axis];
        add_extra(kNames[axis], ScalarType::kFloat,
                  [column](std::uint32_t i, std::byte* to) { store(to, column[i]); });
      }
    }
    if (cloud_.color_has_alpha)
      add_extra("alpha", ScalarType::kUint8,
                [this](std::uint32_t i, std::byte* to) { store(to, cloud_.color[i][3]); });
    for (std::size_t c = 0; c < 2 && !cloud_.texcoord.empty(); ++c)
      add_extra(view_.texcoord_names()[c], ScalarType::kFloat,
                [this, c](std::uint32_t i, std::byte* to) { store(to, cloud_.texcoord[i][c]); });
    for (std::size_t s = 0; s < cloud_.scalars.size(); ++s) {
      const ScalarAttribute& scalar = cloud_.scalars[s];
      if (std::find(taken.begin(), taken.end(), &scalar) != taken.end()) continue;
      add_extra(view_.scalar_names()[s], type_of(scalar), [&scalar](std::uint32_t i, std::byte* to) {
        std::visit([&](const auto& values) { store(to, values[i]); }, scalar.values);
      });
    }
  }

  void add_extra(const std::string& name, ScalarType type,
                 std::function<void(std::uint32_t, std::byte*)> put) {
    // Cut at a character's start; what the cut makes equal gets a number.
    std::string unique = cut(name, kLongestName);
    for (int i = 2; has_extra(unique); ++i) {
      std::string number(1, '_');
      number.append(std::to_string(i));
      unique = cut(name, kLongestName - number.size());
      unique.append(number);
    }
    extra_.push_back({.name = std::move(unique), .type = type, .put = std::move(put)});
    record_bytes_ += size_of(type);
  }
  static std::string cut(const std::string& name, std::size_t length) {
    if (name.size() <= length) return name;
    while (length > 0 && (static_cast<unsigned char>(name[length]) & 0xC0U) == 0x80U) --length;
    return name.substr(0, length);
  }
  [[nodiscard]] bool has_extra(const std::string& name) const {
    return std::any_of(extra_.begin(), extra_.end(), [&](const ExtraColumn& e) { return e.name == name; });
  }

  void write_descriptors(std::byte* at) const {
    std::memcpy(at + 2, kLasSpecUser, std::strlen(kLasSpecUser));
    store(at + 18, kLasExtraRecord);
    store(at + 20, static_cast<std::uint16_t>(extra_.size() * kLasExtraDescriptorBytes));
    at += kLasRecordHeadBytes;
    for (const ExtraColumn& extra : extra_) {
      store(at + 2, extra_type(extra.type));
      std::memcpy(at + 4, extra.name.data(), extra.name.size());
      at += kLasExtraDescriptorBytes;
    }
  }

  void write_point(std::uint32_t i, std::byte* record) {
    const auto p = view_.position(i);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto e = static_cast<Eigen::Index>(axis);
      const double integer = integer_of(p[axis], grid_.scale[e], grid_.offset[e]);
      const double place = place_of(integer, grid_.scale[e], grid_.offset[e]);
      reached_[axis].min = std::min(reached_[axis].min, place);
      reached_[axis].max = std::max(reached_[axis].max, place);
      store(record + 4 * axis, static_cast<std::int32_t>(integer));
    }
    for (const Placed& placed : placed_) put_standard(placed, i, record);
    if (const auto at = las_color_byte(format_); at && cloud_.has_colors()) put_color(i, record + *at);
    std::byte* to = record + las_record_bytes(format_);
    for (const ExtraColumn& extra : extra_) {
      extra.put(i, to);
      to += size_of(extra.type);
    }
    count_return(record);
  }

  static void put_standard(const Placed& placed, std::uint32_t i, std::byte* record) {
    std::byte* to = record + placed.at.byte;
    if (placed.at.bits > 0) {
      const unsigned value = values_of<std::uint8_t>(*placed.scalar)[i];
      *to |= static_cast<std::byte>(value << placed.at.shift);
      return;
    }
    std::visit([&](const auto& values) { store(to, values[i]); }, placed.scalar->values);
  }

  void put_color(std::uint32_t i, std::byte* to) const {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto value = wide_[c] != nullptr
                             ? values_of<std::uint16_t>(*wide_[c])[i]
                             : static_cast<std::uint16_t>(static_cast<unsigned>(cloud_.color[i][c]) * 257U);
      store(to + 2 * c, value);
    }
  }

  void count_return(const std::byte* record) {
    const unsigned number = std::to_integer<unsigned>(record[14]) & (format_ >= 6 ? 15U : 7U);
    if (number >= 1) ++returns_[number - 1];
  }

  void write_header(std::size_t header_bytes, std::size_t points) {
    std::byte* const h = out_.data();
    const bool is_modern = format_ >= 6;
    std::memcpy(h, "LASF", 4);
    // Times are as they came; of the two kinds the bit says nothing that is known here. 16: coordinates' WKT.
    store(h + 6, static_cast<std::uint16_t>(is_modern ? 16 : 0));
    store(h + 24, std::uint8_t{1});
    store(h + 25, static_cast<std::uint8_t>(is_modern ? 4 : 2));
    std::memcpy(h + 26, "OTHER", 5);
    std::memcpy(h + 58, "Pointwright", 11);
    store(h + 94, static_cast<std::uint16_t>(header_bytes));
    store(h + 96, static_cast<std::uint32_t>(points));
    store(h + 100, static_cast<std::uint32_t>(extra_.empty() ? 0 : 1));
    store(h + 104, format_);
    store(h + 105, static_cast<std::uint16_t>(record_bytes_));
    if (!is_modern) {
      store(h + 107, static_cast<std::uint32_t>(view_.size()));
      for (std::size_t r = 0; r < 5; ++r) store(h + 111 + 4 * r, static_cast<std::uint32_t>(returns_[r]));
    } else {
      store(h + 247, static_cast<std::uint64_t>(view_.size()));
      for (std::size_t r = 0; r < 15; ++r) store(h + 255 + 8 * r, returns_[r]);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto e = static_cast<Eigen::Index>(axis);
      store(h + 131 + 8 * axis, grid_.scale[e]);
      store(h + 155 + 8 * axis, grid_.offset[e]);
      store(h + 179 + 16 * axis, reached_[axis].max);
      store(h + 187 + 16 * axis, reached_[axis].min);
    }
  }

  const ExportView& view_;
  const Cloud& cloud_;
  const PositionGrid grid_;
  const std::uint8_t format_;
  std::size_t record_bytes_ = las_record_bytes(format_);
  std::vector<Placed> placed_;
  std::array<const ScalarAttribute*, 3> wide_{};
  std::vector<ExtraColumn> extra_;
  std::array<AxisRange, 3> reached_;
  std::array<std::uint64_t, 15> returns_{};
  std::vector<std::byte> out_;
};

}  // namespace

PositionGrid las_grid(const ExportView& view, const std::optional<PositionGrid>& wanted) {
  const auto ranges = ranges_of(view);
  PositionGrid grid;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const AxisGrid chosen = grid_of_axis(view, axis, ranges[axis], wanted);
    grid.scale[static_cast<Eigen::Index>(axis)] = chosen.scale;
    grid.offset[static_cast<Eigen::Index>(axis)] = chosen.offset;
  }
  return grid;
}

Result<std::vector<std::byte>> write_las(const ExportView& view, const std::optional<PositionGrid>& grid) {
  return LasWriter(view, las_grid(view, grid)).write();
}

}  // namespace pointwright
