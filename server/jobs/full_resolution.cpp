#include "server/jobs/full_resolution.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/moved_cloud.h"
#include "engine/io/cloud_io.h"
#include "engine/spatial/kd_tree.h"
#include "server/cli/local_file.h"
#include "server/ingest/files.h"
#include "server/jobs/packed_result.h"
#include "server/jobs/recipe_script.h"
#include "server/jobs/scan_source.h"
#include "server/jobs/scratch_folder.h"
#include "server/jobs/team.h"
#include "server/jobs/tiled_job.h"
#include "server/jobs/unpacked_scan.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::ProblemKind;

/// What the edits made of a cloud, whichever way.
struct Edited {
  std::shared_ptr<const Sampling> sampling;
  Level finest;
};

/// The cloud as edited, in its own order; normals only where it had them.
Cloud edited_cloud(const Cloud& cloud, const Edited& edited) {
  Cloud result = moved_cloud(*edited.sampling->cloud, edited.finest.position, edited.finest.normal);
  if (!cloud.has_normals()) result.normal = Points();
  return result;
}

class MemoryJob {
 public:
  MemoryJob(const JobParams& params, JobMode mode, const ExecutionContext& context,
            const JobProgress& progress)
      : params_(params), context_(context), progress_(progress) {
    report_.mode = mode;
  }

  Outcome<JobReport> run() {
    const auto format = format_of_name(params_.output);
    if (!format) return protocol::to_problem(format.error());
    progress_("reading", 0.0);
    auto imported = read_scan(params_);
    if (!imported) return protocol::to_problem(imported.error());
    const std::optional<PositionGrid> grid = imported.value().report.grid;
    const auto cloud = std::make_shared<const Cloud>(std::move(imported.value().cloud));
    report_.samples = cloud->size();
    progress_("preview", 0.1);
    auto preview = params_.preview;
    if (preview == nullptr) {
      auto made = preview_of(*cloud, params_.preview_count, context_);
      if (!made) return protocol::to_problem(made.error());
      preview = std::move(made).value();
    }
    const ImportReport& found = imported.value().report;
    if (params_.preview != nullptr)
      if (auto elsewhere = check_preview(*preview, found.bounds_min, found.bounds_max)) return *elsewhere;
    report_.preview_samples = preview->size();
    const auto levels = hierarchy_for(params_.request.recipe, *preview, params_.neighbors);
    if (!levels.ok()) return levels.problem();
    auto outcome = play_steps_on_preview(params_.request, params_.steps.value_or(1),
                                         about(preview, cloud->origin), levels.value(), context_);
    if (!outcome.ok()) return outcome.problem();
    PlayedSteps& played = outcome.value();
    played.script.spacing_ratio = static_cast<float>(
        std::min(1.0, std::sqrt(static_cast<double>(preview->size()) / static_cast<double>(cloud->size()))));
    report_.spacing = static_cast<double>(played.script.bases.spacing * played.script.spacing_ratio);
    if (auto made = edit(cloud, played, {.grid = grid}, format.value()); !made)
      return protocol::to_problem(made.error());
    progress_("done", 1.0);
    return report_;
  }

 private:
  /// The preview about another origin.
  static std::shared_ptr<const Cloud> about(std::shared_ptr<const Cloud> preview, const Vec3d& origin) {
    if (preview->origin == origin) return preview;
    auto moved = std::make_shared<Cloud>(*preview);
    for (std::size_t i = 0; i < moved->size(); ++i)
      moved->position.set(i, Vec3d(model_position(*preview, i) - origin).cast<float>());
    moved->origin = origin;
    moved->exact_position.clear();
    return moved;
  }

