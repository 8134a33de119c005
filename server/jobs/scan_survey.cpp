#include "server/jobs/scan_survey.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>

#include "engine/core/check.h"
#include "engine/core/mixed_bits.h"
#include "engine/core/parallel.h"
#include "engine/io/cloud_io.h"
#include "engine/spatial/coherent_order.h"
#include "server/jobs/raw_bytes.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kChunk = 1U << 20U;  // samples that are looked at together
constexpr double kLargestCoordinate = 1e9;
constexpr std::uint64_t kGoldenRatio = 0x9e3779b97f4a7c15ULL;  // of 2^64: zero mixes to itself

struct Part {
  Vec3d min = Vec3d::Constant(std::numeric_limits<double>::max());
  Vec3d max = Vec3d::Constant(std::numeric_limits<double>::lowest());
  std::uint64_t first_bad = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t digest = 0;
  std::vector<std::uint64_t> chosen;
};

/// A sample's part of the digest: they are added up, in any order.
std::uint64_t digest_of(std::uint64_t i, const Vec3d& p) {
  std::uint64_t mixed = i + kGoldenRatio;
  for (const double x : {p.x(), p.y(), p.z()}) mixed = mixed_bits(mixed ^ std::bit_cast<std::uint64_t>(x));
  return mixed;
}

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

/// What one of a team tells the others, before its chosen samples.
struct Told {
  Vec3d min;
  Vec3d max;
  std::uint64_t first_bad = 0;
  std::uint64_t digest = 0;
  std::uint64_t chosen = 0;
};

/// Takes so many values off the front. Pre: one of the team has put them there.
template <typename T>
void take(std::span<const std::byte>& bytes, std::size_t count, std::vector<T>& to) {
  const std::size_t at = to.size();
  to.resize(at + count);
  POINTWRIGHT_CHECK(take_raw(bytes, to.data() + at, count), "a part of the survey that is not whole");
}

}  // namespace

Result<ScanSurvey> survey(const MappedFile& file, const ScanRecords& records, std::uint64_t wanted,
                          Team& team, const ExecutionContext& context) {
  constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();
  ScanSurvey mine;
  Part all;
  const double share = std::min(1.0, static_cast<double>(wanted) / static_cast<double>(records.count));
  const auto limit = share >= 1.0 ? kNone : static_cast<std::uint64_t>(share * 18446744073709551615.0);
  const std::byte* const first = file.bytes().data() + records.begin;
  // Each takes chunks in a row, so that all together have them in the file's order.
  const std::uint64_t chunks = (records.count + kChunk - 1) / kChunk;
  const auto bound = [&](int rank) {
    return kChunk * (chunks * static_cast<std::uint64_t>(rank) / static_cast<std::uint64_t>(team.size()));
  };
  const std::uint64_t stop = std::min(records.count, bound(team.rank() + 1));
  for (std::uint64_t chunk = bound(team.rank()); chunk < stop && all.first_bad == kNone; chunk += kChunk) {
    if (context.is_cancelled()) break;
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
        part.digest += digest_of(i, p);
        if (records.has_normals())
          part.digest += digest_of(~i, records.normal(first + i * records.record_bytes).cast<double>());
        if (mixed_bits(i + kGoldenRatio) <= limit) part.chosen.push_back(i);
      }
    });
    for (const Part& part : parts) {
      all.min = all.min.cwiseMin(part.min);
      all.max = all.max.cwiseMax(part.max);
      all.first_bad = std::min(all.first_bad, part.first_bad);
      all.digest += part.digest;
      for (const std::uint64_t i : part.chosen) {
        const std::byte* const record = first + i * records.record_bytes;
        mine.chosen.push_back(i);
        mine.position.push_back(records.position(record));
        if (records.has_normals()) mine.normal.push_back(records.normal(record));
      }
    }
    file.release(records.begin + chunk * records.record_bytes, records.begin + end * records.record_bytes);
  }
  std::vector<std::byte> said;
  const Told told{.min = all.min,
                  .max = all.max,
                  .first_bad = all.first_bad,
                  .digest = all.digest,
                  .chosen = mine.chosen.size()};
  append_raw(said, &told, 1);
  append_raw(said, mine.chosen.data(), mine.chosen.size());
  append_raw(said, mine.position.data(), mine.position.size());
  append_raw(said, mine.normal.data(), mine.normal.size());
  ScanSurvey result;
  Part together;
  for (const auto& bytes : team.gather(said)) {
    std::span<const std::byte> rest(bytes);
    std::vector<Told> head;
    take(rest, 1, head);
    together.min = together.min.cwiseMin(head[0].min);
    together.max = together.max.cwiseMax(head[0].max);
    together.first_bad = std::min(together.first_bad, head[0].first_bad);
    result.digest += head[0].digest;
    const auto count = static_cast<std::size_t>(head[0].chosen);
    take(rest, count, result.chosen);
    take(rest, count, result.position);
    if (records.has_normals()) take(rest, count, result.normal);
  }
  if (context.is_cancelled()) return cancelled_error();
  if (together.first_bad != kNone) return bad_sample(records, file, together.first_bad);
  result.min = together.min;
  result.max = together.max;
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
