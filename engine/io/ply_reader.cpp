#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>

#include "engine/core/check.h"
#include "engine/io/ply.h"

namespace pointwright {
namespace {

static_assert(std::endian::native == std::endian::little, "the binary paths assume a little-endian machine");

template <typename T>
T load(const std::byte* from, bool swap) {
  std::array<std::byte, sizeof(T)> raw{};
  std::memcpy(raw.data(), from, sizeof(T));
  if (swap) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

// The columns of one element: one per scalar property, sized for all its rows.
struct Table {
  std::vector<ScalarAttribute> columns;       // in property order; lists have none
  std::vector<ScalarAttribute*> of_property;  // nullptr for a list
};

Table make_table(const PlyElement& element) {
  Table table;
  table.columns.reserve(element.properties.size());
  table.of_property.reserve(element.properties.size());
  for (const PlyProperty& property : element.properties) {
    table.of_property.push_back(nullptr);
    if (property.is_list) continue;
    table.columns.push_back({clean_name(property.name), make_values(property.type)});
    std::visit([&](auto& values) { values.resize(element.count); }, table.columns.back().values);
    table.of_property.back() = &table.columns.back();
  }
  return table;
}

// ---- binary ----

class BinaryBody {
 public:
  BinaryBody(std::span<const std::byte> bytes, std::size_t offset, bool swap)
      : bytes_(bytes), offset_(offset), swap_(swap) {}

  Result<void> read(const PlyElement& element, Table& table) {
    if (auto fits = check_length(element); !fits) return fits;
    return element.has_lists() ? read_rows(element, &table) : read_columns(element, table);
  }
  Result<void> skip(const PlyElement& element) {
    if (auto fits = check_length(element); !fits) return fits;
    if (element.has_lists()) return read_rows(element, nullptr);
    offset_ += static_cast<std::size_t>(element.count * element.least_row_bytes());
    return {};
  }
  [[nodiscard]] Result<void> check_length(const PlyElement& element) const {
    const std::uint64_t row_bytes = element.least_row_bytes();
    if (row_bytes > 0 && element.count > left() / row_bytes) return cut(element);
    return {};
  }
  // Line ends and zeros after the data are what text-minded tools leave there; more is not this header's
  // file.
  [[nodiscard]] Result<void> check_done() const {
    const auto rest = bytes_.last(left());
    const auto is_filler = [](std::byte b) {
      return b == std::byte{'\n'} || b == std::byte{'\r'} || b == std::byte{0};
    };
    if (std::all_of(rest.begin(), rest.end(), is_filler)) return {};
    return Error{.code = ErrorCode::kMalformedData,
                 .message = std::to_string(left()) + " bytes follow the last element, at byte " +
                            std::to_string(offset_) + ": the header does not describe this file",
                 .field = "header"};
  }

 private:
  [[nodiscard]] std::size_t left() const { return bytes_.size() - offset_; }
  Error cut(const PlyElement& element) const {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "the file ends at byte " + std::to_string(bytes_.size()) + ", before all " +
                            std::to_string(element.count) + " rows of element " + quoted(element.name),
                 .field = clean_name(element.name)};
  }

  Result<void> read_columns(const PlyElement& element, Table& table) {
    const std::uint64_t row_bytes = element.least_row_bytes();
    const std::byte* column_start = bytes_.data() + offset_;
    offset_ += static_cast<std::size_t>(element.count * row_bytes);
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      std::visit(
          [&](auto& values) {
            using T = typename std::decay_t<decltype(values)>::value_type;
            const std::byte* from = column_start;
            for (T& value : values) {
              value = load<T>(from, swap_);
              from += row_bytes;
            }
          },
          table.of_property[p]->values);
      column_start += size_of(element.properties[p].type);
    }
    return {};
  }