  Result<void> edit(const std::shared_ptr<const Cloud>& cloud, PlayedSteps& played,
                    const ExportParams& params, CloudFormat format) {
    progress_("edits", 0.3);
    if (report_.mode == JobMode::kDirect) {
      played.script.edits = played.steps.back().edits;
      // Its own levels at the recipe's scales, which are lengths: whatever part of it the preview shows.
      const auto own = hierarchy_for(params_.request.recipe, *cloud, params_.neighbors);
      if (!own.ok())
        return Error{.code = ErrorCode::kInvalidArgument, .message = own.problem().detail, .field = {}};
      auto state = edit_directly(played.script, cloud, own.value(), context_);
      if (!state) return state.error();
      const Edited edited{.sampling = state.value().samples->sampling,
                          .finest = state.value().surface->finest()};
      measure(*cloud, edited, played);
      return write(*cloud, edited, params, format, params_.output);
    }
    const AnchorIndex anchors(played.script.rest);
    auto rest = decompose_samples(played.script, anchors, cloud, context_);
    if (!rest) return rest.error();
    const std::vector<std::string> outputs = outputs_of(params_);
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      progress_("edits", 0.3 + 0.7 * static_cast<double>(k) / static_cast<double>(outputs.size()));
      const bool is_last = k + 1 == outputs.size();
      auto made = make_edits(played.script, played.steps[k].edits,
                             is_last ? std::exchange(rest.value(), {}) : rest.value(), context_);
      if (!made) return made.error();
      const Edited edited{.sampling = std::move(made.value().sampling),
                          .finest = std::move(made.value().surface.levels.back())};
      if (is_last) measure(*cloud, edited, played);
      if (auto written = write(*cloud, edited, params, format, outputs[k]); !written) return written.error();
    }
    return {};
  }

  Result<void> write(const Cloud& cloud, const Edited& edited, const ExportParams& params, CloudFormat format,
                     const std::string& output) {
    auto bytes = write_cloud(edited_cloud(cloud, edited), format, params);
    if (!bytes) return bytes.error();
    if (auto written = write_file_atomically(output, bytes.value()); !written) return written.error();
    report_.files.push_back(output);
    return {};
  }

  /// Samples that moved and that were inserted; how far the preview's came apart from the same ones here.
  void measure(const Cloud& cloud, const Edited& edited, const PlayedSteps& played) {
    const Points& result = played.steps.back().result;
    const std::vector<std::uint32_t>& ids = edited.sampling->cloud->id;
    // What was there before comes first, in its order; what was collected is missing.
    std::vector<std::uint32_t> place(cloud.size(), kNoParent);
    const std::size_t uploaded = edited.sampling->next_id;
    std::vector<std::uint32_t> by_id(uploaded, kNoParent);
    for (std::size_t i = 0; i < ids.size(); ++i) by_id[ids[i]] = static_cast<std::uint32_t>(i);
    for (std::size_t i = 0; i < cloud.size(); ++i) place[i] = by_id[cloud.id[i]];
    report_.removed = static_cast<std::uint64_t>(std::ranges::count(place, kNoParent));
    report_.inserted = ids.size() + report_.removed - cloud.size();
    for (std::size_t i = 0; i < cloud.size(); ++i)
      if (place[i] != kNoParent && edited.finest.position[place[i]] != cloud.position[i]) ++report_.moved;
    const KdTree tree(cloud.position);
    DifferenceSum differences;
    std::vector<Neighbor> found;
    for (std::size_t a = 0; a < played.rest.size(); ++a) {
      tree.nearest(played.rest[a], 1, found);
      const std::uint32_t i = found.front().index;
      if (place[i] == kNoParent ||
          std::sqrt(static_cast<double>(found.front().distance_sq)) > report_.spacing)
        continue;
      if (!result[a].allFinite()) continue;
      const Vec3f here = edited.finest.position[place[i]] - cloud.position[i];
      differences.add(static_cast<double>((here - (result[a] - played.rest[a])).norm()));
    }
    differences.report(report_);
  }

  const JobParams& params_;
  const ExecutionContext& context_;
  const JobProgress& progress_;
  JobReport report_;
};

/// Tiles, and what comes before and after them where the scan is no records or the result shall be none.
class TileRun {
 public:
  TileRun(const JobParams& params, ChosenMode chosen, Team& team, const ExecutionContext& context,
          const JobProgress& progress)
      : params_(params), chosen_(std::move(chosen)), team_(team), context_(context), progress_(progress) {}

  Outcome<JobReport> run() {
    if (auto problem = folder_.take(params_.folder, team_)) return *problem;
    if (team_.leads())
      for (const std::string& output : outputs_of(params_)) remove_leftovers(output);
    if (auto problem = work()) {
      // Made anew by the job that goes on; what tiles there are stay for it.
      if (team_.leads()) folder_.drop_scan();
      return *problem;
    }
    if (team_.leads()) folder_.remove();
    progress_("done", 1.0);
    return report_;
  }

 private:
  // Where in a job's progress the one ends and the other begins.
  static constexpr double kUnpacking = 0.1;
  static constexpr double kPacking = 0.85;

  std::optional<Problem> work() {
    if (auto problem = unpack()) return problem;
    auto made = run_tiles(
        params_,
        {.file = *scan_,
         .records = *records_,
         .outputs = made_files(),
         .is_packed_afterwards = chosen_.packs},
        team_, context_, part_of_progress(chosen_.packed ? kUnpacking : 0.0, chosen_.packs ? kPacking : 1.0));
    if (!made.ok()) return made.problem();
    report_ = std::move(made.value().report);
    report_.files = outputs_of(params_);
    return finish(made.value().is_changed);
  }

