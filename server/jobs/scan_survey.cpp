#include "server/jobs/scan_survey.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "engine/core/mixed_bits.h"
#include "engine/core/parallel.h"
#include "engine/io/cloud_io.h"
#include "engine/spatial/coherent_order.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kChunk = 1U << 20U;  // samples that are looked at together
constexpr double kLargestCoordinate = 1e9;
constexpr std::uint64_t kGoldenRatio = 0x9e3779b97f4a7c15ULL;  // of 2^64: zero mixes to itself

struct Part {
  Vec3d min = Vec3d::Constant(std::numeric_limits<double>::max());
  Vec3d max = Vec3d::Constant(std::numeric_limits<double>::lowest());
  std::uint64_t first_bad = std::numeric_limits<std::uint64_t>::max();
  std::vector<std::uint64_t> chosen;
};

Error bad_sample(const ScanRecords& records, const MappedFile& file, std::uint64_t i) {
  const Vec3d p = records.position(file.bytes().data() + records.begin + i * records.record_bytes);
  const std::string which = "sample " + std::to_string(i);
  if (!p.allFinite())
    return Error{.code = ErrorCode::kNonFinite,
                 .message = which + " has a coordinate that is not finite",
                 .field = "position"};
  return Error{.code = ErrorCode::kOutOfRange,
               .message = which + " has a coordinate beyond 1e9",
               .field = "position",
               .limit = kLargestCoordinate,
               .actual = p.cwiseAbs().maxCoeff()};
}

}  // namespace

Result<ScanSurvey> survey(const MappedFile& file, const ScanRecords& records, std::uint64_t wanted,
                          const ExecutionContext& context) {
  ScanSurvey result;
  Part all;
  const double share = std::min(1.0, static_cast<double>(wanted) / static_cast<double>(records.count));
  const auto limit = share >= 1.0 ? std::numeric_limits<std::uint64_t>::max()
                                  : static_cast<std::uint64_t>(share * 18446744073709551615.0);
  const std::byte* const first = file.bytes().data() + records.begin;
  for (std::uint64_t chunk = 0; chunk < records.count; chunk += kChunk) {
    if (context.is_cancelled()) return cancelled_error();
    const std::uint64_t end = std::min(records.count, chunk + kChunk);
    std::vector<Part> parts((end - chunk + kParallelBlock - 1) / kParallelBlock);
    parallel_for(static_cast<std::size_t>(end - chunk), [&](std::size_t from, std::size_t to) {
      Part& part = parts[from / kParallelBlock];
      for (std::uint64_t i = chunk + from; i < chunk + to; ++i) {
        const Vec3d p = records.position(first + i * records.record_bytes);
        if (!(p.cwiseAbs().maxCoeff() <= kLargestCoordinate) || !p.allFinite()) {
          part.first_bad = std::min(part.first_bad, i);
          continue;
        }
        part.min = part.min.cwiseMin(p);
        part.max = part.max.cwiseMax(p);
        if (mixed_bits(i + kGoldenRatio) <= limit) part.chosen.push_back(i);
      }
    });
    for (const Part& part : parts) {
      all.min = all.min.cwiseMin(part.min);
      all.max = all.max.cwiseMax(part.max);
      if (part.first_bad != std::numeric_limits<std::uint64_t>::max())
        return bad_sample(records, file, part.first_bad);
      for (const std::uint64_t i : part.chosen) {
        const std::byte* const record = first + i * records.record_bytes;
        result.chosen.push_back(i);
        result.position.push_back(records.position(record));
        if (records.has_normals()) result.normal.push_back(records.normal(record));
      }
    }
    file.release(records.begin + chunk * records.record_bytes, records.begin + end * records.record_bytes);
  }
  result.min = all.min;
  result.max = all.max;
  return result;
}

Cloud chosen_cloud(const ScanSurvey& survey) {
  Cloud cloud;
  cloud.origin = recentring_origin(survey.min, survey.max);
  const std::size_t n = survey.position.size();
  Points position(n);
  Points normal(survey.normal.size());
  for (std::size_t i = 0; i < n; ++i) {
    position.set(i, Vec3d(survey.position[i] - cloud.origin).cast<float>());
    if (!survey.normal.empty()) normal.set(i, survey.normal[i]);
  }
  cloud.position = std::move(position);
  cloud.normal = std::move(normal);
  cloud.id.resize(n);
  for (std::size_t i = 0; i < n; ++i) cloud.id[i] = static_cast<std::uint32_t>(i);
  return permuted(cloud, coherent_order(cloud.position));
}

}  // namespace pointwright::server
