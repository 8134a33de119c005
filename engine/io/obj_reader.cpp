// Wavefront's "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual; colours after the
// coordinates are the extension that scanning software writes.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "engine/io/columns.h"
#include "engine/io/obj.h"
#include "engine/io/text.h"

namespace pointwright {
namespace {

constexpr std::size_t kMostNumbers = 7;  // x y z w r g b

constexpr std::array<std::string_view, 24> kStatements{
    "v",    "vn",  "vt",     "vp",     "f",      "l",   "p",          "o",
    "g",    "s",   "mtllib", "usemtl", "cstype", "deg", "curv",       "parm",
    "surf", "end", "lod",    "usemap", "maplib", "mg",  "shadow_obj", "trace_obj"};

bool is_statement(std::string_view word) {
  return std::find(kStatements.begin(), kStatements.end(), word) != kStatements.end();
}

class ObjReader {
 public:
  ObjReader(std::span<const std::byte> bytes, const ImportParams& params)
      : lines_(text_of(bytes)), params_(params) {}

  Result<ImportedCloud> read() {
    TextLine line;
    while (lines_.next(line)) {
      join(line);
      if (auto done = take_line(line); !done) return done.error();
    }
    if (at_[0].empty())
      return Error{.code = ErrorCode::kEmptyCloud, .message = "the file has no vertices", .field = "v"};
    return assembled();
  }

 private:
  Error malformed(std::uint64_t line, const std::string& what) const {
    std::string message = "line " + std::to_string(line);
    message.append(": ").append(what);
    return Error{.code = ErrorCode::kMalformedData, .message = std::move(message), .field = {}};
  }

  // A backslash before the line's end: the statement goes on in the next one.
  void join(TextLine& line) {
    if (!line.text.ends_with('\\')) return;
    joined_.clear();
    TextLine next = line;
    bool more = true;
    while (more && next.text.ends_with('\\')) {
      joined_.append(next.text.substr(0, next.text.size() - 1)).append(1, ' ');
      next.text = {};
      more = lines_.next(next);
    }
    joined_.append(next.text);
    line.text = joined_;
  }

  Result<void> take_line(const TextLine& line) {
    std::string_view rest = line.text.substr(0, line.text.find('#'));
    const std::string_view word = take_word(rest);
    if (word == "v") return take_vertex(line, rest);
    if (word == "vn") return take_normal(line, rest);
    if (word == "f") {
      ++faces_;
    } else if (word == "l" || word == "p") {
      has_elements_ = true;
    } else if (word == "vt") {
      has_texture_ = true;
    }
    return {};
  }

  // Up to kMostNumbers numbers; the count.
  Result<std::size_t> take_numbers(const TextLine& line, std::string_view rest) {
    std::size_t count = 0;
    for (auto word = take_word(rest); !word.empty(); word = take_word(rest)) {
      if (count == kMostNumbers) return malformed(line.number, "more than seven numbers after 'v'");
      if (!parse_number(word, numbers_[count])) return malformed(line.number, quoted(word) + " is no number");
      ++count;
    }
    return count;
  }

  Result<void> take_vertex(const TextLine& line, std::string_view rest) {
    const auto taken = take_numbers(line, rest);
    if (!taken) return taken.error();
    const std::size_t count = taken.value();
    if (count < 3 || count == 5)
      return malformed(line.number, "a vertex needs three numbers: " + quoted(line.text));
    if (at_[0].empty()) per_vertex_ = count;
    if (count != per_vertex_)
      return malformed(line.number, "the vertex has " + std::to_string(count) +
                                        " numbers where the first had " + std::to_string(per_vertex_));
    if (at_[0].size() == params_.max_samples) return too_large();
    for (std::size_t axis = 0; axis < 3; ++axis) at_[axis].push_back(numbers_[axis]);
    if (count == 4 || count == 7) weight_.push_back(numbers_[3]);
    for (std::size_t c = 0; count >= 6 && c < 3; ++c) color_[c].push_back(numbers_[count - 3 + c]);
    return {};
  }

  Result<void> take_normal(const TextLine& line, std::string_view rest) {
    const auto taken = take_numbers(line, rest);
    if (!taken) return taken.error();
    if (taken.value() != 3) return malformed(line.number, "a normal has three numbers");
    ++normals_;
    // More normals than samples may be are no normals of vertices: they are counted alone.
    if (normals_ > params_.max_samples) return {};
    for (std::size_t axis = 0; axis < 3; ++axis) normal_[axis].push_back(static_cast<float>(numbers_[axis]));
    return {};
  }

