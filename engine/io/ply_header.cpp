#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "engine/io/ply.h"

namespace pointwright {
namespace {

constexpr std::size_t kLongestHeader = std::size_t{1} << 20;
constexpr std::size_t kMostElements = 256;
constexpr std::size_t kMostProperties = 1024;

Error malformed(std::uint64_t line, const std::string& what) {
  return Error{.code = ErrorCode::kMalformedData,
               .message = "line " + std::to_string(line) + " of the PLY header: " + what,
               .field = "header"};
}

std::optional<ScalarType> type_named(std::string_view word) {
  constexpr std::array<std::pair<std::string_view, ScalarType>, 16> kNames{{
      {"char", ScalarType::kInt8},
      {"int8", ScalarType::kInt8},
      {"uchar", ScalarType::kUint8},
      {"uint8", ScalarType::kUint8},
      {"short", ScalarType::kInt16},
      {"int16", ScalarType::kInt16},
      {"ushort", ScalarType::kUint16},
      {"uint16", ScalarType::kUint16},
      {"int", ScalarType::kInt32},
      {"int32", ScalarType::kInt32},
      {"uint", ScalarType::kUint32},
      {"uint32", ScalarType::kUint32},
      {"float", ScalarType::kFloat},
      {"float32", ScalarType::kFloat},
      {"double", ScalarType::kDouble},
      {"float64", ScalarType::kDouble},
  }};
  for (const auto& [name, type] : kNames) {
    if (name == word) return type;
  }
  return std::nullopt;
}

class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : text_(text) {
    // A file of lines that end in '\r' alone has no '\n' right after the first of them.
    const std::size_t end = text_.find_first_of("\r\n");
    const bool lone_cr = end != std::string_view::npos && text_[end] == '\r' &&
                         (end + 1 == text_.size() || text_[end + 1] != '\n');
    header_.line_end = lone_cr ? '\r' : '\n';
  }

  Result<PlyHeader> parse() {
    std::string_view line;
    if (!next_line(line) || take_word(line) != "ply") return malformed(1, "a PLY file starts with 'ply'");
    while (next_line(line)) {
      const std::string_view word = take_word(line);
      if (word == "end_header") return finish();
      if (word.empty() || word == "comment" || word == "obj_info") continue;
      Result<void> done;
      if (word == "format") {
        done = parse_format(line);
      } else if (word == "element") {
        done = parse_element(line);
      } else if (word == "property") {
        done = parse_property(line);
      } else {
        done = malformed(header_.line_count, "unknown word " + quoted(word));
      }
      if (!done) return done.error();
    }
    return malformed(header_.line_count, "the header does not end");
  }

 private:
  bool next_line(std::string_view& line) {
    const std::size_t end = text_.find(header_.line_end, header_.data_offset);
    if (end == std::string_view::npos) return false;
    line = text_.substr(header_.data_offset, end - header_.data_offset);
    header_.data_offset = end + 1;
    ++header_.line_count;
    return true;
  }

  Result<void> parse_format(std::string_view line) {
    const std::string_view encoding = take_word(line);
    const std::string_view version = take_word(line);
    if (version != "1.0") {
      return Error{.code = ErrorCode::kUnsupportedFormat,
                   .message = "PLY version " + quoted(version) + " is not known; 1.0 is",
                   .field = "header"};
    }
    for (const auto candidate :
         {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian}) {
      if (encoding != encoding_name(candidate)) continue;
      header_.encoding = candidate;
      has_format_ = true;
      return {};
    }
    return Error{.code = ErrorCode::kUnsupportedFormat,
                 .message = "PLY encoding " + quoted(encoding) + " is not known",
                 .field = "header"};
  }

  Result<void> parse_element(std::string_view line) {
    PlyElement element;
    element.name = std::string(take_word(line));
    const std::string_view count = take_word(line);
    if (element.name.empty() || !parse_integer(count, element.count)) {
      return malformed(header_.line_count, "an element needs a name and a count, not " + quoted(count));
    }
    if (header_.elements.size() == kMostElements)
      return malformed(header_.line_count, "more than 256 elements");
    element.count_at = static_cast<std::size_t>(count.data() - text_.data());
    element.count_length = count.size();
    header_.elements.push_back(std::move(element));
    return {};
  }

  Result<void> parse_property(std::string_view line) {
    if (header_.elements.empty()) return malformed(header_.line_count, "a property before any element");
    PlyProperty property;
    std::string_view type = take_word(line);
    if (type == "list") {
      property.is_list = true;
      const auto count_type = type_named(take_word(line));
      if (!count_type || *count_type == ScalarType::kFloat || *count_type == ScalarType::kDouble) {
        return malformed(header_.line_count, "a list's length needs an integer type");
      }
      property.count_type = *count_type;
      type = take_word(line);
    }
    const auto known = type_named(type);
    if (!known) return malformed(header_.line_count, "unknown type " + quoted(type));
    property.type = *known;
    property.name = std::string(take_word(line));
    if (property.name.empty()) return malformed(header_.line_count, "a property without a name");
    auto& properties = header_.elements.back().properties;
    if (properties.size() == kMostProperties)
      return malformed(header_.line_count, "more than 1024 properties");
    properties.push_back(std::move(property));
    return {};
  }

  Result<PlyHeader> finish() {
    if (!has_format_) return malformed(header_.line_count, "no line 'format'");
    return std::move(header_);
  }

  std::string_view text_;
  PlyHeader header_;
  bool has_format_ = false;
};

}  // namespace

std::string_view encoding_name(PlyEncoding encoding) {
  switch (encoding) {
    case PlyEncoding::kAscii:
      return "ascii";
    case PlyEncoding::kBinaryLittleEndian:
      return "binary_little_endian";
    case PlyEncoding::kBinaryBigEndian:
      break;
  }
  return "binary_big_endian";
}

bool PlyElement::has_lists() const {
  return std::any_of(properties.begin(), properties.end(), [](const PlyProperty& p) { return p.is_list; });
}

std::uint64_t PlyElement::least_row_bytes() const {
  std::uint64_t bytes = 0;
  for (const PlyProperty& property : properties)
    bytes += size_of(property.is_list ? property.count_type : property.type);
  return bytes;
}

const PlyElement* PlyHeader::vertex() const {
  const auto found =
      std::find_if(elements.begin(), elements.end(), [](const PlyElement& e) { return e.name == "vertex"; });
  return found == elements.end() ? nullptr : &*found;
}

Result<PlyHeader> parse_ply_header(std::span<const std::byte> bytes) {
  const std::size_t length = std::min(bytes.size(), kLongestHeader);
  return HeaderParser({reinterpret_cast<const char*>(bytes.data()), length}).parse();
}

}  // namespace pointwright