  [[nodiscard]] JobProgress part_of_progress(double begin, double end) const {
    return [this, begin, end](const std::string& phase, double fraction) {
      progress_(phase, begin + (end - begin) * fraction);
    };
  }

  std::optional<Problem> unpack() {
    if (!chosen_.packed) {
      scan_ = &*chosen_.file;
      records_ = &*chosen_.records;
      return std::nullopt;
    }
    const std::string path = params_.folder + "/" + ScratchFolder::kScanName;
    if (auto problem = unpack_scan(params_, *chosen_.file, *chosen_.packed, path, team_, context_,
                                   part_of_progress(0.0, kUnpacking)))
      return problem;
    auto file = MappedFile::open(path);
    auto records =
        file ? ScanRecords::of(file.value().bytes()) : Result<std::optional<ScanRecords>>(file.error());
    std::optional<Problem> problem;
    if (!records)
      problem = protocol::to_problem(records.error());
    else if (!records.value())
      problem = Problem{.kind = ProblemKind::kInternalError, .detail = "the unpacked scan is no records"};
    if (auto any = team_.agree(problem)) return any;
    unpacked_file_ = std::move(file).value();
    unpacked_records_ = std::move(records).value();
    scan_ = &*unpacked_file_;
    records_ = &*unpacked_records_;
    return std::nullopt;
  }

  /// What the tiles write: the outputs, or what becomes these.
  [[nodiscard]] std::vector<std::string> made_files() const {
    if (!chosen_.packs) return outputs_of(params_);
    JobParams made = params_;
    made.output = params_.folder + "/" + ScratchFolder::kEditedName;
    return outputs_of(made);
  }

  std::optional<Problem> finish(const std::vector<bool>& is_changed) {
    const std::vector<std::string> made = made_files();
    // A recipe without effect gives the scan's own bytes, where they are of the format.
    const bool keeps = chosen_.packed && (chosen_.packed->packing == Packing::kDracoTiles) == chosen_.packs;
    for (std::size_t k = 0; k < made.size(); ++k) {
      const std::string& output = report_.files[k];
      std::optional<Problem> problem;
      if (keeps && !is_changed[k])
        problem = team_.agree(team_.leads() ? copy_scan(output) : std::nullopt);
      else if (chosen_.packs)
        problem = pack_result(made[k], output, params_.folder + "/" + ScratchFolder::kPackedFolder,
                              params_.memory_bytes, team_, context_, part_of_progress(kPacking, 1.0));
      if (problem) return problem;
      std::error_code none;
      if (chosen_.packs && team_.leads()) std::filesystem::remove(made[k], none);
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<Problem> copy_scan(const std::string& output) const {
    const auto copied = write_file_atomically(output, chosen_.file->bytes());
    return copied ? std::nullopt : std::optional(protocol::to_problem(copied.error()));
  }

  const JobParams& params_;
  const ChosenMode chosen_;
  Team& team_;
  const ExecutionContext& context_;
  const JobProgress& progress_;
  ScratchFolder folder_;
  std::optional<MappedFile> unpacked_file_;
  std::optional<ScanRecords> unpacked_records_;
  const MappedFile* scan_ = nullptr;
  const ScanRecords* records_ = nullptr;
  JobReport report_;
};

}  // namespace

std::vector<std::string> outputs_of(const JobParams& params) {
  if (!params.steps) return {params.output};
  const std::filesystem::path output(params.output);
  std::vector<std::string> names;
  for (std::uint32_t k = 1; k <= *params.steps; ++k) {
    std::string number = std::to_string(k);
    number.insert(0, 4 - std::min<std::size_t>(4, number.size()), '0');
    std::filesystem::path name = output;
    name.replace_filename(output.stem().string() + "_" + number + output.extension().string());
    names.push_back(name.string());
  }
  return names;
}

Outcome<JobReport> run_full_resolution(const JobParams& params, const ExecutionContext& context,
                                       const JobProgress& progress) {
  const std::unique_ptr<Team> alone = lone_team();
  Team& team = params.team == nullptr ? *alone : *params.team;
  auto chosen = choose_mode(params);
  if (auto problem = team.agree(chosen.ok() ? std::nullopt : std::optional(chosen.problem())))
    return *problem;
  if (chosen.value().mode == JobMode::kTiles)
    return TileRun(params, std::move(chosen.value()), team, context, progress).run();
  Outcome<JobReport> outcome = JobReport();
  if (team.leads()) outcome = MemoryJob(params, chosen.value().mode, context, progress).run();
  if (auto problem = team.agree(outcome.ok() ? std::nullopt : std::optional(outcome.problem())))
    return *problem;
  return outcome;
}

}  // namespace pointwright::server
