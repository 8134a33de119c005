#include "engine/io/columns.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <string_view>

namespace pointwright {
namespace {

constexpr float kUnitTolerance = 1e-3F;  // of a normal's length: text with three digits passes as it is

class ColumnSet {
 public:
  explicit ColumnSet(std::vector<ScalarAttribute> columns) : columns_(std::move(columns)) {}

  [[nodiscard]] const ScalarAttribute* find(std::string_view name) const {
    for (const auto& column : columns_) {
      if (column.name == name) return &column;
    }
    return nullptr;
  }
  template <typename T>
  [[nodiscard]] const std::vector<T>* find_as(std::string_view name) const {
    const ScalarAttribute* column = find(name);
    return column == nullptr ? nullptr : std::get_if<std::vector<T>>(&column->values);
  }
  void remove(std::string_view name) {
    std::erase_if(columns_, [&](const ScalarAttribute& column) { return column.name == name; });
  }
  [[nodiscard]] std::optional<std::string> duplicate_name() const {
    std::set<std::string_view> seen;
    for (const auto& column : columns_) {
      if (!seen.insert(column.name).second) return column.name;
    }
    return std::nullopt;
  }
  std::vector<ScalarAttribute> take_rest() { return std::move(columns_); }

 private:
  std::vector<ScalarAttribute> columns_;
};

// A column that float32 cannot hold without loss: doubles always (they leave as doubles), integers by their
// values.
bool is_double_column(const ScalarAttribute& column) {
  const auto loses = [](const auto& values) {
    return std::any_of(values.begin(), values.end(), [](auto v) {
      return static_cast<double>(static_cast<float>(v)) != static_cast<double>(v);
    });
  };
  if (const auto* v = std::get_if<std::vector<std::int32_t>>(&column.values)) return loses(*v);
  if (const auto* v = std::get_if<std::vector<std::uint32_t>>(&column.values)) return loses(*v);
  return std::holds_alternative<std::vector<double>>(column.values);
}

Error missing(const char* name) {
  return Error{.code = ErrorCode::kMalformedData,
               .message = std::string("there is no coordinate '") + name + "'",
               .field = name};
}

Result<void> take_positions(ColumnSet& columns, ImportedCloud& result) {
  constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
  Cloud& cloud = result.cloud;
  for (const char* name : kNames) {
    const ScalarAttribute* column = columns.find(name);
    if (column == nullptr) return missing(name);
    cloud.position_is_double = cloud.position_is_double || is_double_column(*column);
    cloud.position.resize(column->size());
  }
  const std::size_t n = cloud.position.size();
  if (n == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the cloud has no samples", .field = {}};
  if (cloud.position_is_double) cloud.exact_position.resize(n);
  const std::array<float*, 3> out{cloud.position.x(), cloud.position.y(), cloud.position.z()};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::visit(
        [&](const auto& values) {
          for (std::size_t i = 0; i < n; ++i) out[axis][i] = static_cast<float>(values[i]);
          if (!cloud.position_is_double) return;
          for (std::size_t i = 0; i < n; ++i) cloud.exact_position[i][axis] = static_cast<double>(values[i]);
        },
        columns.find(kNames[axis])->values);
    columns.remove(kNames[axis]);
  }
  return {};
}

template <typename T>
bool take_normals_as(ColumnSet& columns, ImportedCloud& result) {
  const std::array<const std::vector<T>*, 3> from{columns.find_as<T>("nx"), columns.find_as<T>("ny"),
                                                  columns.find_as<T>("nz")};
  if (from[0] == nullptr || from[1] == nullptr || from[2] == nullptr) return false;
  Points normals(from[0]->size());
  const Points& position = result.cloud.position;
  bool all_unit = true;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    // Samples that stand nowhere are refused or dropped later: what normal they have does not matter.
    if (!std::isfinite(position.x()[i] + position.y()[i] + position.z()[i])) {
      normals.set(i, Vec3f::UnitZ());
      continue;
    }
    const Vec3d exact(static_cast<double>((*from[0])[i]), static_cast<double>((*from[1])[i]),
                      static_cast<double>((*from[2])[i]));
    const double length = exact.stableNorm();
    if (!std::isfinite(length) || length < 1e-30) {
      result.report.skipped.emplace_back("normals: sample " + std::to_string(i) +
                                         " has none, so nx, ny and nz are kept as plain properties");
      return true;
    }
    const bool unit = std::abs(length - 1.0) <= static_cast<double>(kUnitTolerance);
    all_unit = all_unit && unit;
    normals.set(i, (unit ? exact : Vec3d(exact / length)).cast<float>());
  }
  for (const char* name : {"nx", "ny", "nz"}) columns.remove(name);
  result.cloud.normal = std::move(normals);
  result.report.normals = all_unit ? NormalQuality::kUnit : NormalQuality::kScaled;
  return true;
}

void take_colors(ColumnSet& columns, Cloud& cloud) {
  using Bytes = std::vector<std::uint8_t>;
  const std::array<const Bytes*, 3> rgb{columns.find_as<std::uint8_t>("red"),
                                        columns.find_as<std::uint8_t>("green"),
                                        columns.find_as<std::uint8_t>("blue")};
  if (rgb[0] == nullptr || rgb[1] == nullptr || rgb[2] == nullptr) return;
  const Bytes* alpha = columns.find_as<std::uint8_t>("alpha");
  cloud.color.resize(rgb[0]->size());
  for (std::size_t i = 0; i < cloud.color.size(); ++i) {
    cloud.color[i] = {(*rgb[0])[i], (*rgb[1])[i], (*rgb[2])[i],
                      alpha == nullptr ? std::uint8_t{255} : (*alpha)[i]};
  }
  cloud.color_has_alpha = alpha != nullptr;
  for (const char* name : {"red", "green", "blue"}) columns.remove(name);
  if (cloud.color_has_alpha) columns.remove("alpha");
}

void take_texcoords(ColumnSet& columns, Cloud& cloud) {
  for (const auto& [first, second] : kTexCoordNames) {
    const auto* s = columns.find_as<float>(first);
    const auto* t = columns.find_as<float>(second);
    if (s == nullptr || t == nullptr) continue;
    cloud.texcoord.resize(s->size());
    for (std::size_t i = 0; i < cloud.texcoord.size(); ++i) cloud.texcoord[i] = {(*s)[i], (*t)[i]};
    columns.remove(first);
    columns.remove(second);
    return;
  }
}

bool is_float(double value) {
  return static_cast<double>(static_cast<float>(value)) == value;
}

}  // namespace

