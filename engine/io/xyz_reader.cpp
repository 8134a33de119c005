#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "engine/io/xyz.h"

namespace pointwright {
namespace {

constexpr std::size_t kMostColumns = 256;
constexpr double kUnitTolerance = 5e-3;  // of a normal's length, in text that may have three digits

bool is_separator(char c) {
  return c == ' ' || c == '\t' || c == ',' || c == ';' || c == '\v' || c == '\f';
}

// Length of the comment marker at the start of the text; 0 without one.
std::size_t comment_marker(std::string_view text) {
  if (text.starts_with("//")) return 2;
  return !text.empty() && std::string_view("#%!").find(text[0]) != std::string_view::npos ? 1 : 0;
}

std::string_view take_field(std::string_view& line) {
  while (!line.empty() && is_separator(line.front())) line.remove_prefix(1);
  std::size_t end = 0;
  while (end < line.size() && !is_separator(line[end])) ++end;
  const std::string_view field = line.substr(0, end);
  line.remove_prefix(end);
  return field;
}

void split_fields(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  for (auto field = take_field(line); !field.empty() && comment_marker(field) == 0;
       field = take_field(line)) {
    fields.push_back(field);
    if (fields.size() > kMostColumns) return;
  }
}

bool is_number(std::string_view field) {
  double ignored = 0.0;
  return parse_number(field, ignored);
}

bool names_coordinates(const std::vector<std::string_view>& fields) {
  const auto has = [&](std::string_view name) {
    return std::any_of(fields.begin(), fields.end(), [&](auto field) { return lower_case(field) == name; });
  };
  return has("x") && has("y") && has("z");
}

class XyzReader {
 public:
  XyzReader(std::span<const std::byte> bytes, const ImportParams& params)
      : text_(text_of(bytes)), lines_(text_), params_(params) {}

  Result<ImportedCloud> read() {
    TextLine line;
    while (lines_.next(line)) {
      if (auto done = take_line(line); !done) return done.error();
    }
    const std::size_t rows = columns_.empty() ? 0 : columns_[0].size();
    if (rows == 0)
      return Error{.code = ErrorCode::kEmptyCloud, .message = "there is no line of numbers", .field = {}};
    if (declared_ && *declared_ != rows) {
      return malformed(line.number, "the first line says " + std::to_string(*declared_) +
                                        " samples, but there are " + std::to_string(rows));
    }
    ImportReport report;
    report.format = CloudFormat::kXyz;
    report.encoding = "text";
    report.declared_count = declared_.value_or(rows);
    return assemble_cloud(typed_columns(), std::move(report));
  }

 private:
  static Error malformed(std::uint64_t line, const std::string& what) {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "line " + std::to_string(line) + ": " + what,
                 .field = {}};
  }

  Result<void> take_line(const TextLine& line) {
    std::string_view start = line.text;
    while (!start.empty() && is_separator(start.front())) start.remove_prefix(1);
    if (const std::size_t marker = comment_marker(start); marker > 0) {
      split_fields(start.substr(marker), fields_);
      if (columns_.empty() && names_coordinates(fields_)) names_.assign(fields_.begin(), fields_.end());
      return {};
    }
    split_fields(start, fields_);
    if (fields_.empty()) return {};
    if (fields_.size() > kMostColumns) return malformed(line.number, "more than 256 columns");
    if (columns_.empty()) {
      if (const auto taken = take_heading(line); !taken.ok() || taken.value()) {
        return taken.ok() ? Result<void>() : Result<void>(taken.error());
      }
    }
    return take_row(line);
  }

  // The lines before the first row: a count, then names. True where the line was one of them.
  Result<bool> take_heading(const TextLine& line) {
    std::uint64_t count = 0;
    if (fields_.size() == 1 && !declared_ && !has_names_line_ && parse_integer(fields_[0], count)) {
      // A row takes six characters at least, the last one five.
      if (count > params_.max_samples) return too_large(count);
      if (count > (text_.size() + 1) / 6) {
        return malformed(line.number, "the file claims " + std::to_string(count) + " samples in " +
                                          std::to_string(text_.size()) + " bytes");
      }
      declared_ = count;
      return true;
    }
    const bool any_number = std::any_of(fields_.begin(), fields_.end(), is_number);
    if (!any_number && fields_.size() >= 3 && !has_names_line_) {
      has_names_line_ = true;
      names_.assign(fields_.begin(), fields_.end());
      return true;
    }
    return false;
  }

  Result<void> take_row(const TextLine& line) {
    if (columns_.empty()) {
      if (fields_.size() < 3)
        return malformed(line.number, "a sample needs three numbers: " + quoted(line.text));
      columns_.resize(fields_.size());
    }
    if (fields_.size() != columns_.size()) {
      return malformed(line.number, "the line has " + std::to_string(fields_.size()) +
                                        " columns where the first had " + std::to_string(columns_.size()));
    }
    if (columns_[0].size() == params_.max_samples) return too_large(columns_[0].size() + 1);
    for (std::size_t c = 0; c < fields_.size(); ++c) {
      double value = 0.0;
      if (!parse_number(fields_[c], value))
        return malformed(line.number, quoted(fields_[c]) + " is no number");
      columns_[c].push_back(value);
    }
    return {};
  }

