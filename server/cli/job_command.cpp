#include "server/cli/job_command.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <limits>
#include <string_view>
#include <utility>

#include "engine/core/parallel.h"
#include "protocol/json/documents.h"
#include "protocol/json/parse.h"
#include "server/cli/local_file.h"
#include "server/ingest/files.h"
#include "server/jobs/full_resolution.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kMostRecipeBytes = std::uint64_t{1} << 30U;
constexpr std::array<std::string_view, 3> kModeNames{"tiles", "memory", "direct"};

int refuse(std::ostream& err, const std::string& what, int status) {
  err << "pointwright: " << what << "\n";
  return status;
}

/// {"format": …} is a recipe, {"recipe": …} a request with one.
protocol::Parsed<protocol::RecipeRequest> parse_recipe_file(std::string_view text) {
  const protocol::ParseLimits limits{
      .max_bytes = kMostRecipeBytes, .max_depth = 32, .max_values = 50'000'000};
  auto document = protocol::parse_json(text, limits);
  if (!document.ok()) return document.errors();
  if (document.value().is_object() && document.value().contains("recipe"))
    return protocol::parse_recipe_request(document.value());
  protocol::Json request = protocol::Json::object();
  request["recipe"] = std::move(document).value();
  return protocol::parse_recipe_request(request);
}

/// A line that is written over and over, at most ten times a second.
class ProgressLine {
 public:
  ProgressLine(std::ostream& err, bool quiet) : err_(err), quiet_(quiet) {}
  void show(const std::string& phase, double fraction) {
    const auto now = std::chrono::steady_clock::now();
    if (quiet_ || (phase == phase_ && now - last_ < std::chrono::milliseconds(100))) return;
    last_ = now;
    phase_ = phase;
    const double elapsed = std::chrono::duration<double>(now - begin_).count();
    err_ << "\r\033[K" << std::setw(3) << static_cast<int>(100.0 * fraction) << " %  " << phase;
    if (fraction > 0.2 && fraction < 1.0)
      err_ << "  (" << static_cast<int>(std::ceil(elapsed * (1.0 - fraction) / fraction)) << " s left)";
    if (fraction >= 1.0) err_ << "\n";
    err_ << std::flush;
  }

 private:
  std::ostream& err_;
  const bool quiet_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point last_;
  std::string phase_;
};

/// This process's memory at its highest; 0 where the system does not say.
std::uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::uint64_t kibibytes = 0;
    if (word == "VmHWM:" && status >> kibibytes) return kibibytes << 10U;
  }
  return 0;
}

protocol::JsonDocument to_json(const JobReport& report, double seconds) {
  return {{"mode", kModeNames[static_cast<std::size_t>(report.mode)]},
          {"sample_count", report.samples},
          {"moved", report.moved},
          {"inserted", report.inserted},
          {"tiles", report.tiles},
          {"tiles_kept", report.tiles_kept},
          {"preview",
           {{"sample_count", report.preview_samples},
            {"matched", report.matched},
            {"rms_difference", report.rms_difference},
            {"max_difference", report.max_difference}}},
          {"spacing", report.spacing},
          {"files", report.files},
          {"seconds", seconds},
          {"peak_memory_bytes", peak_memory_bytes()}};
}

}  // namespace

CLI::App* add_job_run(CLI::App& group, JobRunOptions& options) {
  CLI::App* const command =
      group.add_subcommand("run", "make a recipe's edits on a scan at full resolution, here");
  command->add_option("--recipe", options.recipe, "a file with the edits: a session's recipe")->required();
  command->add_option("--in", options.input, "the scan: Draco, PLY, LAS, PCD, OBJ or XYZ")->required();
  command->add_option("--out", options.output, "the result: .ply, .las, .drc, .xyz, .txt or .asc")
      ->required();
  command->add_option("--preview", options.preview, "the cloud that the session edited; else one is made");
  command->add_option("--preview-count", options.preview_count, "samples of a preview that is made")
      ->check(CLI::Range(std::uint64_t{100}, std::uint64_t{20'000'000}))
      ->capture_default_str();
  command
      ->add_option(
          "--mode", options.mode,
          "tiles: bounded memory, binary PLY and LAS; memory: the whole scan at once; direct: on levels "
          "of its own; else tiles where that can be")
      ->check(CLI::IsMember({"tiles", "memory", "direct"}));
  command->add_option("--s", options.s,
                      "how far the edits are played, 0 to 1; 1 where the file does not say");
  command->add_option("--timing", options.timing, "the edits one after the other, or all at once")
      ->check(CLI::IsMember({"sequence", "together"}));
  command
      ->add_option("--steps", options.steps,
                   "an animation: so many clouds from s = 0 up to s, beside the result's name as "
                   "name_0001.ply, name_0002.ply and so on")
      ->check(CLI::Range(2U, kMaxJobSteps));
  command->add_option("--neighbors", options.neighbors, "of a sample's neighbourhood, 4 to 32")
      ->check(CLI::Range(4U, 32U))
      ->capture_default_str();
  command->add_option("--memory", options.memory_mebibytes, "MiB that tiles may take")
      ->check(CLI::Range(std::uint64_t{64}, std::uint64_t{1} << 24U))
      ->capture_default_str();
  command->add_option(
      "--work", options.work,
      "folder for scratch files, from which an interrupted job goes on; else beside the result");
  command->add_option("--threads", options.threads, "at most so many; 0: all")->check(CLI::Range(0, 1024));
  command->add_flag("--json", options.json, "the report as a JSON document");
  command->add_flag("--quiet", options.quiet, "no progress");
  return command;
}