  Result<void> read_rows(const PlyElement& element, Table* table) {
    for (std::uint64_t row = 0; row < element.count; ++row) {
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        const PlyProperty& property = element.properties[p];
        const std::size_t size = size_of(property.is_list ? property.count_type : property.type);
        if (left() < size) return cut(element);
        if (property.is_list) {
          if (!skip_list(property, size)) return cut(element);
          continue;
        }
        if (table != nullptr) {
          std::visit(
              [&](auto& values) {
                using T = typename std::decay_t<decltype(values)>::value_type;
                values[row] = load<T>(bytes_.data() + offset_, swap_);
              },
              table->of_property[p]->values);
        }
        offset_ += size;
      }
    }
    return {};
  }

  bool skip_list(const PlyProperty& property, std::size_t count_size) {
    const std::int64_t length = list_length(property.count_type);
    offset_ += count_size;
    if (length < 0 || static_cast<std::uint64_t>(length) > left() / size_of(property.type)) return false;
    offset_ += static_cast<std::size_t>(length) * size_of(property.type);
    return true;
  }

  [[nodiscard]] std::int64_t list_length(ScalarType type) const {
    const std::byte* from = bytes_.data() + offset_;
    switch (type) {
      case ScalarType::kInt8:
        return load<std::int8_t>(from, swap_);
      case ScalarType::kUint8:
        return load<std::uint8_t>(from, swap_);
      case ScalarType::kInt16:
        return load<std::int16_t>(from, swap_);
      case ScalarType::kUint16:
        return load<std::uint16_t>(from, swap_);
      case ScalarType::kInt32:
        return load<std::int32_t>(from, swap_);
      case ScalarType::kUint32:
        return load<std::uint32_t>(from, swap_);
      default:
        return -1;  // the header parser lets no such type through
    }
  }

  std::span<const std::byte> bytes_;
  std::size_t offset_;
  bool swap_;
};

// ---- ascii ----

bool is_blank_in(char c, char line_end) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f' || ((c == '\r' || c == '\n') && c != line_end);
}

class AsciiBody {
 public:
  AsciiBody(std::string_view text, const PlyHeader& header)
      : at_(text.data() + header.data_offset),
        end_(text.data() + text.size()),
        line_end_(header.line_end),
        line_(header.line_count + 1) {}

