// https://pointclouds.org/documentation/tutorials/pcd_file_format.html
#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <optional>

#include "engine/io/columns.h"
#include "engine/io/load.h"
#include "engine/io/lzf.h"
#include "engine/io/pcd.h"
#include "engine/io/text.h"

namespace pointwright {
namespace {

static_assert(std::endian::native == std::endian::little, "the binary paths assume a little-endian machine");

constexpr std::size_t kLongestHeader = 65536;
constexpr std::size_t kMostFields = 256;
constexpr std::uint64_t kMostValues = 1024;

Error malformed(std::string message) {
  return Error{.code = ErrorCode::kMalformedData, .message = std::move(message), .field = "header"};
}

class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : lines_(text) {}

  Result<PcdHeader> parse() {
    TextLine line;
    while (lines_.next(line)) {
      header_.line_count = line.number;
      std::string_view rest = line.text;
      const std::string_view word = take_word(rest);
      if (word.empty() || word.front() == '#') continue;
      if (word == "DATA") return finish(rest);
      if (auto done = take(word, rest); !done) return done.error();
    }
    return fault("the header does not end with DATA");
  }

 private:
  Error fault(const std::string& what) const {
    std::string message = "line " + std::to_string(header_.line_count);
    message.append(" of the PCD header: ").append(what);
    return malformed(std::move(message));
  }

  Result<void> take(std::string_view word, std::string_view rest) {
    if (word == "VERSION") return take_version(take_word(rest));
    if (word == "FIELDS" || word == "COLUMNS") return take_list(rest, names_);
    if (word == "SIZE") return take_list(rest, sizes_);
    if (word == "TYPE") return take_list(rest, types_);
    if (word == "COUNT") return take_list(rest, counts_);
    if (word == "WIDTH") return take_number(rest, width_);
    if (word == "HEIGHT") return take_number(rest, height_);
    if (word == "POINTS") return take_number(rest, points_);
    if (word == "VIEWPOINT") return take_viewpoint(rest);
    return fault("unknown word " + quoted(word));
  }

  Result<void> take_version(std::string_view version) const {
    for (const std::string_view known : {".5", "0.5", ".6", "0.6", ".7", "0.7"}) {
      if (version == known) return {};
    }
    return Error{.code = ErrorCode::kUnsupportedFormat,
                 .message = "PCD version " + quoted(version) + " is not known; .7 is",
                 .field = "header"};
  }
  Result<void> take_list(std::string_view rest, std::vector<std::string_view>& list) {
    list.clear();
    for (auto word = take_word(rest); !word.empty(); word = take_word(rest)) {
      if (list.size() == kMostFields) return fault("more than 256 fields");
      list.push_back(word);
    }
    return {};
  }
  Result<void> take_number(std::string_view rest, std::optional<std::uint64_t>& number) {
    const std::string_view word = take_word(rest);
    if (!parse_integer(word, number.emplace())) return fault(quoted(word) + " is no count");
    return {};
  }
  Result<void> take_viewpoint(std::string_view rest) {
    constexpr std::array<double, 7> kNone{0, 0, 0, 1, 0, 0, 0};
    for (const double expected : kNone) {
      double value = 0.0;
      const std::string_view word = take_word(rest);
      if (!parse_number(word, value)) return fault(quoted(word) + " is no number");
      header_.has_viewpoint = header_.has_viewpoint || value != expected;
    }
    return {};
  }

  Result<void> take_fields() {
    if (names_.empty()) return fault("no FIELDS");
    if (sizes_.size() != names_.size() || types_.size() != names_.size() ||
        (!counts_.empty() && counts_.size() != names_.size())) {
      return fault("FIELDS, SIZE, TYPE and COUNT differ in length");
    }
    for (std::size_t f = 0; f < names_.size(); ++f) {
      PcdField field{.name = std::string(names_[f])};
      const bool is_real = types_[f] == "F";
      const bool is_known = is_real || types_[f] == "I" || types_[f] == "U";
      if (!is_known || !parse_integer(sizes_[f], field.size) ||
          (!counts_.empty() && !parse_integer(counts_[f], field.count))) {
        return fault("the size, type or count of field " + quoted(names_[f]) + " is none");
      }
      field.type = types_[f].front();
      const bool fits =
          field.size == 4 || field.size == 8 || (!is_real && (field.size == 1 || field.size == 2));
      if (!fits) return fault("field " + quoted(names_[f]) + " has a size that its type cannot have");
      header_.fields.push_back(std::move(field));
      if (header_.values_per_row() > kMostValues) return fault("more than 1024 values a point");
    }
    return {};
  }

