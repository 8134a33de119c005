#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "engine/core/parallel.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/import_report.h"
#include "engine/spatial/coherent_order.h"

namespace pointwright {
namespace {

constexpr double kLargestCoordinate = 1e9;
constexpr double kLeastExtentFloat = 1e-5;    // of the largest coordinate: some 170 steps of a float32
constexpr double kLeastExtentDouble = 1e-12;  // some 4500 steps of a float64
constexpr double kNearZero = 8.0;             // extents

using Position = std::array<double, 3>;

// The position as the file has it. A negative zero at origin 0 stays one.
Position file_position(const Cloud& cloud, std::size_t i) {
  if (!cloud.exact_position.empty()) return cloud.exact_position[i];
  const std::array<float, 3> p{cloud.position.x()[i], cloud.position.y()[i], cloud.position.z()[i]};
  Position result{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double origin = cloud.origin[static_cast<Eigen::Index>(axis)];
    result[axis] = origin == 0.0 ? static_cast<double>(p[axis]) : origin + static_cast<double>(p[axis]);
  }
  return result;
}

std::array<std::uint64_t, 3> bits_of(const Position& p) {
  return {std::bit_cast<std::uint64_t>(p[0]), std::bit_cast<std::uint64_t>(p[1]),
          std::bit_cast<std::uint64_t>(p[2])};
}

bool is_finite(const Position& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

struct Range {
  Vec3d min = Vec3d::Constant(std::numeric_limits<double>::max());
  Vec3d max = Vec3d::Constant(std::numeric_limits<double>::lowest());
  bool is_finite = true;  // of every coordinate; min and max mean nothing where it is not

  [[nodiscard]] double extent() const { return (max - min).maxCoeff(); }
  [[nodiscard]] Vec3d farthest() const { return min.cwiseAbs().cwiseMax(max.cwiseAbs()); }
  friend Range operator+(const Range& a, const Range& b) {
    return {a.min.cwiseMin(b.min), a.max.cwiseMax(b.max), a.is_finite && b.is_finite};
  }
};

// Least, greatest, and whether all are finite: x * 0 is 0 for these alone.
void extend(const float* values, std::size_t begin, std::size_t end, Eigen::Index axis, Range& range) {
  float low = values[begin];
  float high = low;
  float zero = 0.0F;
  for (std::size_t i = begin; i < end; ++i) {
    low = std::min(low, values[i]);
    high = std::max(high, values[i]);
    zero += values[i] * 0.0F;
  }
  range.min[axis] = static_cast<double>(low);
  range.max[axis] = static_cast<double>(high);
  range.is_finite = range.is_finite && zero == 0.0F;
}

Range range_of(const Cloud& cloud) {
  const bool is_plain_float = cloud.exact_position.empty() && cloud.origin.isZero(0.0);
  return parallel_sum<Range>(cloud.size(), Range{}, [&](std::size_t begin, std::size_t end) {
    Range range;
    if (is_plain_float) {
      extend(cloud.position.x(), begin, end, 0, range);
      extend(cloud.position.y(), begin, end, 1, range);
      extend(cloud.position.z(), begin, end, 2, range);
      return range;
    }
    for (std::size_t i = begin; i < end; ++i) {
      const Position p = file_position(cloud, i);
      const Vec3d v(p[0], p[1], p[2]);
      range.min = range.min.cwiseMin(v);
      range.max = range.max.cwiseMax(v);
      range.is_finite = range.is_finite && is_finite(p);
    }
    return range;
  });
}

// There is such a sample: refuses, or leaves the cloud without them.
Result<void> drop_or_refuse_non_finite(ImportedCloud& imported, const ImportParams& params) {
  Cloud& cloud = imported.cloud;
  std::vector<std::uint32_t> finite;
  std::optional<std::size_t> first_bad;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (is_finite(file_position(cloud, i))) {
      finite.push_back(static_cast<std::uint32_t>(i));
    } else if (!first_bad) {
      first_bad = i;
    }
  }
  const std::size_t count = cloud.size() - finite.size();
  if (!params.drop_non_finite) {
    return Error{.code = ErrorCode::kNonFinite,
                 .message = std::to_string(count) + " of " + std::to_string(cloud.size()) +
                            " samples have a coordinate that is not finite; the first is sample " +
                            std::to_string(first_bad.value_or(0)),
                 .field = "position",
                 .limit = 0.0,
                 .actual = static_cast<double>(count)};
  }
  if (finite.empty()) {
    return Error{
        .code = ErrorCode::kEmptyCloud, .message = "no sample has finite coordinates", .field = "position"};
  }
  cloud = permuted(cloud, finite);
  std::iota(cloud.id.begin(), cloud.id.end(), 0U);
  imported.report.dropped_non_finite = count;
  return {};
}

Result<void> check_range(const Range& range, bool is_double) {
  const double farthest = range.farthest().maxCoeff();
  if (!(farthest <= kLargestCoordinate)) {
    return Error{.code = ErrorCode::kOutOfRange,
                 .message = "a coordinate reaches " + std::to_string(farthest) + "; at most 1e9 is taken",
                 .field = "position",
                 .limit = kLargestCoordinate,
                 .actual = farthest};
  }
  const double least = farthest * (is_double ? kLeastExtentDouble : kLeastExtentFloat);
  if (range.extent() > 0.0 && range.extent() < least) {
    return Error{.code = ErrorCode::kOutOfRange,
                 .message = "the samples span " + std::to_string(range.extent()) + " at coordinates up to " +
                            std::to_string(farthest) +
                            ": too little for their precision. Send float64 positions, or "
                            "coordinates nearer to zero",
                 .field = "position",
                 .limit = least,
                 .actual = range.extent()};
  }
  return {};
}

// A file's own origin is kept where the positions around it lie near zero: then float32 serves them well.
bool keeps_origin(const Cloud& cloud, const Range& range) {
  if (cloud.origin.isZero(0.0) || !cloud.exact_position.empty()) return false;
  const double reach =
      (range.max - cloud.origin).cwiseAbs().cwiseMax((range.min - cloud.origin).cwiseAbs()).maxCoeff();
  return reach <= kNearZero * range.extent();
}

void recentre(Cloud& cloud, const Range& range) {
  if (keeps_origin(cloud, range)) return;
  const Vec3d origin = recentring_origin(range.min, range.max);
  const bool is_plain_float = cloud.exact_position.empty() && cloud.origin.isZero(0.0);
  if (is_plain_float && origin.isZero(0.0)) return;
  std::vector<Position> exact(cloud.size());
  parallel_for(cloud.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      exact[i] = file_position(cloud, i);
      const Vec3d p(exact[i][0], exact[i][1], exact[i][2]);
      // At origin 0 the cast alone keeps a negative zero.
      cloud.position.set(i, Vec3d((origin.array() == 0.0).select(p, p - origin)).cast<float>());
    }
  });
  cloud.origin = origin;
  cloud.exact_position.clear();
  const auto changed = parallel_sum<std::size_t>(cloud.size(), 0, [&](std::size_t begin, std::size_t end) {
    std::size_t count = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (bits_of(file_position(cloud, i)) != bits_of(exact[i])) ++count;
    }
    return count;
  });
  if (changed > 0) cloud.exact_position = std::move(exact);
}

