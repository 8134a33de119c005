#include "engine/io/import_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/median.h"
#include "engine/core/parallel.h"
#include "engine/io/text.h"
#include "engine/spatial/block_tree.h"

namespace pointwright {
namespace {

constexpr std::size_t kMostSearches = 4096;

void list_attributes(ImportedCloud& imported) {
  auto& names = imported.report.attributes;
  names.clear();
  if (imported.cloud.has_normals()) names.emplace_back("normal");
  if (imported.cloud.has_colors()) names.emplace_back("color");
  if (!imported.cloud.texcoord.empty()) names.emplace_back("texcoord");
  for (const ScalarAttribute& scalar : imported.cloud.scalars) names.push_back(scalar.name);
}

AttributeRange range_of(const ScalarAttribute& scalar) {
  AttributeRange range{.name = scalar.name, .type = std::string(type_name(type_of(scalar)))};
  std::visit(
      [&](const auto& values) {
        bool is_first = true;
        for (const auto value : values) {
          const auto v = static_cast<double>(value);
          if (!std::isfinite(v)) {
            ++range.non_finite;
            continue;
          }
          range.min = is_first ? v : std::min(range.min, v);
          range.max = is_first ? v : std::max(range.max, v);
          is_first = false;
        }
      },
      scalar.values);
  return range;
}

// The sample shares its place with a neighbour in the order: its distance is 0 without a search, which among
// many in one place would be dear.
bool is_duplicate(const Points& points, std::size_t i) {
  return (i > 0 && points[i] == points[i - 1]) || (i + 1 < points.size() && points[i] == points[i + 1]);
}

double median_spacing(const Points& points) {
  if (points.size() < 2) return 0.0;
  const std::size_t blocks = (points.size() + kSimdBlock - 1) / kSimdBlock;
  const std::size_t asked = std::min(blocks, kMostSearches / kSimdBlock);
  const BlockTree tree(points);
  std::vector<double> distance(asked * kSimdBlock, -1.0);
  const auto search = [&](std::size_t first, std::size_t last) {
    std::vector<std::int32_t> rows;
    for (std::size_t a = first; a < last; ++a) {
      const std::size_t begin = a * blocks / asked * kSimdBlock;
      const std::size_t end = std::min(begin + kSimdBlock, points.size());
      bool all_duplicates = true;
      for (std::size_t i = begin; i < end; ++i) all_duplicates = all_duplicates && is_duplicate(points, i);
      if (!all_duplicates) tree.nearest_of_range(begin, end, 1, std::numeric_limits<float>::infinity(), rows);
      for (std::size_t i = begin; i < end; ++i) {
        double& d = distance[a * kSimdBlock + (i - begin)];
        if (all_duplicates) {
          d = 0.0;
        } else if (const std::int32_t j = rows[i - begin]; j >= 0) {
          d = (points[static_cast<std::size_t>(j)].cast<double>() - points[i].cast<double>()).norm();
        }
      }
    }
  };
  parallel_for(asked, search, 8);
  std::erase_if(distance, [](double d) { return d < 0.0; });
  return median(std::move(distance));
}

// How far apart two neighbouring numbers of the file's type are at the farthest coordinate.
Vec3d step_of(const ImportReport& report, const Vec3d& file_origin) {
  if (report.grid) return report.grid->scale.cwiseAbs();
  Vec3d step;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double origin = report.position_is_double ? 0.0 : file_origin[axis];
    const double farthest =
        std::max(std::abs(report.bounds_min[axis] - origin), std::abs(report.bounds_max[axis] - origin));
    if (report.position_is_double) {
      step[axis] = std::nextafter(farthest, std::numeric_limits<double>::max()) - farthest;
    } else {
      const auto single = static_cast<float>(farthest);
      step[axis] = static_cast<double>(std::nextafter(single, std::numeric_limits<float>::max())) -
                   static_cast<double>(single);
    }
  }
  return step;
}

std::string shortest(double value) {
  std::string text;
  append_number(text, static_cast<float>(value));
  return text;
}

std::vector<std::string> warnings_of(const ImportReport& report) {
  constexpr double kCoarse = 0.1;  // of the spacing
  std::vector<std::string> warnings;
  if (report.dropped_non_finite > 0)
    warnings.push_back(std::to_string(report.dropped_non_finite) + " samples are dropped: not finite");
  if (report.duplicate_count > 0)
    warnings.push_back(std::to_string(report.duplicate_count) + " samples stand where an earlier one stands");
  if (report.normals == NormalQuality::kScaled)
    warnings.emplace_back("normals are scaled to unit length: some were not");
  const double step = report.step.maxCoeff();
  if (report.spacing > 0.0 && step > kCoarse * report.spacing) {
    std::string text = "positions come in steps of " + shortest(step);
    text.append(", coarse for a spacing of ").append(shortest(report.spacing));
    warnings.push_back(std::move(text));
  }
  for (const AttributeRange& range : report.ranges) {
    if (range.non_finite == 0) continue;
    std::string text = std::to_string(range.non_finite) + " values of ";
    text.append(quoted(range.name)).append(" are not finite");
    warnings.push_back(std::move(text));
  }
  for (const std::string& skipped : report.skipped) warnings.push_back("left out: " + skipped);
  return warnings;
}

}  // namespace

void complete_report(ImportedCloud& imported, const Vec3d& file_origin) {
  ImportReport& report = imported.report;
  list_attributes(imported);
  report.ranges.clear();
  for (const ScalarAttribute& scalar : imported.cloud.scalars) report.ranges.push_back(range_of(scalar));
  if (!imported.cloud.has_normals()) {
    report.normals = NormalQuality::kNone;
  } else if (report.normals == NormalQuality::kNone) {
    report.normals = NormalQuality::kUnit;
  }
  report.spacing = median_spacing(imported.cloud.position);
  report.step = step_of(report, file_origin);
  report.warnings = warnings_of(report);
}

}  // namespace pointwright
