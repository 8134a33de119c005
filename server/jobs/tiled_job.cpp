#include "server/jobs/tiled_job.h"

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
#include "server/base/sha256.h"
#include "server/ingest/files.h"
#include "server/jobs/packed_result.h"
#include "server/jobs/recipe_script.h"
#include "server/jobs/result_writer.h"
#include "server/jobs/scan_survey.h"
#include "server/jobs/tile_fates.h"
#include "server/jobs/tile_plan.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::ProblemKind;

/// What is read around a tile is whole cells of its neighbours.
constexpr std::size_t kCellsOfTile = 16;
constexpr std::uint64_t kCandidates = 5;  // for each sample of the preview
constexpr std::uint64_t kLeastSurveyed = 200'000;

class TiledJob {
 public:
  TiledJob(const JobParams& params, const TiledScan& scan, Team& team, const ExecutionContext& context,
           const JobProgress& progress)
      : params_(params),
        file_(scan.file),
        records_(scan.records),
        team_(team),
        context_(context),
        progress_(progress),
        outputs_(scan.outputs),
        is_packed_afterwards_(scan.is_packed_afterwards) {}

  Outcome<TiledResult> run() {
    report_.samples = records_.count;
    if (auto problem = team_.agree(look())) return *problem;
    if (auto problem = team_.agree(play())) return *problem;
    if (auto problem = team_.agree(check_disk())) return *problem;
    if (auto problem = sort()) return *problem;
    if (auto problem = team_.agree(edit_tiles())) return *problem;
    sum_tiles_kept();
    if (auto problem = write()) return *problem;
    return TiledResult{.report = report_, .is_changed = is_changed_};
  }