// After coherent ordering equal float positions are adjacent; equal exact ones may be parted by others of the
// same float.
std::uint64_t count_duplicates(const Cloud& cloud) {
  const auto same_place = [&](std::size_t a, std::size_t b) {
    return cloud.position[a] == cloud.position[b];
  };
  std::uint64_t duplicates = 0;
  std::vector<Position> run;
  for (std::size_t begin = 0; begin < cloud.size();) {
    std::size_t end = begin + 1;
    while (end < cloud.size() && same_place(begin, end)) ++end;
    if (end - begin > 1 && cloud.exact_position.empty()) {
      duplicates += end - begin - 1;
    } else if (end - begin > 1) {
      run.assign(cloud.exact_position.begin() + static_cast<std::ptrdiff_t>(begin),
                 cloud.exact_position.begin() + static_cast<std::ptrdiff_t>(end));
      std::sort(run.begin(), run.end());
      duplicates += static_cast<std::uint64_t>(run.end() - std::unique(run.begin(), run.end()));
    }
    begin = end;
  }
  return duplicates;
}

}  // namespace

// Multiples of a power of two subtract from float32 coordinates without a rounding.
Vec3d recentring_origin(const Vec3d& min, const Vec3d& max) {
  const double extent = (max - min).maxCoeff();
  Vec3d origin = Vec3d::Zero();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    if (std::max(std::abs(min[axis]), std::abs(max[axis])) <= kNearZero * extent) continue;
    const double middle = 0.5 * (min[axis] + max[axis]);
    // Without an extent the place itself is the origin, as a float32.
    const double step = extent > 0.0 ? std::exp2(std::ceil(std::log2(extent)) - 3.0) : 0.0;
    origin[axis] =
        step > 0.0 ? std::round(middle / step) * step : static_cast<double>(static_cast<float>(middle));
  }
  return origin;
}

Result<ImportedCloud> finish_cloud(ImportedCloud decoded, const ImportParams& params) {
  ImportedCloud& imported = decoded;
  Cloud& cloud = imported.cloud;
  if (cloud.position.empty()) {
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the cloud has no samples", .field = {}};
  }
  if (cloud.size() > params.max_samples) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the cloud has " + std::to_string(cloud.size()) + " samples; at most " +
                            std::to_string(params.max_samples) + " are taken",
                 .field = "position",
                 .limit = static_cast<double>(params.max_samples),
                 .actual = static_cast<double>(cloud.size())};
  }
  if (!cloud.origin.allFinite()) {
    return Error{
        .code = ErrorCode::kNonFinite, .message = "the file's origin is not finite", .field = "origin"};
  }
  const Vec3d file_origin = cloud.origin;
  Range range = range_of(cloud);
  if (!range.is_finite) {
    if (auto finite = drop_or_refuse_non_finite(imported, params); !finite) return finite.error();
    range = range_of(cloud);
  }
  // A file with an origin of its own resolves places that float32 in model space would not: such a cloud
  // leaves as float64, too, or it could not come back.
  const bool has_origin = !cloud.origin.isZero(0.0);
  if (auto checked = check_range(range, cloud.position_is_double || has_origin); !checked)
    return checked.error();
  const double least = kLeastExtentFloat * range.farthest().maxCoeff();
  if (has_origin && range.extent() > 0.0 && range.extent() < least) cloud.position_is_double = true;
  recentre(cloud, range);
  cloud = permuted(cloud, coherent_order(cloud.position));
  imported.report.sample_count = cloud.size();
  imported.report.duplicate_count = count_duplicates(cloud);
  imported.report.position_is_double = cloud.position_is_double;
  imported.report.bounds_min = range.min;
  imported.report.bounds_max = range.max;
  complete_report(imported, file_origin);
  return decoded;
}

}  // namespace pointwright