  Result<PcdHeader> finish(std::string_view rest) {
    const std::string_view encoding = take_word(rest);
    if (encoding == "ascii") {
      header_.encoding = PcdEncoding::kAscii;
    } else if (encoding == "binary") {
      header_.encoding = PcdEncoding::kBinary;
    } else if (encoding == "binary_compressed") {
      header_.encoding = PcdEncoding::kCompressed;
    } else {
      return Error{.code = ErrorCode::kUnsupportedFormat,
                   .message = "PCD encoding " + quoted(encoding) + " is not known",
                   .field = "header"};
    }
    if (auto done = take_fields(); !done) return done.error();
    if (!width_ && !points_) return fault("neither WIDTH nor POINTS");
    header_.height = height_.value_or(1);
    header_.width = width_ ? *width_ : *points_;
    if (header_.height > 0 && header_.width > std::numeric_limits<std::uint64_t>::max() / header_.height)
      return fault("WIDTH times HEIGHT is beyond any file");
    header_.points = header_.width * header_.height;
    if (points_ && *points_ != header_.points) return fault("POINTS is not WIDTH times HEIGHT");
    header_.data_offset = lines_.offset();
    return std::move(header_);
  }

  LineReader lines_;
  PcdHeader header_;
  std::vector<std::string_view> names_, sizes_, types_, counts_;
  std::optional<std::uint64_t> width_, height_, points_;
};

// What the file claims against the bytes that it has: nothing is allocated before.
Result<void> check_length(const PcdHeader& header, std::span<const std::byte> bytes) {
  const std::uint64_t left = bytes.size() - std::min(bytes.size(), header.data_offset);
  std::uint64_t most = 0;
  switch (header.encoding) {
    case PcdEncoding::kAscii:
      most = (left + 1) / std::max<std::uint64_t>(2 * header.values_per_row(), 1);
      break;
    case PcdEncoding::kBinary:
      most = left / std::max<std::uint64_t>(header.row_bytes(), 1);
      break;
    case PcdEncoding::kCompressed:
      most = left * kMostLzfRatio / std::max<std::uint64_t>(header.row_bytes(), 1);
      break;
  }
  if (header.points <= most) return {};
  return malformed("the file claims " + std::to_string(header.points) + " points, but its " +
                   std::to_string(bytes.size()) + " bytes hold " + std::to_string(most) + " at most");
}

// Where a value stands: in point order, or (compressed) all of one field after the other.
struct Layout {
  const std::byte* first = nullptr;
  std::size_t stride = 0;
};

template <typename To, typename From>
ScalarAttribute::Values loaded(const Layout& at, std::uint64_t count) {
  std::vector<To> values(count);
  const std::byte* from = at.first;
  for (To& value : values) {
    value = static_cast<To>(load<From>(from));
    from += at.stride;
  }
  return values;
}

ScalarAttribute::Values load_column(const PcdField& field, const Layout& at, std::uint64_t count) {
  if (field.type == 'F')
    return field.size == 4 ? loaded<float, float>(at, count) : loaded<double, double>(at, count);
  const bool is_signed = field.type == 'I';
  switch (field.size) {
    case 1:
      return is_signed ? loaded<std::int8_t, std::int8_t>(at, count)
                       : loaded<std::uint8_t, std::uint8_t>(at, count);
    case 2:
      return is_signed ? loaded<std::int16_t, std::int16_t>(at, count)
                       : loaded<std::uint16_t, std::uint16_t>(at, count);
    case 4:
      return is_signed ? loaded<std::int32_t, std::int32_t>(at, count)
                       : loaded<std::uint32_t, std::uint32_t>(at, count);
    default:
      return is_signed ? loaded<double, std::int64_t>(at, count) : loaded<double, std::uint64_t>(at, count);
  }
}

ScalarType text_type(const PcdField& field) {
  if (field.type == 'F') return field.size == 4 ? ScalarType::kFloat : ScalarType::kDouble;
  const bool is_signed = field.type == 'I';
  switch (field.size) {
    case 1:
      return is_signed ? ScalarType::kInt8 : ScalarType::kUint8;
    case 2:
      return is_signed ? ScalarType::kInt16 : ScalarType::kUint16;
    case 4:
      return is_signed ? ScalarType::kInt32 : ScalarType::kUint32;
    default:
      return ScalarType::kDouble;
  }
}

std::string column_name(const PcdField& field, std::uint32_t component) {
  constexpr std::array<std::array<const char*, 2>, 3> kNormals{
      {{"normal_x", "nx"}, {"normal_y", "ny"}, {"normal_z", "nz"}}};
  for (const auto& [theirs, ours] : kNormals) {
    if (field.name == theirs && field.count == 1) return ours;
  }
  std::string name = clean_name(field.name);
  if (field.count > 1) name.append("_").append(std::to_string(component));
  return name;
}

std::vector<ScalarAttribute> read_binary(const PcdHeader& header, std::span<const std::byte> data) {
  std::vector<ScalarAttribute> columns;
  const bool by_field = header.encoding == PcdEncoding::kCompressed;
  const auto row_bytes = static_cast<std::size_t>(header.row_bytes());
  std::size_t offset = 0;
  for (const PcdField& field : header.fields) {
    const std::size_t field_bytes = std::size_t{field.size} * field.count;
    for (std::uint32_t c = 0; c < field.count && field.name != "_"; ++c) {
      Layout at{.first = data.data() + offset + std::size_t{c} * field.size, .stride = row_bytes};
      if (by_field) {
        at.first =
            data.data() + offset * static_cast<std::size_t>(header.points) + std::size_t{c} * field.size;
        at.stride = field_bytes;
      }
      columns.push_back({column_name(field, c), load_column(field, at, header.points)});
    }
    offset += field_bytes;
  }
  return columns;
}

class AsciiBody {
 public:
  AsciiBody(const PcdHeader& header, std::string_view text) : header_(header), lines_(text) {}