  // The vertices' rows have exactly the values that the header promises.
  Result<void> read(const PlyElement& element, Table& table) {
    if (auto fits = check_length(element); !fits) return fits;
    return read_rows(element, table);
  }
  Result<void> read_rows(const PlyElement& element, Table& table) {
    for (std::uint64_t row = 0; row < element.count; ++row) {
      skip_blank_lines();
      if (at_ == end_) return too_few(element);
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        const PlyProperty& property = element.properties[p];
        const bool done = property.is_list ? skip_list() : read_value(property, *table.of_property[p], row);
        if (!done) return bad_value(element, property);
      }
      if (!at_line_end()) return extra_value(element);
    }
    return {};
  }
  // Rows of other elements are counted, not read: what some programs write there fits no header.
  Result<void> skip(const PlyElement& element) {
    if (element.properties.empty())
      return {};  // rows without a word are blank lines, which count for nothing
    if (auto fits = check_length(element); !fits) return fits;
    for (std::uint64_t row = 0; row < element.count; ++row) {
      skip_blank_lines();
      if (at_ == end_) return too_few(element);
      const void* found = std::memchr(at_, line_end_, static_cast<std::size_t>(end_ - at_));
      at_ = found == nullptr ? end_ : static_cast<const char*>(found);
    }
    return {};
  }
  // Nothing but blanks is left.
  Result<void> check_done() {
    skip_blank_lines();
    if (at_ == end_) return {};
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "line " + std::to_string(line_) + ": more rows than the header describes",
                 .field = "header"};
  }
  // A row takes a character for each value and one after each, but for the very last.
  [[nodiscard]] Result<void> check_length(const PlyElement& element) const {
    const auto least = std::max<std::uint64_t>(element.properties.size() * 2, 2);
    if (element.count > (static_cast<std::uint64_t>(end_ - at_) + 1) / least) return too_few(element);
    return {};
  }

 private:
  [[nodiscard]] bool is_blank(char c) const { return is_blank_in(c, line_end_); }
  void skip_blanks() {
    while (at_ != end_ && is_blank(*at_)) ++at_;
  }
  void skip_blank_lines() {
    for (skip_blanks(); at_ != end_ && *at_ == line_end_; skip_blanks()) {
      ++at_;
      ++line_;
    }
  }
  bool at_line_end() {
    skip_blanks();
    return at_ == end_ || *at_ == line_end_;
  }
  std::string_view next_word() {
    skip_blanks();
    const char* begin = at_;
    while (at_ != end_ && *at_ != line_end_ && !is_blank(*at_)) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  bool read_value(const PlyProperty& property, ScalarAttribute& column, std::uint64_t row) {
    word_ = next_word();
    if (word_.empty()) return false;
    switch (property.type) {
      case ScalarType::kInt8:
        return store_integer<std::int8_t>(column, row);
      case ScalarType::kUint8:
        return store_integer<std::uint8_t>(column, row);
      case ScalarType::kInt16:
        return store_integer<std::int16_t>(column, row);
      case ScalarType::kUint16:
        return store_integer<std::uint16_t>(column, row);
      case ScalarType::kInt32:
        return store_integer<std::int32_t>(column, row);
      case ScalarType::kUint32:
        return store_integer<std::uint32_t>(column, row);
      case ScalarType::kFloat:
        return parse_number(word_, std::get<std::vector<float>>(column.values)[row]);
      case ScalarType::kDouble:
        break;
    }
    return parse_number(word_, std::get<std::vector<double>>(column.values)[row]);
  }
  template <typename T>
  bool store_integer(ScalarAttribute& column, std::uint64_t row) {
    return parse_integer(word_, std::get<std::vector<T>>(column.values)[row]);
  }

  bool skip_list() {
    word_ = next_word();
    std::uint64_t length = 0;
    if (word_.empty() || !parse_integer(word_, length)) return false;
    for (std::uint64_t i = 0; i < length; ++i) {
      word_ = next_word();
      if (word_.empty()) return false;
    }
    return true;
  }

  Error malformed(const PlyElement& element, const std::string& what) const {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "line " + std::to_string(line_) + ": " + what,
                 .field = clean_name(element.name)};
  }
  Error too_few(const PlyElement& element) const {
    return malformed(element, "the file ends before all " + std::to_string(element.count) +
                                  " rows of element " + quoted(element.name));
  }
  Error bad_value(const PlyElement& element, const PlyProperty& property) const {
    if (word_.empty()) return malformed(element, "the row ends before property " + quoted(property.name));
    return malformed(element, quoted(word_) + " is no value for property " + quoted(property.name));
  }
  Error extra_value(const PlyElement& element) {
    return malformed(element, "the row goes on with " + quoted(next_word()) + " after its last property");
  }

  const char* at_;
  const char* end_;
  char line_end_;
  std::uint64_t line_;
  std::string_view word_;  // the last one taken
};

// ---- both ----

Result<void> check_counts(const PlyHeader& header, const ImportParams& params) {
  const PlyElement* vertex = header.vertex();
  if (vertex == nullptr || vertex->count == 0) {
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the file has no vertices", .field = "vertex"};
  }
  if (vertex->count > params.max_samples || vertex->count > std::numeric_limits<std::uint32_t>::max()) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the file claims " + std::to_string(vertex->count) + " samples; at most " +
                            std::to_string(params.max_samples) + " are taken",
                 .field = "vertex",
                 .limit = static_cast<double>(params.max_samples),
                 .actual = static_cast<double>(vertex->count)};
  }
  return {};
}