Result<ImportedCloud> assemble_cloud(std::vector<ScalarAttribute> columns, ImportReport report) {
  ColumnSet set(std::move(columns));
  if (const auto name = set.duplicate_name()) {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "the property " + quoted(*name) + " stands there twice",
                 .field = clean_name(*name)};
  }
  ImportedCloud result{.cloud = {}, .report = std::move(report)};
  if (auto taken = take_positions(set, result); !taken) return taken.error();
  if (!take_normals_as<float>(set, result)) take_normals_as<double>(set, result);
  take_colors(set, result.cloud);
  take_texcoords(set, result.cloud);
  result.cloud.scalars = set.take_rest();
  result.cloud.id.resize(result.cloud.size());
  std::iota(result.cloud.id.begin(), result.cloud.id.end(), 0U);
  return result;
}

Result<Cloud> with_attributes(Cloud cloud, const std::vector<std::string>& names) {
  std::set<std::string> wanted(names.begin(), names.end());
  if (cloud.has_normals() && wanted.erase("normal") == 0) cloud.normal = Points();
  if (cloud.has_colors() && wanted.erase("color") == 0) {
    cloud.color.clear();
    cloud.color_has_alpha = false;
  }
  if (!cloud.texcoord.empty() && wanted.erase("texcoord") == 0) cloud.texcoord.clear();
  std::erase_if(cloud.scalars, [&](const ScalarAttribute& scalar) { return wanted.erase(scalar.name) == 0; });
  if (wanted.empty()) return cloud;
  return Error{.code = ErrorCode::kInvalidArgument,
               .message = "the cloud has no attribute " + quoted(*wanted.begin()),
               .field = "attributes"};
}