 private:
  std::optional<Problem> look() {
    progress_("survey", 0.0);
    const std::uint64_t wanted = std::max(kCandidates * params_.preview_count, kLeastSurveyed);
    auto found = survey(file_, records_, wanted, team_, context_);
    if (!found) return protocol::to_problem(found.error());
    surveyed_ = std::move(found).value();
    candidates_ = chosen_cloud(surveyed_);
    if (candidates_.size() == 0)
      return Problem{.kind = ProblemKind::kInvalidValue, .detail = "the scan has no samples"};
    return std::nullopt;
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
    // As many samples as the preview says; each inserted one is a record and the number of its root.
    const std::uint64_t inserted = inserted_by_preview();
    const std::uint64_t all = (1 + outputs_.size()) * sizeof(TileSample) * records_.count +
                              outputs_.size() * inserted * (sizeof(std::uint64_t) + records_.record_bytes);
    // What is packed is about as long as its records.
    const std::uint64_t cloud = file_.bytes().size() + inserted * records_.record_bytes;
    const std::uint64_t output = outputs_.size() * cloud;
    const std::uint64_t packing =
        is_packed_afterwards_
            ? output + cloud + packing_bytes(records_.count + inserted, records_.record_bytes)
            : 0;
    const std::uint64_t scratch = all - std::min(all, kept) + packing;
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

  /// Samples that the scan will have more, as far as the preview tells.
  [[nodiscard]] std::uint64_t inserted_by_preview() const {
    double most = 0.0;
    for (const PlayedSteps::Step& step : played_.steps) {
      double more = 0.0;
      for (const std::uint32_t family : step.families)
        more += std::max(0.0, static_cast<double>(family) - 1.0);
      most = std::max(most, more);
    }
    return static_cast<std::uint64_t>(most / static_cast<double>(preview_->size()) *
                                      static_cast<double>(records_.count));
  }

  std::optional<Problem> play() {
    progress_("preview", 0.05);
    preview_ = params_.preview;
    if (preview_ == nullptr) {
      auto made = preview_of(candidates_, params_.preview_count, context_);
      if (!made) return protocol::to_problem(made.error());
      preview_ = std::move(made).value();
    }
    if (params_.preview != nullptr)
      if (auto elsewhere = check_preview(*preview_, surveyed_.min, surveyed_.max)) return elsewhere;
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
    resamples_ = resamples(played_);
    // Numbers that are mixed stand in columns, thrice while they are; records of inserted samples twice.
    std::uint64_t values = 2 * records_.record_bytes;
    for (const ScanRecords::Place& place : records_.mixed())
      values += 3 * std::max(sizeof(float), size_of(place.type));
    auto plan = plan_tiles(played_, records_.count + inserted_by_preview(), params_.neighbors, values,
                           params_.memory_bytes);
    if (!plan.ok()) return plan.problem();
    plan_ = plan.value();
    // The same two samples have the same order in every tile: of two in one place one is collected.
    const Vec3d& origin = script.origin;
    if (resamples_)
      scan_box_ = Box3f{.min = Vec3d(surveyed_.min - origin).cast<float>(),
                        .max = Vec3d(surveyed_.max - origin).cast<float>()};
    return std::nullopt;
  }

  /// What a folder's files belong to.
  [[nodiscard]] std::string identity() const {
    Digest hash(Digest::Algorithm::kSha256);
    const auto add = [&](const void* data, std::size_t size) {
      hash.add(std::span(static_cast<const std::byte*>(data), size));
    };
    const auto add_points = [&](const Points& points) {
      for (const float* column : {points.x(), points.y(), points.z()})
        add(column, points.size() * sizeof(float));
    };
    const std::array<std::uint64_t, 5> numbers{records_.count, plan_.most, params_.neighbors, rings_,
                                               outputs_.size()};
    add(numbers.data(), sizeof numbers);
    add(&TileStore::kLayout, sizeof TileStore::kLayout);
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
        if (const auto& resampling = edit.params.resampling) {
          const std::array<double, 3> lengths{resampling->bound, resampling->min_spacing,
                                              resampling->collect};
          const std::array<std::uint32_t, 3> counts{resampling->sweeps, resampling->max_samples,
                                                    resampling->shear_aware ? 1U : 0U};
          add(lengths.data(), sizeof lengths);
          add(counts.data(), sizeof counts);
        }
      }
    }
    return to_hex(hash.finish());
  }

  std::optional<Problem> sort() {
    progress_("tiles", 0.1);
    const double share = static_cast<double>(candidates_.size()) / static_cast<double>(records_.count);
    const auto most_candidates =
        static_cast<std::size_t>(std::max(1.0, share * static_cast<double>(plan_.most)));
    store_.emplace(params_.folder,
                   TileCuts(weighted_candidates(candidates_, played_, plan_, context_), most_candidates,
                            most_candidates / kCellsOfTile),
                   played_.script.origin);
    candidates_ = {};
    report_.tiles = store_->tile_count();

    const std::string marker = params_.folder + "/job.id";
    const std::string id = identity();
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
    TileStore::clear(params_.folder);
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
    // Lanes: what one of them reads, sorts and writes on its own, the other one's loops make up for.
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
        plan_.lanes,
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
    auto input = store_->load(tile, rings_, params_.neighbors, least_ring, records_.has_normals(), scan_box_);
    if (!input) return protocol::to_problem(input.error());
    const TileSource source{.file = file_, .records = records_};
    if (resamples_) take_record_values(source, input.value());
    auto rest = decompose_samples(played_.script, anchors, input.value().cloud, context_);
    if (!rest) return protocol::to_problem(rest.error());
    for (std::size_t step = 0; step < outputs_.size(); ++step) {
      const bool is_last = step + 1 == outputs_.size();
      std::vector<std::uint64_t> counts;
      auto made = made_edits(input.value(), played_.steps[step].edits,
                             is_last ? std::exchange(rest.value(), {}) : rest.value(), counts);
      if (!made) return protocol::to_problem(made.error());
      auto result = result_of(source, input.value(), made.value(), played_.rest, played_.steps[step].result);
      if (!result) return protocol::to_problem(result.error());
      result.value().counts = std::move(counts);
      if (auto put = store_->put_result(tile, step, result.value()); !put)
        return protocol::to_problem(put.error());
    }
    return std::nullopt;
  }

  static bool is_limited(const TransferredEdit& edit) {
    return edit.params.resampling && edit.params.resampling->max_samples > 0;
  }

  /// make_edits(), with TileResult::counts.
  [[nodiscard]] Result<TransferredSamples> made_edits(const TileInput& input,
                                                      std::span<const TransferredEdit> edits,
                                                      TransferredSamples samples,
                                                      std::vector<std::uint64_t>& counts) const {
    while (true) {
      const auto limited = std::ranges::find_if(edits, is_limited);
      const auto now = static_cast<std::size_t>(limited - edits.begin()) + (limited == edits.end() ? 0U : 1U);
      auto made = make_edits(played_.script, edits.first(now), std::move(samples), context_);
      if (!made || limited == edits.end()) return made;
      counts.push_back(own_count(input, *made.value().sampling));
      edits = edits.subspan(now);
      samples = std::move(made).value();
    }
  }

  /// Whether the whole scan keeps to the limits of its edits. `counts`: summed over all tiles.
  [[nodiscard]] std::optional<Problem> check_limits(std::size_t step,
                                                    const std::vector<std::uint64_t>& counts) const {
    std::size_t k = 0;
    for (const TransferredEdit& edit : played_.steps[step].edits) {
      if (!is_limited(edit) || k == counts.size()) continue;
      const std::uint64_t count = counts[k++];
      if (count <= edit.params.resampling->max_samples) continue;
      return Problem{.kind = ProblemKind::kTooManySamples,
                     .detail = "an edit would leave more samples than its resampling.max_samples",
                     .limit = static_cast<double>(edit.params.resampling->max_samples),
                     .actual = static_cast<double>(count)};
    }
    return std::nullopt;
  }

  std::optional<Problem> write() {
    for (std::size_t step = 0; step < outputs_.size(); ++step)
      if (auto problem = write(step)) return problem;
    return std::nullopt;
  }

  std::optional<Problem> write(std::size_t step) {
    progress_result(step, 0.0);
    std::vector<MadeTile> tiles;
    std::vector<PreviewMatch> best(played_.rest.size(), {.rest_distance = std::numeric_limits<float>::max()});
    // One of them may see less of a shared disk than the others.
    if (auto any = team_.agree(open_results(step, tiles, best))) return any;
    DifferenceSum differences;  // the last step's stay
    for (const PreviewMatch& match : best)
      if (static_cast<double>(match.rest_distance) <= report_.spacing)
        differences.add(static_cast<double>(match.difference));
    differences.report(report_);

    is_changed_.push_back(report_.moved + report_.inserted + report_.removed > 0);
    ResultWriter writer(file_, records_, team_, played_.script.origin, context_,
                        [&](double part) { progress_result(step, part); });
    return writer.write(outputs_[step], tiles);
  }

  /// Opens what became of the step's tiles, and adds it up.
  std::optional<Problem> open_results(std::size_t step, std::vector<MadeTile>& tiles,
                                      std::vector<PreviewMatch>& best) {
    report_.moved = report_.inserted = report_.removed = 0;
    std::vector<std::uint64_t> counts;
    for (std::size_t tile = 0; tile < store_->tile_count(); ++tile) {
      if (store_->sample_count(tile) == 0) continue;
      const std::string path = store_->result_path(tile, step);
      auto file = MappedFile::open(path);
      if (!file) return protocol::to_problem(file.error());
      const auto view = view_result(file.value().bytes());
      if (!view || !is_of_scan(view.value())) {
        // Made again by the job that goes on.
        std::error_code none;
        std::filesystem::remove(path, none);
        return Problem{.kind = ProblemKind::kInternalError,
                       .detail = "the result of tile " + std::to_string(tile + 1) + " is damaged"};
      }
      counts.resize(std::max(counts.size(), view.value().counts.size()));
      for (std::size_t k = 0; k < view.value().counts.size(); ++k) counts[k] += view.value().counts[k];
      report_.moved += view.value().moved.size();
      report_.inserted += view.value().roots.size();
      report_.removed += view.value().removed.size();
      for (const PreviewMatch& match : view.value().matches)
        if (match.anchor < best.size() && match.rest_distance < best[match.anchor].rest_distance)
          best[match.anchor] = match;
      file.value().release(0, file.value().bytes().size());
      tiles.push_back({.file = std::move(file).value(), .result = view.value()});
    }
    return check_limits(step, counts);
  }

  /// Whether a result speaks of the scan's samples and of records as long as its own.
  [[nodiscard]] bool is_of_scan(const TileResultView& view) const {
    const auto is_sample = [&](std::uint64_t index) { return index < records_.count; };
    return view.records.size() == view.roots.size() * records_.record_bytes &&
           (view.moved.empty() || is_sample(view.moved.back().index)) &&
           (view.removed.empty() || is_sample(view.removed.back())) &&
           (view.roots.empty() || is_sample(view.roots.back()));
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
  const bool is_packed_afterwards_;
  PlayedSteps played_;
  std::uint32_t rings_ = 1;
  TilePlan plan_;
  bool resamples_ = false;
  std::optional<Box3f> scan_box_;  // where tiles owe each other more than positions
  std::vector<bool> is_changed_;   // by step
  std::optional<TileStore> store_;
};

}  // namespace

