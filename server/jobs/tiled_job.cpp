#include "server/jobs/tiled_job.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/simplification/subsample.h"
#include "server/base/descriptor.h"
#include "server/base/sha256.h"
#include "server/ingest/files.h"
#include "server/jobs/recipe_script.h"
#include "server/jobs/result_writer.h"
#include "server/jobs/scan_survey.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::ProblemKind;

/// What a tile's samples and those around them take while they are edited, for each band and for all.
constexpr std::uint64_t kBytesOfSample = 360;
constexpr std::uint64_t kBytesOfBand = 90;
/// Of the memory, what preview, buffers and the program itself may take.
constexpr double kShareOfTiles = 0.8;
/// Tiles that are edited side by side, whatever the number of threads: their size must not depend on it.
constexpr std::size_t kTilesAtOnce = 2;
/// Samples around a tile, by its own: a guess that the share above leaves room for.
constexpr double kAround = 1.5;
/// What is read around a tile is whole cells of its neighbours.
constexpr std::size_t kCellsOfTile = 16;
constexpr std::uint64_t kCandidates = 5;  // for each sample of the preview
constexpr std::uint64_t kLeastSurveyed = 200'000;

/// Neighbourhoods around a sample that its own outcome depends on.
std::uint32_t rings_of(const PlayedSteps& played) {
  const auto bands = static_cast<std::uint32_t>(played.script.bases.bands.size());
  std::uint32_t most = 1;
  for (const PlayedSteps::Step& step : played.steps) {
    std::uint32_t rings = 1;
    for (const TransferredEdit& edit : step.edits) rings += bands - edit.params.level + 1;
    most = std::max(most, rings);
  }
  return most;
}

class TiledJob {
 public:
  TiledJob(const JobParams& params, const MappedFile& file, const ScanRecords& records, Team& team,
           const ExecutionContext& context, const JobProgress& progress)
      : params_(params),
        file_(file),
        records_(records),
        team_(team),
        context_(context),
        progress_(progress),
        outputs_(outputs_of(params)) {}

  Outcome<JobReport> run() {
    report_.samples = records_.count;
    if (auto problem = team_.agree(look())) return *problem;
    if (auto problem = team_.agree(check_disk())) return *problem;
    if (auto problem = team_.agree(play())) return *problem;
    if (auto problem = sort()) return *problem;
    if (auto problem = team_.agree(edit_tiles())) return *problem;
    sum_tiles_kept();
    if (auto problem = write()) return *problem;
    if (team_.leads()) {
      store_->clear();
      std::error_code ignored;
      std::filesystem::remove(params_.folder, ignored);  // unless there is something of others in it
    }
    progress_("done", 1.0);
    return report_;
  }

 private:
  std::optional<Problem> look() {
    progress_("survey", 0.0);
    std::error_code error;
    std::filesystem::create_directories(params_.folder, error);
    if (error)
      return Problem{.kind = ProblemKind::kStorageFailed, .detail = params_.folder + ": " + error.message()};
    auto problem = team_.leads() ? lock() : std::nullopt;
    if (auto any = team_.agree(problem)) return any;
    const std::uint64_t wanted = std::max(kCandidates * params_.preview_count, kLeastSurveyed);
    auto found = survey(file_, records_, wanted, team_, context_);
    if (!found) return protocol::to_problem(found.error());
    surveyed_ = std::move(found).value();
    candidates_ = chosen_cloud(surveyed_);
    if (candidates_.size() == 0)
      return Problem{.kind = ProblemKind::kInvalidValue, .detail = "the scan has no samples"};
    return std::nullopt;
  }