ExportView::ExportView(const Cloud& cloud, bool caller_order) : cloud_(cloud), order_(cloud.size()) {
  // Ids have gaps where samples were removed.
  const bool has_gaps = caller_order && std::any_of(cloud.id.begin(), cloud.id.end(),
                                                    [&](std::uint32_t id) { return id >= order_.size(); });
  for (std::uint32_t i = 0; i < order_.size(); ++i) order_[caller_order && !has_gaps ? cloud.id[i] : i] = i;
  if (has_gaps)
    std::sort(order_.begin(), order_.end(),
              [&](std::uint32_t a, std::uint32_t b) { return cloud.id[a] < cloud.id[b]; });
  needs_double_ = cloud.position_is_double;
  for (std::uint32_t i = 0; !needs_double_ && i < order_.size(); ++i) {
    const auto p = position(i);
    needs_double_ = !(is_float(p[0]) && is_float(p[1]) && is_float(p[2]));
  }
  choose_names();
}

std::array<double, 3> ExportView::position(std::uint32_t sample) const {
  if (!cloud_.exact_position.empty()) return cloud_.exact_position[sample];
  const std::array<float, 3> p{cloud_.position.x()[sample], cloud_.position.y()[sample],
                               cloud_.position.z()[sample]};
  std::array<double, 3> result{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // 0 + -0 is +0: a negative zero must not pass through the sum.
    const double origin = cloud_.origin[static_cast<Eigen::Index>(axis)];
    result[axis] = origin == 0.0 ? static_cast<double>(p[axis]) : origin + static_cast<double>(p[axis]);
  }
  return result;
}

void ExportView::choose_names() {
  std::set<std::string> own;
  for (const auto& scalar : cloud_.scalars) own.insert(clean_name(scalar.name));
  std::set<std::string> taken{"x", "y", "z"};
  if (cloud_.has_normals()) taken.insert({"nx", "ny", "nz"});
  if (cloud_.has_colors()) taken.insert({"red", "green", "blue"});
  if (cloud_.color_has_alpha) taken.insert("alpha");
  if (!cloud_.texcoord.empty()) {
    texcoord_names_ = {kTexCoordNames[0][0], kTexCoordNames[0][1]};
    for (const auto& [first, second] : kTexCoordNames) {
      if (own.contains(first) || own.contains(second)) continue;
      texcoord_names_ = {first, second};
      break;
    }
    taken.insert({texcoord_names_[0], texcoord_names_[1]});
  }
  scalar_names_.reserve(cloud_.scalars.size());
  for (const auto& scalar : cloud_.scalars) {
    std::string name = clean_name(scalar.name);
    while (!taken.insert(name).second) name = "scalar_" + name;
    scalar_names_.push_back(std::move(name));
  }
}

std::vector<ScalarAttribute> columns_of(const ExportView& view) {
  const Cloud& cloud = view.cloud();
  std::vector<ScalarAttribute> columns;
  const auto add = [&]<typename T>(const std::string& name, T, auto value_of) {
    std::vector<T> values(view.size());
    for (std::size_t row = 0; row < view.size(); ++row) values[row] = value_of(view.sample(row));
    columns.push_back({.name = name, .values = std::move(values)});
  };
  constexpr std::array<const char*, 3> kPosition{"x", "y", "z"};
  constexpr std::array<const char*, 3> kNormal{"nx", "ny", "nz"};
  constexpr std::array<const char*, 4> kColor{"red", "green", "blue", "alpha"};
  for (std::size_t axis = 0; axis < 3; ++axis)
    add(kPosition[axis], double{}, [&](std::uint32_t i) { return view.position(i)[axis]; });
  for (std::size_t axis = 0; axis < 3 && cloud.has_normals(); ++axis)
    add(kNormal[axis], float{},
        [&](std::uint32_t i) { return cloud.normal[i][static_cast<Eigen::Index>(axis)]; });
  const std::size_t channels = !cloud.has_colors() ? 0 : cloud.color_has_alpha ? 4 : 3;
  for (std::size_t k = 0; k < channels; ++k)
    add(kColor[k], std::uint8_t{}, [&](std::uint32_t i) { return cloud.color[i][k]; });
  for (std::size_t k = 0; k < 2 && !cloud.texcoord.empty(); ++k)
    add(view.texcoord_names()[k], float{}, [&](std::uint32_t i) { return cloud.texcoord[i][k]; });
  for (std::size_t s = 0; s < cloud.scalars.size(); ++s)
    std::visit(
        [&](const auto& values) {
          using T = typename std::decay_t<decltype(values)>::value_type;
          add(view.scalar_names()[s], T{}, [&](std::uint32_t i) { return values[i]; });
        },
        cloud.scalars[s].values);
  return columns;
}

}  // namespace pointwright