  Result<std::vector<ScalarAttribute>> read() {
    for (const PcdField& field : header_.fields) {
      for (std::uint32_t c = 0; c < field.count && field.name != "_"; ++c) {
        columns_.push_back({column_name(field, c), make_values(text_type(field))});
        std::visit([&](auto& values) { values.resize(header_.points); }, columns_.back().values);
      }
    }
    TextLine line;
    std::uint64_t row = 0;
    while (lines_.next(line)) {
      std::string_view rest = line.text;
      std::string_view word = take_word(rest);
      if (word.empty() || word.front() == '#') continue;
      if (row == header_.points) return fault(line, "more points than the header says");
      if (auto done = read_row(line, word, rest, row); !done) return done.error();
      ++row;
    }
    if (row < header_.points)
      return fault(line, "the file ends before all " + std::to_string(header_.points) + " points");
    return std::move(columns_);
  }

 private:
  Error fault(const TextLine& line, const std::string& what) const {
    std::string message = "line " + std::to_string(header_.line_count + line.number);
    message.append(": ").append(what);
    return malformed(std::move(message));
  }

  Result<void> read_row(const TextLine& line, std::string_view word, std::string_view rest,
                        std::uint64_t row) {
    std::size_t column = 0;
    for (const PcdField& field : header_.fields) {
      for (std::uint32_t c = 0; c < field.count; ++c, word = take_word(rest)) {
        if (word.empty()) return fault(line, "the row ends before field " + quoted(field.name));
        if (field.name == "_") continue;
        if (!store(word, columns_[column++].values, row))
          return fault(line, quoted(word) + " is no value for field " + quoted(field.name));
      }
    }
    if (!word.empty()) return fault(line, "the row goes on with " + quoted(word) + " after its last field");
    return {};
  }

  static bool store(std::string_view word, ScalarAttribute::Values& values, std::uint64_t row) {
    return std::visit(
        [&](auto& column) {
          using T = typename std::decay_t<decltype(column)>::value_type;
          if constexpr (std::is_floating_point_v<T>) {
            return parse_number(word, column[row]);
          } else {
            return parse_integer(word, column[row]);
          }
        },
        values);
  }

  const PcdHeader& header_;
  LineReader lines_;
  std::vector<ScalarAttribute> columns_;
};

// The library's packed colours: one 4-byte value, blue in the lowest byte, often declared as a float.
void unpack_colors(std::vector<ScalarAttribute>& columns) {
  const auto is_taken = [&](std::string_view name) {
    return std::any_of(columns.begin(), columns.end(), [&](const auto& c) { return c.name == name; });
  };
  if (is_taken("red") || is_taken("green") || is_taken("blue")) return;
  const auto packed = std::find_if(columns.begin(), columns.end(), [](const ScalarAttribute& c) {
    return (c.name == "rgb" || c.name == "rgba") && size_of(type_of(c)) == 4;
  });
  if (packed == columns.end()) return;
  const bool has_alpha = packed->name == "rgba" && !is_taken("alpha");
  const std::size_t count = packed->size();
  std::array<std::vector<std::uint8_t>, 4> channels;
  for (std::size_t c = 0; c < (has_alpha ? 4U : 3U); ++c) channels[c].resize(count);
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (sizeof(T) == 4) {
          for (std::size_t i = 0; i < count; ++i) {
            const auto bits = std::bit_cast<std::uint32_t>(values[i]);
            for (std::uint32_t c = 0; c < 3; ++c)
              channels[c][i] = static_cast<std::uint8_t>(bits >> (16U - 8U * c));
            if (has_alpha) channels[3][i] = static_cast<std::uint8_t>(bits >> 24U);
          }
        }
      },
      packed->values);
  columns.erase(packed);
  constexpr std::array<const char*, 4> kNames{"red", "green", "blue", "alpha"};
  for (std::size_t c = 0; c < (has_alpha ? 4U : 3U); ++c)
    columns.push_back({kNames[c], std::move(channels[c])});
}