  /// The folder is this job's as long as it lives, however it ends.
  std::optional<Problem> lock() {
    lock_ = Descriptor(::open(params_.folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!lock_.is_open())
      return Problem{.kind = ProblemKind::kStorageFailed,
                     .detail = params_.folder + ": " + std::system_category().message(errno)};
    if (::flock(lock_.get(), LOCK_EX | LOCK_NB) == 0) return std::nullopt;
    return Problem{.kind = ProblemKind::kWrongState, .detail = "another job works in " + params_.folder};
  }

  /// Room for the spool, the tiles' results and the output, before anything is written. What an interrupted
  /// job has left in the folder is there already.
  [[nodiscard]] std::optional<Problem> check_disk() const {
    struct Place {
      std::uint64_t free = 0;
      dev_t device = 0;
    };
    const auto place_of = [](const std::string& path) {
      struct statvfs room {};
      struct stat status {};
      if (::statvfs(path.c_str(), &room) != 0 || ::stat(path.c_str(), &status) != 0) return Place{};
      return Place{.free = static_cast<std::uint64_t>(room.f_bavail) * room.f_frsize,
                   .device = status.st_dev};
    };
    std::uint64_t kept = 0;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(params_.folder, none))
      if (std::error_code gone; TileStore::is_ours(entry.path()) && entry.is_regular_file(gone)) {
        const std::uint64_t size = entry.file_size(gone);
        if (!gone) kept += size;
      }
    const std::uint64_t all = (1 + outputs_.size()) * sizeof(TileSample) * records_.count;
    const std::uint64_t scratch = all - std::min(all, kept);
    const std::uint64_t output = outputs_.size() * file_.bytes().size();
    const std::string beside = std::filesystem::path(params_.output).parent_path().string();
    const Place here = place_of(params_.folder);
    const Place there = place_of(beside.empty() ? "." : beside);
    const bool same = here.device == there.device;
    if (here.free >= scratch + (same ? output : 0) && there.free >= output) return std::nullopt;
    return Problem{.kind = ProblemKind::kOutOfDisk,
                   .detail = "the job needs " + std::to_string(scratch >> 20U) +
                             " MiB for scratch files and " + std::to_string(output >> 20U) +
                             " MiB for its result",
                   .limit = static_cast<double>(std::min(here.free, there.free)),
                   .actual = static_cast<double>(scratch + output)};
  }

  std::optional<Problem> play() {
    progress_("preview", 0.05);
    preview_ = params_.preview;
    if (preview_ == nullptr) {
      auto made = preview_of(candidates_, params_.preview_count, context_);
      if (!made) return protocol::to_problem(made.error());
      preview_ = std::move(made).value();
    }
    report_.preview_samples = preview_->size();
    const auto levels = hierarchy_for(params_.request.recipe, *preview_, params_.neighbors);
    if (!levels.ok()) return levels.problem();
    auto played = play_steps_on_preview(params_.request, static_cast<std::uint32_t>(outputs_.size()),
                                        preview_, levels.value(), context_);
    if (!played.ok()) return played.problem();
    played_ = std::move(played.value());
    EditScript& script = played_.script;
    script.spacing_ratio = static_cast<float>(std::min(
        1.0, std::sqrt(static_cast<double>(preview_->size()) / static_cast<double>(records_.count))));
    report_.spacing = static_cast<double>(script.bases.spacing * script.spacing_ratio);
    rings_ = rings_of(played_);
    return std::nullopt;
  }

  /// What a folder's files belong to.
  [[nodiscard]] std::string identity(std::uint64_t most) const {
    Digest hash(Digest::Algorithm::kSha256);
    const auto add = [&](const void* data, std::size_t size) {
      hash.add(std::span(static_cast<const std::byte*>(data), size));
    };
    const auto add_points = [&](const Points& points) {
      for (const float* column : {points.x(), points.y(), points.z()})
        add(column, points.size() * sizeof(float));
    };
    const std::array<std::uint64_t, 5> numbers{records_.count, most, params_.neighbors, rings_,
                                               outputs_.size()};
    add(numbers.data(), sizeof numbers);
    add(&surveyed_.digest, sizeof surveyed_.digest);
    add(&played_.script.origin, sizeof(Vec3d));
    for (const double scale : params_.request.recipe.level_scales) add(&scale, sizeof scale);
    add(&surveyed_.min, sizeof(Vec3d));
    add(&surveyed_.max, sizeof(Vec3d));
    add_points(played_.rest);
    for (const PlayedSteps::Step& step : played_.steps) {
      add_points(step.result);
      for (const TransferredEdit& edit : step.edits) {
        const std::array<std::uint64_t, 3> head{edit.params.level, edit.regions->zero.size(),
                                                edit.regions->one.size()};
        add(head.data(), sizeof head);
      }
    }
    return to_hex(hash.finish());
  }

