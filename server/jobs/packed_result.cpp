#include "server/jobs/packed_result.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/draco_tiles.h"
#include "engine/io/ply.h"
#include "engine/spatial/coherent_order.h"
#include "server/ingest/files.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/raw_bytes.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/scan_survey.h"
#include "server/jobs/scratch_folder.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::ProblemKind;

constexpr std::uint64_t kSurveyed = 200'000;  // samples that tiles are cut by
constexpr std::size_t kTilesAtOnce = 2;
/// Of a sample while its tile is written: record, columns, the encoder's.
constexpr std::uint64_t kBytesOfPackedSample = 500;
constexpr std::uint64_t kLeastTileSamples = 4096;

class Packer {
 public:
  Packer(const MappedFile& file, const ScanRecords& records, std::string folder, Team& team,
         const ExecutionContext& context, const JobProgress& progress)
      : file_(file),
        records_(records),
        folder_(std::move(folder)),
        team_(team),
        context_(context),
        progress_(progress) {}

  std::optional<Problem> run(const std::string& output, std::uint64_t memory_bytes) {
    if (auto problem = sort(memory_bytes)) return problem;
    if (auto problem = team_.agree(encode_tiles())) return problem;
    share_index();
    std::optional<Problem> problem;
    if (team_.leads())
      if (auto written = write_archive(output); !written) problem = protocol::to_problem(written.error());
    return team_.agree(problem);
  }

 private:
  /// A tile as its encoder knows it; so it goes to the others.
  struct Encoded {
    std::uint64_t tile = 0;
    std::uint64_t part = 0;  // of a tile whose samples could not be parted: they stand in one place
    std::uint64_t samples = 0;
    std::uint64_t bytes = 0;  // of its file
    Vec3d min = Vec3d::Zero();
    Vec3d max = Vec3d::Zero();
  };

  std::optional<Problem> sort(std::uint64_t memory_bytes) {
    const auto found = survey(file_, records_, kSurveyed, team_, context_);
    if (auto problem = found ? std::nullopt : std::optional(protocol::to_problem(found.error())))
      return team_.agree(problem);
    if (auto any = team_.agree(std::nullopt)) return any;
    const Cloud candidates = chosen_cloud(found.value());
    const std::uint64_t bytes_each = kBytesOfPackedSample + 3 * records_.record_bytes;
    const std::uint64_t most = std::clamp<std::uint64_t>(memory_bytes / (kTilesAtOnce * bytes_each),
                                                         kLeastTileSamples, kMostTileSamples);
    const double share = static_cast<double>(candidates.size()) / static_cast<double>(records_.count);
    const auto most_candidates = static_cast<std::size_t>(std::max(1.0, share * static_cast<double>(most)));
    store_.emplace(folder_, TileCuts(candidates.position, most_candidates, most_candidates),
                   candidates.origin);
    std::optional<Problem> problem;
    if (team_.leads())
      if (auto begun = store_->begin(); !begun) problem = protocol::to_problem(begun.error());
    if (auto any = team_.agree(problem)) return any;
    if (auto sorted = store_->sort(file_, records_, team_, context_, true); !sorted)
      problem = protocol::to_problem(sorted.error());
    return team_.agree(problem);
  }

  std::optional<Problem> encode_tiles() {
    std::atomic<std::size_t> next{0};
    std::optional<Problem> failure;
    std::size_t done = 0;
    std::mutex mutex;  // guards failure, done, the tiles and the progress
    const auto encode_all = [&](std::size_t, std::size_t) {
      for (std::size_t tile = next++; tile < store_->tile_count(); tile = next++) {
        if (!team_.takes(tile) || store_->sample_count(tile) == 0) continue;
        {
          const std::lock_guard lock(mutex);
          if (failure) return;
          progress_("packing", static_cast<double>(done++ * static_cast<std::size_t>(team_.size())) /
                                   static_cast<double>(store_->tile_count()));
        }
        const auto encoded = encode(tile);
        const std::lock_guard lock(mutex);
        if (encoded)
          encoded_.insert(encoded_.end(), encoded.value().begin(), encoded.value().end());
        else if (!failure)
          failure = protocol::to_problem(encoded.error());
      }
    };
    parallel_for(kTilesAtOnce, encode_all, 1);
    return failure;
  }

  [[nodiscard]] std::string path_of(const Encoded& encoded) const {
    return folder_ + "/tile-" + std::to_string(encoded.tile) + "-" + std::to_string(encoded.part) + ".packed";
  }

