#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <set>

#include "engine/io/las.h"
#include "engine/io/load.h"

namespace pointwright {
namespace {

class PointReader {
 public:
  PointReader(std::span<const std::byte> bytes, const LasHeader& header)
      : first_(bytes.data() + header.point_offset), header_(header) {}

  std::vector<ScalarAttribute> read() {
    constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const double scale = header_.grid.scale[axis];
      const double offset = header_.grid.offset[axis];
      add(kAxes[axis], column<std::int32_t, double>(4 * axis, [=](std::int32_t v) {
            return static_cast<double>(v) * scale + offset;
          }));
    }
    add_colors();
    for (const LasDimension& dimension : las_dimensions(header_.point_format)) add_standard(dimension);
    std::uint32_t at = las_record_bytes(header_.point_format);
    for (const LasExtraDimension& extra : header_.extra) {
      if (extra.data_type != 0) add_extra(extra, at);
      at += extra.bytes;
    }
    return std::move(columns_);
  }

 private:
  template <typename From, typename To, typename Convert>
  std::vector<To> column(std::uint32_t at, const Convert& convert) const {
    std::vector<To> values(static_cast<std::size_t>(header_.point_count));
    const std::byte* from = first_ + at;
    for (To& value : values) {
      value = convert(load<From>(from));
      from += header_.record_bytes;
    }
    return values;
  }
  template <typename T>
  std::vector<T> plain(std::uint32_t at) const {
    return column<T, T>(at, [](T v) { return v; });
  }

  // A name that nothing has yet: files with two of one name are legal, and clouds with them are not.
  void add(const std::string& name, ScalarAttribute::Values values) {
    std::string free = name;
    for (int i = 2; !names_.insert(free).second; ++i) free = name + "_" + std::to_string(i);
    columns_.push_back({std::move(free), std::move(values)});
  }

  // Every record has all of them; those that are zero throughout say nothing.
  template <typename T>
  void add_unless_zero(const char* name, std::vector<T> values) {
    // By its bits: -0 is not what nobody wrote.
    using Bits = std::array<std::byte, sizeof(T)>;
    const bool says_something =
        std::any_of(values.begin(), values.end(), [](T v) { return std::bit_cast<Bits>(v) != Bits{}; });
    if (says_something) add(name, std::move(values));
  }

  void add_standard(const LasDimension& dimension) {
    if (dimension.bits > 0) {
      const unsigned mask = (1U << dimension.bits) - 1U;
      add_unless_zero(
          dimension.name, column<std::uint8_t, std::uint8_t>(dimension.byte, [&](std::uint8_t v) {
            return static_cast<std::uint8_t>((static_cast<unsigned>(v) >> dimension.shift) & mask);
          }));
      return;
    }
    auto values = make_values(dimension.type);
    std::visit(
        [&](const auto& like) {
          using T = typename std::decay_t<decltype(like)>::value_type;
          add_unless_zero(dimension.name, plain<T>(dimension.byte));
        },
        values);
  }

  // Colours are 16 bits wide; a file that came from 8-bit ones has them times 257, or times 256, or (against
  // the letter) as they were. The 16 bits stay beside where 8 bits times 257 would not give them back.
  void add_colors() {
    const auto at = las_color_byte(header_.point_format);
    if (!at) return;
    std::array<std::vector<std::uint16_t>, 3> wide;
    std::uint16_t greatest = 0;
    bool is_repeated = true;
    for (std::uint32_t c = 0; c < 3; ++c) {
      wide[c] = plain<std::uint16_t>(*at + 2 * c);
      for (const std::uint16_t v : wide[c]) {
        greatest = std::max(greatest, v);
        is_repeated = is_repeated && v % 257 == 0;
      }
    }
    if (greatest == 0) return;
    const unsigned shift = greatest > 255 ? 8 : 0;
    constexpr std::array<const char*, 3> kNames{"red", "green", "blue"};
    for (std::size_t c = 0; c < 3; ++c) {
      std::vector<std::uint8_t> narrow(wide[c].size());
      std::transform(wide[c].begin(), wide[c].end(), narrow.begin(), [&](std::uint16_t v) {
        return static_cast<std::uint8_t>(static_cast<unsigned>(v) >> shift);
      });
      add(kNames[c], std::move(narrow));
    }
    for (std::size_t c = 0; c < 3 && !is_repeated; ++c)
      add(std::string(kNames[c]) + "_16", std::move(wide[c]));
  }

  template <typename T>
  void add_extra_as(const LasExtraDimension& extra, std::uint32_t at) {
    for (std::uint32_t c = 0; c < extra.components; ++c) {
      std::string name = extra.name;
      if (extra.components > 1) name.append("_").append(std::to_string(c));
      const std::uint32_t place = at + c * static_cast<std::uint32_t>(sizeof(T));
      const double scale = extra.scale[c];
      const double offset = extra.offset[c];
      if (extra.is_scaled || sizeof(T) == 8) {
        add(name, column<T, double>(place, [&](T v) {
              const auto value = static_cast<double>(v);
              return extra.is_scaled ? value * scale + offset : value;
            }));
      } else if constexpr (sizeof(T) < 8) {
        add(name, plain<T>(place));
      }
    }
  }
  void add_extra(const LasExtraDimension& extra, std::uint32_t at) {
    switch (extra.data_type) {
      case 1:
        return add_extra_as<std::uint8_t>(extra, at);
      case 2:
        return add_extra_as<std::int8_t>(extra, at);
      case 3:
        return add_extra_as<std::uint16_t>(extra, at);
      case 4:
        return add_extra_as<std::int16_t>(extra, at);
      case 5:
        return add_extra_as<std::uint32_t>(extra, at);
      case 6:
        return add_extra_as<std::int32_t>(extra, at);
      case 7:
        return add_extra_as<std::uint64_t>(extra, at);
      case 8:
        return add_extra_as<std::int64_t>(extra, at);
      case 9:
        return add_extra_as<float>(extra, at);
      default:
        return add_extra_as<double>(extra, at);
    }
  }

  const std::byte* first_;
  const LasHeader& header_;
  std::set<std::string> names_;
  std::vector<ScalarAttribute> columns_;
};

ImportReport start_report(const LasHeader& header) {
  ImportReport report;
  report.format = CloudFormat::kLas;
  report.encoding = "1." + std::to_string(header.minor_version);
  report.encoding.append(", point format ").append(std::to_string(header.point_format));
  report.declared_count = header.point_count;
  report.grid = header.grid;
  const std::uint8_t format = header.point_format;
  if (format == 4 || format == 5 || format == 9 || format == 10) report.skipped.emplace_back("waveforms");
  for (const LasExtraDimension& extra : header.extra) {
    if (extra.data_type == 0) report.skipped.push_back("bytes without a type: " + extra.name);
    if (extra.data_type == 7 || extra.data_type == 8)
      report.skipped.push_back("bits beyond the 53rd of " + extra.name);
  }
  return report;
}

}  // namespace

Result<ImportedCloud> read_las(std::span<const std::byte> bytes, const ImportParams& params) {
  const auto header = parse_las_header(bytes, params.max_samples);
  if (!header) return header.error();
  return assemble_cloud(PointReader(bytes, header.value()).read(), start_report(header.value()));
}

}  // namespace pointwright