int run_job(const JobRunOptions& options, std::ostream& out, std::ostream& err) {
  JobParams params;
  params.input = options.input;
  params.output = options.output;
  params.folder = options.work.empty() ? options.output + ".job" : options.work;
  params.preview_count = options.preview_count;
  params.neighbors = options.neighbors;
  params.memory_bytes = options.memory_mebibytes << 20U;
  if (!options.mode.empty()) {
    const auto mode = std::find(kModeNames.begin(), kModeNames.end(), options.mode);
    if (mode == kModeNames.end()) return refuse(err, "--mode is tiles, memory or direct", 2);
    params.mode = static_cast<JobMode>(mode - kModeNames.begin());
  }
  auto text = read_file(options.recipe, kMostRecipeBytes);
  if (!text) return refuse(err, options.recipe + ": " + text.error().message, 1);
  auto request = parse_recipe_file({reinterpret_cast<const char*>(text.value().data()), text.value().size()});
  if (!request.ok()) return refuse(err, options.recipe + ": " + request.errors().summary(), 1);
  params.request = std::move(request).value();
  if (options.s && !(*options.s >= 0.0 && *options.s <= 1.0))
    return refuse(err, "--s lies between 0 and 1", 2);
  params.request.s = options.s.value_or(params.request.s);
  if (!options.timing.empty())
    params.request.timing = options.timing == protocol::kTimingNames[1] ? protocol::Timing::kTogether
                                                                        : protocol::Timing::kSequence;
  if (!options.preview.empty()) {
    auto preview = read_local_cloud(options.preview, {}, std::numeric_limits<std::uint64_t>::max());
    if (!preview) return refuse(err, options.preview + ": " + preview.error().message, 1);
    params.preview = std::make_shared<const Cloud>(std::move(preview.value().cloud));
  }
  params.steps = options.steps;
  ProgressLine line(err, options.quiet || options.json);
  const auto begin = std::chrono::steady_clock::now();
  Outcome<JobReport> outcome = JobReport{};
  with_threads(options.threads, [&] {
    outcome = run_full_resolution(params, ExecutionContext(), [&](const std::string& phase, double fraction) {
      line.show(phase, fraction);
    });
  });
  if (!outcome.ok()) return refuse(err, outcome.problem().detail, 1);
  const JobReport& report = outcome.value();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (options.json) {
    out << protocol::to_text(to_json(report, seconds)) << "\n";
    return 0;
  }
  out << "samples     " << report.samples << ", of which " << report.moved << " moved";
  if (report.inserted > 0) out << ", and " << report.inserted << " were inserted";
  out << "\nmode        " << kModeNames[static_cast<std::size_t>(report.mode)];
  if (report.tiles > 0) out << ", " << report.tiles << " of them";
  if (report.tiles_kept > 0) out << " (" << report.tiles_kept << " were done already)";
  out << "\npreview     " << report.preview_samples << " samples; " << report.matched
      << " of them differ from the result by " << report.rms_difference << " rms, " << report.max_difference
      << " at most\nspacing     " << report.spacing << "\ntime        " << seconds << " s, "
      << (peak_memory_bytes() >> 20U) << " MiB at most\n";
  if (report.files.size() > 1)
    out << "files       " << report.files.size() << ", " << report.files.front() << " to "
        << report.files.back() << "\n";
  return 0;
}

}  // namespace pointwright::server