  std::optional<Problem> sort() {
    progress_("tiles", 0.1);
    const std::uint64_t bytes_each = kBytesOfSample + kBytesOfBand * played_.script.bases.bands.size();
    const double room = kShareOfTiles * static_cast<double>(params_.memory_bytes);
    const auto most = static_cast<std::uint64_t>(
        std::max(4096.0, room / kAround / static_cast<double>(kTilesAtOnce * bytes_each)));
    const double share = static_cast<double>(candidates_.size()) / static_cast<double>(records_.count);
    const auto most_candidates = static_cast<std::size_t>(std::max(1.0, share * static_cast<double>(most)));
    // Candidates may stand about another origin than the preview that was given.
    Points candidates(candidates_.size());
    const Vec3d offset = candidates_.origin - played_.script.origin;
    for (std::size_t i = 0; i < candidates.size(); ++i)
      candidates.set(i, (candidates_.position[i].cast<double>() + offset).cast<float>());
    store_.emplace(params_.folder, TileCuts(candidates, most_candidates, most_candidates / kCellsOfTile),
                   played_.script.origin);
    candidates_ = {};
    report_.tiles = store_->tile_count();

    const std::string marker = params_.folder + "/job.id";
    const std::string id = identity(most);
    const auto as_bytes_of = [](const std::string& text) {
      return std::as_bytes(std::span(text.data(), text.size()));
    };
    const auto kept = read_file(marker, 1024);
    const bool same =
        team_.told(kept && std::ranges::equal(kept.value(), as_bytes_of(id)) ? "same" : "other") == "same";
    const auto unread = [&]() -> std::optional<Problem> {
      if (!same || store_->is_sorted(records_.count)) return std::nullopt;
      return Problem{.kind = ProblemKind::kInternalError, .detail = "the tiles' index is not whole"};
    };
    if (same && !team_.agree(unread())) return std::nullopt;
    std::optional<Problem> problem;
    if (team_.leads()) problem = begin_sorting();
    if (auto any = team_.agree(problem)) return any;
    if (auto sorted = store_->sort(file_, records_, team_, context_); !sorted)
      problem = protocol::to_problem(sorted.error());
    if (auto any = team_.agree(problem)) return any;
    if (team_.leads())
      if (auto marked = store_->finish(); !marked) problem = protocol::to_problem(marked.error());
    if (team_.leads() && !problem)
      if (auto marked = write_file_atomically(marker, as_bytes_of(id)); !marked)
        problem = protocol::to_problem(marked.error());
    return team_.agree(problem);
  }

  /// What is left of another job goes, what says that it is whole first.
  [[nodiscard]] std::optional<Problem> begin_sorting() const {
    store_->clear();
    if (!sync_folder(params_.folder))
      return Problem{.kind = ProblemKind::kStorageFailed,
                     .detail = params_.folder + ": " + std::system_category().message(errno)};
    if (auto begun = store_->begin(); !begun) return protocol::to_problem(begun.error());
    return std::nullopt;
  }

  void sum_tiles_kept() {
    const std::uint64_t mine = report_.tiles_kept;
    report_.tiles_kept = 0;
    for (const auto& bytes : team_.gather(std::as_bytes(std::span(&mine, 1)))) {
      std::uint64_t theirs = 0;
      std::memcpy(&theirs, bytes.data(), sizeof theirs);
      report_.tiles_kept += theirs;
    }
  }