  Result<std::vector<Encoded>> encode(std::size_t tile) const {
    if (context_.is_cancelled()) return cancelled_error();
    auto cloud = cloud_of(tile);
    if (!cloud) return cloud.error();
    std::vector<Encoded> all;
    const auto count = static_cast<std::uint32_t>(cloud.value().size());
    for (std::uint32_t begin = 0; begin < count;) {
      const std::uint32_t end = count - begin > kMostTileSamples ? begin + kMostTileSamples : count;
      const Cloud part = part_of(cloud.value(), begin, end);
      const auto bytes = write_cloud(part, CloudFormat::kDraco, {.caller_order = false});
      if (!bytes) return bytes.error();
      const DracoTile box = draco_tile_of(part, {});
      all.push_back({.tile = tile,
                     .part = all.size(),
                     .samples = box.sample_count,
                     .bytes = bytes.value().size(),
                     .min = box.min,
                     .max = box.max});
      if (auto written = write_file_atomically(path_of(all.back()), bytes.value()); !written)
        return written.error();
      begin = end;
    }
    return all;
  }

  /// The tile's samples in coherent order, as a reader of the file would have them.
  [[nodiscard]] Result<Cloud> cloud_of(std::size_t tile) const {
    const auto header = parse_ply_header(file_.bytes());
    if (!header) return header.error();
    const auto rows = store_->own_records(tile, static_cast<std::size_t>(records_.record_bytes));
    if (!rows) return rows.error();
    auto decoded = read_ply_vertices(rows.value(), header.value());
    if (!decoded) return decoded.error();
    const ImportParams all{.max_samples = decoded.value().cloud.size()};
    auto finished = finish_cloud(decoded.value(), all);
    if (finished) return std::move(finished.value().cloud);
    if (finished.error().code != ErrorCode::kOutOfRange) return finished.error();
    // Too small a part for where it stands: its positions stay as the file has them.
    const Cloud& cloud = decoded.value().cloud;
    return permuted(cloud, coherent_order(cloud.position));
  }

  /// All tiles, by number, for each of the team.
  void share_index() {
    std::vector<Encoded> all;
    for (const auto& bytes : team_.gather(std::as_bytes(std::span(encoded_)))) {
      std::vector<Encoded> theirs(bytes.size() / sizeof(Encoded));
      if (!theirs.empty()) std::memcpy(static_cast<void*>(theirs.data()), bytes.data(), bytes.size());
      all.insert(all.end(), theirs.begin(), theirs.end());
    }
    encoded_ = std::move(all);
    std::ranges::sort(encoded_, {}, [](const Encoded& each) { return std::pair(each.tile, each.part); });
  }

  Result<void> write_archive(const std::string& output) const {
    std::vector<DracoTile> tiles;
    tiles.reserve(encoded_.size());
    for (const Encoded& each : encoded_)
      tiles.push_back({.file = draco_tile_name(tiles.size()),
                       .sample_count = each.samples,
                       .min = each.min,
                       .max = each.max});
    std::vector<std::uint64_t> sizes;
    sizes.reserve(encoded_.size());
    for (const Encoded& each : encoded_) sizes.push_back(each.bytes);
    const auto content = [&](std::size_t k) { return read_file(path_of(encoded_[k]), encoded_[k].bytes); };
    return fill_file_atomically(output, [&](int out) -> Result<bool> {
      int failure = 0;  // errno
      const auto written =
          write_draco_tiles_archive(tiles, sizes, content, [&](std::span<const std::byte> bytes) {
            if (!write_all(out, bytes)) failure = errno;
            return failure == 0;
          });
      if (written) return true;
      if (failure == 0) return written.error();
      errno = failure;
      return false;
    });
  }

  const MappedFile& file_;
  const ScanRecords& records_;
  const std::string folder_;
  Team& team_;
  const ExecutionContext& context_;
  const JobProgress& progress_;
  std::optional<TileStore> store_;
  std::vector<Encoded> encoded_;  // this one's, then everybody's
};

}  // namespace

std::uint64_t packing_bytes(std::uint64_t samples, std::uint64_t record_bytes) {
  return samples * (sizeof(TileSample) + record_bytes);
}

std::optional<Problem> pack_result(const std::string& made, const std::string& output,
                                   const std::string& folder, std::uint64_t memory_bytes, Team& team,
                                   const ExecutionContext& context, const JobProgress& progress) {
  progress("packing", 0.0);
  const auto as_problem = [](const Error& error) { return std::optional(protocol::to_problem(error)); };
  auto file = MappedFile::open(made);
  auto records =
      file ? ScanRecords::of(file.value().bytes()) : Result<std::optional<ScanRecords>>(file.error());
  std::optional<Problem> problem = records ? std::nullopt : as_problem(records.error());
  if (!problem && !records.value())
    problem = Problem{.kind = ProblemKind::kInternalError, .detail = "the result is no binary PLY"};
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!problem && error)
    problem = Problem{.kind = ProblemKind::kStorageFailed, .detail = folder + ": " + error.message()};
  if (team.leads()) ScratchFolder::clear(folder);
  if (auto any = team.agree(problem)) return any;
  problem = Packer(file.value(), *records.value(), folder, team, context, progress).run(output, memory_bytes);
  if (team.leads()) {
    ScratchFolder::clear(folder);
    std::filesystem::remove(folder, error);
  }
  return problem;
}

}  // namespace pointwright::server