ImportReport start_report(const PlyHeader& header) {
  ImportReport report;
  report.format = CloudFormat::kPly;
  report.encoding = std::string(encoding_name(header.encoding));
  report.declared_count = header.vertex()->count;
  for (const PlyElement& element : header.elements) {
    const bool is_vertex = &element == header.vertex();
    if (!is_vertex && element.count > 0) {
      if (element.name == "face" || element.name == "tristrips") report.from_mesh = true;
      report.skipped.push_back("element " + clean_name(element.name));
    }
    if (!is_vertex) continue;
    for (const PlyProperty& property : element.properties) {
      if (property.is_list) report.skipped.push_back("list " + clean_name(property.name));
    }
  }
  return report;
}

// The columns of the vertices, whatever the encoding: the body knows how to read and to skip.
template <typename Body>
Result<std::vector<ScalarAttribute>> read_elements(const PlyHeader& header, Body& body) {
  Table vertices;
  for (const PlyElement& element : header.elements) {
    if (&element != header.vertex()) {
      if (auto done = body.skip(element); !done) return done.error();
      continue;
    }
    // What the rows take is held against the bytes there are before anything is allocated for them.
    if (auto fits = body.check_length(element); !fits) return fits.error();
    vertices = make_table(element);
    if (auto done = body.read(element, vertices); !done) return done.error();
  }
  if (auto done = body.check_done(); !done) return done.error();
  return std::move(vertices.columns);
}

}  // namespace

Result<ImportedCloud> read_ply(std::span<const std::byte> bytes, const ImportParams& params) {
  auto parsed = parse_ply_header(bytes);
  if (!parsed) return parsed.error();
  const PlyHeader& header = parsed.value();
  if (auto checked = check_counts(header, params); !checked) return checked.error();
  Result<std::vector<ScalarAttribute>> columns = std::vector<ScalarAttribute>{};
  if (header.encoding == PlyEncoding::kAscii) {
    AsciiBody body({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, header);
    columns = read_elements(header, body);
  } else {
    BinaryBody body(bytes, header.data_offset, header.encoding == PlyEncoding::kBinaryBigEndian);
    columns = read_elements(header, body);
  }
  if (!columns) return columns.error();
  return assemble_cloud(std::move(columns).value(), start_report(header));
}

PlyRowCount count_ply_rows(std::string_view text, char line_end) {
  PlyRowCount count;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find(line_end));
    if (!std::ranges::all_of(line, [&](char c) { return is_blank_in(c, line_end); })) ++count.rows;
    if (line.size() == text.size()) break;
    ++count.lines;
    text.remove_prefix(line.size() + 1);
  }
  return count;
}

Result<std::vector<ScalarAttribute>> read_ply_rows(std::string_view text, const PlyHeader& header,
                                                   std::uint64_t count, std::uint64_t first_line) {
  POINTWRIGHT_CHECK(header.vertex() != nullptr, "rows of a file without vertices");
  PlyElement element = *header.vertex();
  element.count = count;
  AsciiBody body(text, {.data_offset = 0, .line_count = first_line - 1, .line_end = header.line_end});
  // The rows were counted, so it is one of them that is too short. No more is allocated than the text could
  // fill, and that row is among those.
  const auto fits = body.check_length(element);
  if (!fits) element.count = std::min<std::uint64_t>(count, text.size() / 2 / element.properties.size() + 2);
  Table table = make_table(element);
  if (auto done = body.read_rows(element, table); !done) return done.error();
  if (!fits) return fits.error();
  return std::move(table.columns);
}

Result<ImportedCloud> read_ply_vertices(std::span<const std::byte> rows, const PlyHeader& header) {
  POINTWRIGHT_CHECK(header.vertex() != nullptr && !header.vertex()->has_lists(), "rows of one length");
  PlyElement element = *header.vertex();
  element.count = rows.size() / element.least_row_bytes();
  BinaryBody body(rows, 0, header.encoding == PlyEncoding::kBinaryBigEndian);
  Table table = make_table(element);
  if (auto done = body.read(element, table); !done) return done.error();
  return assemble_cloud(std::move(table.columns), start_report(header));
}

}  // namespace pointwright