  std::optional<Problem> edit_tiles() {
    const AnchorIndex anchors(played_.script.rest);
    // Of an even scan of the typical spacing h: k samples in a disc of radius h sqrt(k / pi).
    const double per_ring = std::sqrt((static_cast<double>(params_.neighbors) + 0.5) / std::numbers::pi);
    const auto least_ring = static_cast<float>(report_.spacing * per_ring);
    // Two lanes: what one of them reads, sorts and writes on its own, the other one's loops make up for.
    std::atomic<std::size_t> next{0};
    std::uint64_t done = 0;
    std::optional<Problem> failure;
    std::mutex mutex;  // guards done, failure, the report and the progress
    const auto fail = [&](Problem problem) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::move(problem);
    };
    /// Whether the tile is to be edited.
    const auto begin_tile = [&](std::size_t tile) {
      const std::lock_guard lock(mutex);
      if (failure) return false;
      progress_("tile " + std::to_string(tile + 1) + " of " + std::to_string(store_->tile_count()),
                0.2 + 0.7 * std::min(1.0, static_cast<double>(done) * static_cast<double>(team_.size()) /
                                              static_cast<double>(records_.count)));
      done += store_->sample_count(tile);
      // Steps come in their order.
      if (store_->has_result(tile, outputs_.size() - 1)) {
        ++report_.tiles_kept;
        return false;
      }
      return store_->sample_count(tile) > 0;
    };
    parallel_for(
        kTilesAtOnce,
        [&](std::size_t, std::size_t) {
          for (std::size_t tile = next++; tile < store_->tile_count(); tile = next++) {
            if (!team_.takes(tile) || !begin_tile(tile)) continue;
            if (auto problem = edit_tile(tile, anchors, least_ring)) fail(std::move(*problem));
          }
        },
        1);
    return failure;
  }

  [[nodiscard]] std::optional<Problem> edit_tile(std::size_t tile, const AnchorIndex& anchors,
                                                 float least_ring) const {
    if (context_.is_cancelled()) return protocol::to_problem(cancelled_error());
    auto input = store_->load(tile, rings_, params_.neighbors, least_ring, records_.has_normals());
    if (!input) return protocol::to_problem(input.error());
    auto rest = decompose_samples(played_.script, anchors, input.value().cloud, context_);
    if (!rest) return protocol::to_problem(rest.error());
    for (std::size_t step = 0; step < outputs_.size(); ++step) {
      const bool is_last = step + 1 == outputs_.size();
      auto made = make_edits(played_.script, played_.steps[step].edits,
                             is_last ? std::exchange(rest.value(), {}) : rest.value(), context_);
      if (!made) return protocol::to_problem(made.error());
      const TileResult result = result_of(input.value(), made.value(), played_.steps[step].result);
      if (auto put = store_->put_result(tile, step, result); !put) return protocol::to_problem(put.error());
    }
    return std::nullopt;
  }

  [[nodiscard]] TileResult result_of(const TileInput& input, const TransferredSamples& made,
                                     const Points& shown) const {
    struct Fate {
      TileSample sample;
      float rest_distance = 0.0F;
      float difference = 0.0F;
      bool moved = false;
    };
    const Level& now = made.surface.finest();
    const Points& before = input.cloud->position;
    const Points& normals = input.cloud->normal;
    std::vector<Fate> fates(input.index.size());
    parallel_for(fates.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3f p = now.position[i];
        const Vec3f n = now.normal[i];
        const std::uint32_t anchor = made.anchor[i];
        const Vec3f apart = (p - before[i]) - (shown[anchor] - played_.rest[anchor]);
        fates[i] = {.sample = {.index = input.index[i],
                               .position = {p.x(), p.y(), p.z()},
                               .normal = {n.x(), n.y(), n.z()}},
                    .rest_distance = (before[i] - played_.rest[anchor]).norm(),
                    .difference = apart.norm(),
                    // Normals that are no directions stay as they are where the sample does.
                    .moved = p != before[i] || (records_.has_normals() && turned(normals[i], n))};
      }
    });
    TileResult result;
    std::vector<std::uint32_t> best(played_.rest.size(), kNoParent);
    // Own samples alone, in the scan's order: of equally near ones the first counts.
    for (const std::uint32_t i : input.by_index) {
      const Fate& fate = fates[i];
      if (fate.moved) result.moved.push_back(fate.sample);
      std::uint32_t& nearest = best[made.anchor[i]];
      if (nearest == kNoParent || fate.rest_distance < fates[nearest].rest_distance) nearest = i;
    }
    for (std::uint32_t anchor = 0; anchor < best.size(); ++anchor) {
      if (best[anchor] == kNoParent) continue;
      const Fate& fate = fates[best[anchor]];
      result.matches.push_back(
          {.anchor = anchor, .rest_distance = fate.rest_distance, .difference = fate.difference});
    }
    return result;
  }

  /// Whether an edit has turned the normal: what import makes of a length that is not 1 is no turn.
  static bool turned(const Vec3f& before, const Vec3f& after) {
    if (before == after) return false;
    const float length = before.norm();
    return !(length > 1e-6F) || !std::isfinite(length) ? false : Vec3f(before / length) != after;
  }

  std::optional<Problem> write() {
    for (std::size_t step = 0; step < outputs_.size(); ++step)
      if (auto problem = write(step)) return problem;
    report_.files = outputs_;
    return std::nullopt;
  }

  std::optional<Problem> write(std::size_t step) {
    progress_result(step, 0.0);
    report_.moved = 0;
    std::vector<MovedSamples> moved;
    std::vector<PreviewMatch> best(played_.rest.size(), {.rest_distance = std::numeric_limits<float>::max()});
    for (std::size_t tile = 0; tile < store_->tile_count(); ++tile) {
      if (store_->sample_count(tile) == 0) continue;
      auto file = MappedFile::open(store_->result_path(tile, step));
      if (!file) return protocol::to_problem(file.error());
      auto view = view_result(file.value().bytes());
      if (!view) return protocol::to_problem(view.error());
      report_.moved += view.value().moved.size();
      for (const PreviewMatch& match : view.value().matches)
        if (match.anchor < best.size() && match.rest_distance < best[match.anchor].rest_distance)
          best[match.anchor] = match;
      file.value().release(0, file.value().bytes().size());
      moved.push_back({.file = std::move(file).value(), .samples = view.value().moved});
    }
    DifferenceSum differences;  // the last step's stay
    for (const PreviewMatch& match : best)
      if (static_cast<double>(match.rest_distance) <= report_.spacing)
        differences.add(static_cast<double>(match.difference));
    differences.report(report_);

    ResultWriter writer(file_, records_, team_, played_.script.origin, context_,
                        [&](double part) { progress_result(step, part); });
    return writer.write(outputs_[step], moved);
  }

  void progress_result(std::size_t step, double part) const {
    progress_("result",
              0.9 + 0.1 * (static_cast<double>(step) + part) / static_cast<double>(outputs_.size()));
  }

  const JobParams& params_;
  const MappedFile& file_;
  const ScanRecords& records_;
  Team& team_;
  const ExecutionContext& context_;
  const JobProgress& progress_;
  JobReport report_;
  ScanSurvey surveyed_;
  Cloud candidates_;
  std::shared_ptr<const Cloud> preview_;
  const std::vector<std::string> outputs_;  // one for each step
  PlayedSteps played_;
  std::uint32_t rings_ = 1;
  Descriptor lock_;  // on the folder; the leader's
  std::optional<TileStore> store_;
};

}  // namespace

Outcome<JobReport> run_tiles(const JobParams& params, const MappedFile& file, const ScanRecords& records,
                             Team& team, const ExecutionContext& context, const JobProgress& progress) {
  return TiledJob(params, file, records, team, context, progress).run();
}

void DifferenceSum::add(double difference) {
  ++count_;
  squares_ += difference * difference;
  greatest_ = std::max(greatest_, difference);
}

void DifferenceSum::report(JobReport& report) const {
  report.matched = count_;
  report.rms_difference = count_ > 0 ? std::sqrt(squares_ / static_cast<double>(count_)) : 0.0;
  report.max_difference = greatest_;
}

Result<std::shared_ptr<const Cloud>> preview_of(const Cloud& cloud, std::uint64_t count,
                                                const ExecutionContext& context) {
  if (cloud.size() <= count) return std::shared_ptr<const Cloud>(std::make_shared<const Cloud>(cloud));
  auto chosen = subsample(cloud.position, cloud.normal, {.target = KeepCount{count}}, &context);
  if (!chosen) return chosen.error();
  return std::shared_ptr<const Cloud>(std::make_shared<const Cloud>(permuted(cloud, chosen.value())));
}

}  // namespace pointwright::server