  Error too_large() const {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the file has more samples than the " + std::to_string(params_.max_samples) +
                            " that are taken",
                 .field = {},
                 .limit = static_cast<double>(params_.max_samples),
                 .actual = static_cast<double>(at_[0].size() + 1)};
  }

  // 8-bit colours where that loses nothing that was meant.
  ScalarAttribute::Values colors(std::vector<double> column, double unit) const {
    if (unit == 0.0) return narrowed(std::move(column));
    std::vector<std::uint8_t> bytes(column.size());
    std::transform(column.begin(), column.end(), bytes.begin(),
                   [&](double v) { return static_cast<std::uint8_t>(std::lround(v * unit)); });
    return bytes;
  }
  // 255 where every colour is within a text's rounding of a whole 255th, 1 where they are bytes, else 0.
  [[nodiscard]] double color_unit() const {
    constexpr double kRounding = 0.13;  // of a 255th: three decimals are within 0.1275 of one
    bool is_fraction = true;
    bool is_byte = true;
    for (const auto& column : color_) {
      for (const double v : column) {
        is_fraction =
            is_fraction && v >= 0.0 && v <= 1.0 && std::abs(v * 255.0 - std::round(v * 255.0)) <= kRounding;
        is_byte = is_byte && v >= 0.0 && v <= 255.0 && std::floor(v) == v;
      }
    }
    if (is_fraction) return 255.0;
    return is_byte ? 1.0 : 0.0;
  }

  Result<ImportedCloud> assembled() {
    ImportReport report;
    report.format = CloudFormat::kObj;
    report.encoding = "text";
    report.declared_count = at_[0].size();
    report.from_mesh = faces_ > 0;
    if (faces_ > 0) report.skipped.push_back(std::to_string(faces_) + " faces");
    if (has_elements_) report.skipped.emplace_back("lines and points");
    if (has_texture_) report.skipped.emplace_back("texture coordinates");
    const std::size_t n = at_[0].size();
    std::vector<ScalarAttribute> columns;
    constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};
    constexpr std::array<const char*, 3> kNormals{"nx", "ny", "nz"};
    constexpr std::array<const char*, 3> kColors{"red", "green", "blue"};
    for (std::size_t axis = 0; axis < 3; ++axis)
      columns.push_back({kAxes[axis], narrowed(std::move(at_[axis]))});
    if (normals_ == n) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        columns.push_back({kNormals[axis], std::move(normal_[axis])});
    } else if (normals_ > 0) {
      report.skipped.push_back(std::to_string(normals_) + " normals, which are not one for each vertex");
    }
    if (per_vertex_ >= 6) {
      const double unit = color_unit();
      for (std::size_t c = 0; c < 3; ++c) columns.push_back({kColors[c], colors(std::move(color_[c]), unit)});
    }
    const bool has_weight = std::any_of(weight_.begin(), weight_.end(), [](double w) { return w != 1.0; });
    if (has_weight) columns.push_back({"w", narrowed(std::move(weight_))});
    return assemble_cloud(std::move(columns), std::move(report));
  }

  LineReader lines_;
  const ImportParams& params_;
  std::string joined_;
  std::array<double, kMostNumbers> numbers_{};
  std::size_t per_vertex_ = 0;
  std::array<std::vector<double>, 3> at_;
  std::array<std::vector<double>, 3> color_;
  std::array<std::vector<float>, 3> normal_;
  std::vector<double> weight_;
  std::uint64_t normals_ = 0;
  std::uint64_t faces_ = 0;
  bool has_elements_ = false;
  bool has_texture_ = false;
};

}  // namespace

bool looks_like_obj(std::span<const std::byte> bytes) {
  constexpr std::size_t kLooked = 65536;
  const std::string_view text = text_of(bytes.first(std::min(bytes.size(), kLooked)));
  if (text.find('\0') != std::string_view::npos) return false;
  LineReader lines(text);
  TextLine line;
  while (lines.next(line)) {
    std::string_view rest = line.text.substr(0, line.text.find('#'));
    const std::string_view word = take_word(rest);
    if (word.empty()) continue;
    double ignored = 0.0;
    if (!is_statement(word)) return false;
    return word != "v" || parse_number(take_word(rest), ignored);
  }
  return false;
}

Result<ImportedCloud> read_obj(std::span<const std::byte> bytes, const ImportParams& params) {
  return ObjReader(bytes, params).read();
}

}  // namespace pointwright