  Error too_large(std::uint64_t count) const {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the file has " + std::to_string(count) + " samples or more; at most " +
                            std::to_string(params_.max_samples) + " are taken",
                 .field = {},
                 .limit = static_cast<double>(params_.max_samples),
                 .actual = static_cast<double>(count)};
  }

  [[nodiscard]] bool are_bytes(std::size_t first) const {
    for (std::size_t c = first; c < first + 3; ++c) {
      if (!is_byte_column(columns_[c])) return false;
    }
    return true;
  }
  static bool is_byte_column(const std::vector<double>& column) {
    return std::all_of(column.begin(), column.end(),
                       [](double v) { return v >= 0.0 && v <= 255.0 && std::floor(v) == v; });
  }
  [[nodiscard]] bool are_unit(std::size_t first) const {
    for (std::size_t i = 0; i < columns_[0].size(); ++i) {
      const Vec3d n(columns_[first][i], columns_[first + 1][i], columns_[first + 2][i]);
      if (!(std::abs(n.norm() - 1.0) <= kUnitTolerance)) return false;
    }
    return true;
  }

  // Names for the columns of a file that gives none: by how many there are and what they hold.
  [[nodiscard]] std::vector<std::string> guessed_names() const {
    std::vector<std::string> names{"x", "y", "z"};
    for (std::size_t c = 3; c < columns_.size(); ++c) names.push_back("column_" + std::to_string(c + 1));
    const auto set = [&](std::size_t first, std::array<const char*, 3> three) {
      std::copy(three.begin(), three.end(), names.begin() + static_cast<std::ptrdiff_t>(first));
    };
    constexpr std::array<const char*, 3> kNormal{"nx", "ny", "nz"};
    constexpr std::array<const char*, 3> kColor{"red", "green", "blue"};
    if (columns_.size() == 6) {
      if (are_unit(3)) {
        set(3, kNormal);
      } else if (are_bytes(3)) {
        set(3, kColor);
      }
    } else if (columns_.size() == 9) {
      if (are_unit(3) && are_bytes(6)) {
        set(3, kNormal);
        set(6, kColor);
      } else if (are_bytes(3) && are_unit(6)) {
        set(3, kColor);
        set(6, kNormal);
      }
    }
    return names;
  }

  // The file's names, with the standard columns' in the spelling that the rest of the reader knows.
  [[nodiscard]] std::vector<std::string> given_names() const {
    constexpr std::array<std::array<const char*, 2>, 4> kShort{
        {{"r", "red"}, {"g", "green"}, {"b", "blue"}, {"a", "alpha"}}};
    constexpr std::array<const char*, 10> kStandard{"x",  "y",   "z",     "nx",   "ny",
                                                    "nz", "red", "green", "blue", "alpha"};
    std::vector<std::string> names;
    names.reserve(names_.size());
    for (const std::string& name : names_) {
      std::string low = lower_case(name);
      for (const auto& [brief, full] : kShort) {
        if (low == brief) low = full;
      }
      const bool standard = std::find(kStandard.begin(), kStandard.end(), low) != kStandard.end();
      names.push_back(standard ? low : clean_name(name));
    }
    return names;
  }

  std::vector<ScalarAttribute> typed_columns() {
    const auto has = [&](const char* name) {
      const auto given = given_names();
      return std::find(given.begin(), given.end(), name) != given.end();
    };
    const bool named = names_.size() == columns_.size() && has("x") && has("y") && has("z");
    const std::vector<std::string> names = named ? given_names() : guessed_names();
    std::vector<ScalarAttribute> result;
    result.reserve(columns_.size());
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const bool is_color =
          names[c] == "red" || names[c] == "green" || names[c] == "blue" || names[c] == "alpha";
      result.push_back({names[c], typed(std::move(columns_[c]), is_color)});
    }
    return result;
  }

  static ScalarAttribute::Values typed(std::vector<double> column, bool is_color) {
    if (is_color && is_byte_column(column)) return std::vector<std::uint8_t>(column.begin(), column.end());
    return narrowed(std::move(column));
  }

  std::string_view text_;
  LineReader lines_;
  const ImportParams& params_;
  std::vector<std::string_view> fields_;
  std::vector<std::string> names_;
  bool has_names_line_ = false;
  std::optional<std::uint64_t> declared_;
  std::vector<std::vector<double>> columns_;
};

}  // namespace

bool looks_like_xyz(std::span<const std::byte> bytes) {
  constexpr std::size_t kLooked = 65536;
  std::string_view text = text_of(bytes.first(std::min(bytes.size(), kLooked)));
  if (text.find('\0') != std::string_view::npos) return false;
  LineReader lines(text);
  TextLine line;
  std::vector<std::string_view> fields;
  bool had_count = false;
  bool had_names = false;
  while (lines.next(line)) {
    split_fields(line.text, fields);
    if (fields.empty()) continue;
    const bool first_is_number = is_number(fields[0]);
    const bool any_number = std::any_of(fields.begin(), fields.end(), is_number);
    if (first_is_number && fields.size() >= 3) return is_number(fields[1]);
    if (first_is_number && fields.size() == 1 && !had_count && !had_names) {
      had_count = true;
    } else if (!any_number && fields.size() >= 3 && !had_names) {
      had_names = true;
    } else {
      return false;
    }
  }
  return false;
}

Result<ImportedCloud> read_xyz(std::span<const std::byte> bytes, const ImportParams& params) {
  return XyzReader(bytes, params).read();
}

}  // namespace pointwright