Outcome<TiledResult> run_tiles(const JobParams& params, const TiledScan& scan, Team& team,
                               const ExecutionContext& context, const JobProgress& progress) {
  return TiledJob(params, scan, team, context, progress).run();
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

std::optional<Problem> check_preview(const Cloud& preview, const Vec3d& min, const Vec3d& max) {
  const Box3f box = bounds_of(preview.position);
  const Vec3d from = preview.origin + box.min.cast<double>();
  const Vec3d to = preview.origin + box.max.cast<double>();
  // Its file may have rounded what the scan's has not.
  constexpr double kOfCoordinates = 1e-6;
  constexpr double kOfExtent = 0.01;
  const double farthest = std::max(min.cwiseAbs().maxCoeff(), max.cwiseAbs().maxCoeff());
  const Vec3d room = Vec3d::Constant(kOfCoordinates * farthest + kOfExtent * (max - min).norm());
  if ((from.array() <= (max + room).array()).all() && (to.array() >= (min - room).array()).all())
    return std::nullopt;
  return Problem{.kind = ProblemKind::kInvalidValue,
                 .detail = "the preview stands elsewhere than the scan: it is of another one"};
}

Result<std::shared_ptr<const Cloud>> preview_of(const Cloud& cloud, std::uint64_t count,
                                                const ExecutionContext& context) {
  if (cloud.size() <= count) return std::shared_ptr<const Cloud>(std::make_shared<const Cloud>(cloud));
  auto chosen = subsample(cloud.position, cloud.normal, {.target = KeepCount{count}}, &context);
  if (!chosen) return chosen.error();
  return std::shared_ptr<const Cloud>(std::make_shared<const Cloud>(permuted(cloud, chosen.value())));
}

}  // namespace pointwright::server