Result<std::vector<std::byte>> expanded(const PcdHeader& header, std::span<const std::byte> data) {
  constexpr std::size_t kSizes = 8;
  if (data.size() < kSizes) return malformed("the file ends before its compressed data");
  const std::uint64_t compressed = load<std::uint32_t>(data.data());
  const std::uint64_t declared = load<std::uint32_t>(data.data() + 4);
  const std::uint64_t expected = header.points * header.row_bytes();
  if (declared != expected)
    return malformed("the compressed data holds " + std::to_string(declared) +
                     " bytes where the header needs " + std::to_string(expected));
  if (compressed > data.size() - kSizes)
    return malformed("the file ends before all " + std::to_string(compressed) + " compressed bytes");
  if (declared > compressed * kMostLzfRatio)
    return malformed("no " + std::to_string(compressed) + " compressed bytes expand to " +
                     std::to_string(declared));
  std::vector<std::byte> bytes(static_cast<std::size_t>(declared));
  if (auto done = expand_lzf(data.subspan(kSizes, static_cast<std::size_t>(compressed)), bytes); !done)
    return done.error();
  return bytes;
}

Result<std::vector<ScalarAttribute>> read_columns(const PcdHeader& header, std::span<const std::byte> bytes) {
  const auto data = bytes.subspan(header.data_offset);
  switch (header.encoding) {
    case PcdEncoding::kAscii:
      return AsciiBody(header, {reinterpret_cast<const char*>(data.data()), data.size()}).read();
    case PcdEncoding::kBinary:
      return read_binary(header, data);
    case PcdEncoding::kCompressed:
      break;
  }
  const auto whole = expanded(header, data);
  if (!whole) return whole.error();
  return read_binary(header, whole.value());
}

ImportReport start_report(const PcdHeader& header) {
  constexpr std::array<const char*, 3> kNames{"ascii", "binary", "binary_compressed"};
  ImportReport report;
  report.format = CloudFormat::kPcd;
  report.encoding = kNames[static_cast<std::size_t>(header.encoding)];
  if (header.height > 1)
    report.encoding.append(", organised ")
        .append(std::to_string(header.width))
        .append(" x ")
        .append(std::to_string(header.height));
  report.declared_count = header.points;
  if (header.has_viewpoint) report.skipped.emplace_back("viewpoint");
  for (const PcdField& field : header.fields) {
    if (field.size == 8 && field.type != 'F' && field.name != "_")
      report.skipped.push_back("bits beyond the 53rd of " + clean_name(field.name));
  }
  return report;
}

}  // namespace

std::uint64_t PcdHeader::row_bytes() const {
  std::uint64_t bytes = 0;
  for (const PcdField& field : fields) bytes += std::uint64_t{field.size} * field.count;
  return bytes;
}

std::uint64_t PcdHeader::values_per_row() const {
  std::uint64_t values = 0;
  for (const PcdField& field : fields) values += field.count;
  return values;
}

bool looks_like_pcd(std::span<const std::byte> bytes) {
  const std::string_view text = text_of(bytes);
  for (const std::string_view start : {"# .PCD", "VERSION .", "VERSION 0.", "FIELDS x", "COLUMNS x"}) {
    if (text.starts_with(start)) return true;
  }
  return false;
}

Result<PcdHeader> parse_pcd_header(std::span<const std::byte> bytes, std::uint64_t max_samples) {
  const std::size_t length = std::min(bytes.size(), kLongestHeader);
  auto parsed = HeaderParser({reinterpret_cast<const char*>(bytes.data()), length}).parse();
  if (!parsed) return parsed;
  PcdHeader& header = parsed.value();
  // The last line's end may be the last byte.
  header.data_offset = std::min(header.data_offset, bytes.size());
  if (header.points == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the file has no points", .field = "POINTS"};
  if (header.points > max_samples || header.points > std::numeric_limits<std::uint32_t>::max()) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the file claims " + std::to_string(header.points) + " samples; at most " +
                            std::to_string(max_samples) + " are taken",
                 .field = "POINTS",
                 .limit = static_cast<double>(max_samples),
                 .actual = static_cast<double>(header.points)};
  }
  if (auto fits = check_length(header, bytes); !fits) return fits.error();
  return parsed;
}

Result<ImportedCloud> read_pcd(std::span<const std::byte> bytes, const ImportParams& params) {
  const auto parsed = parse_pcd_header(bytes, params.max_samples);
  if (!parsed) return parsed.error();
  auto columns = read_columns(parsed.value(), bytes);
  if (!columns) return columns.error();
  unpack_colors(columns.value());
  return assemble_cloud(std::move(columns).value(), start_report(parsed.value()));
}

}  // namespace pointwright
