#include "server/cli/job_command.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <exception>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <limits>
#include <new>
#include <string_view>
#include <utility>

#include "engine/core/parallel.h"
#include "protocol/json/documents.h"
#include "protocol/json/jobs.h"
#include "protocol/json/parse.h"
#include "server/cli/local_file.h"
#include "server/ingest/files.h"
#include "server/ingest/sandbox.h"
#include "server/jobs/full_resolution.h"
#include "server/jobs/team.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

constexpr std::uint64_t kMostRecipeBytes = std::uint64_t{1} << 30U;
constexpr auto& kModeNames = protocol::kJobModeNames;  // in the order of JobMode

/// Says why the job cannot be done; for events as a document, too.
class Refusal {
 public:
  Refusal(std::ostream& out, std::ostream& err, bool events) : out_(out), err_(err), events_(events) {}
  int operator()(const Problem& problem, int status) const {
    err_ << "pointwright: " << problem.detail << "\n";
    if (events_) out_ << protocol::to_text({{"problem", protocol::to_json(problem)}}) << std::endl;
    return status;
  }

 private:
  std::ostream& out_;
  std::ostream& err_;
  const bool events_;
};

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

enum class Telling { kNothing, kLine, kEvents };

/// A line that is written over and over, or one event after the other, at most ten times a second.
class PhaseTeller {
 public:
  PhaseTeller(std::ostream& err, Telling telling) : err_(err), telling_(telling) {}
  void show(const std::string& phase, double fraction) {
    const auto now = std::chrono::steady_clock::now();
    if (telling_ == Telling::kNothing || (phase == phase_ && now - last_ < std::chrono::milliseconds(100)))
      return;
    last_ = now;
    phase_ = phase;
    if (telling_ == Telling::kEvents) {
      err_ << protocol::to_text({{"phase", phase}, {"fraction", fraction}}) << std::endl;
      return;
    }
    const double elapsed = std::chrono::duration<double>(now - begin_).count();
    err_ << "\r\033[K" << std::setw(3) << static_cast<int>(100.0 * fraction) << " %  " << phase;
    if (fraction > 0.2 && fraction < 1.0)
      err_ << "  (" << static_cast<int>(std::ceil(elapsed * (1.0 - fraction) / fraction)) << " s left)";
    if (fraction >= 1.0) err_ << "\n";
    err_ << std::flush;
  }

 private:
  std::ostream& err_;
  const Telling telling_;
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
          {"removed", report.removed},
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

protocol::JsonDocument to_json(const JobEstimate& estimate) {
  return {{"mode", kModeNames[static_cast<std::size_t>(estimate.mode)]},
          {"sample_count", estimate.samples},
          {"memory_bytes", estimate.memory_bytes},
          {"disk_bytes", estimate.disk_bytes},
          {"free_disk_bytes", estimate.free_disk_bytes},
          {"seconds", estimate.seconds}};
}

/// More memory than that is refused: it is then told of, where the system would just end the process.
void bound_memory(std::uint64_t bytes) {
  const rlimit limit{.rlim_cur = bytes, .rlim_max = bytes};
  if (bytes > 0 && !kSanitizedBuild) static_cast<void>(::setrlimit(RLIMIT_DATA, &limit));
}

/// Runs work() -> Outcome<T> with so many threads; memory that is not there is a problem like others.
template <typename Work>
auto with_memory(int threads, Work work) -> decltype(work()) {
  decltype(work()) outcome = protocol::Problem{.kind = protocol::ProblemKind::kOutOfSpace,
                                               .detail =
                                                   "there is not enough memory for this job: in tiles, of "
                                                   "files that can be cut, it keeps to --memory"};
  try {
    with_threads(threads, [&] { outcome = work(); });
  } catch (const std::bad_alloc&) {
  } catch (const std::exception& error) {
    outcome = Problem{.kind = ProblemKind::kInternalError, .detail = error.what()};
  }
  return outcome;
}

void tell(std::ostream& out, const JobEstimate& estimate) {
  constexpr double kMebi = 1024.0 * 1024.0;
  out << "samples     " << estimate.samples << "\nmode        "
      << kModeNames[static_cast<std::size_t>(estimate.mode)] << "\nmemory      "
      << static_cast<double>(estimate.memory_bytes) / kMebi << " MiB\ndisk        "
      << static_cast<double>(estimate.disk_bytes) / kMebi << " MiB, of "
      << static_cast<double>(estimate.free_disk_bytes) / kMebi << " MiB that are free\ntime        about "
      << estimate.seconds << " s\n";
}

/// The job that the options ask for.
Outcome<JobParams> params_of(const JobRunOptions& options) {
  const auto wrong = [](std::string what) {
    return Problem{.kind = ProblemKind::kInvalidValue, .detail = std::move(what)};
  };
  JobParams params;
  params.input = options.input;
  params.output = options.output;
  params.folder = options.work.empty() ? options.output + ".job" : options.work;
  params.preview_count = options.preview_count;
  params.neighbors = options.neighbors;
  params.memory_bytes = options.memory_mebibytes << 20U;
  params.steps = options.steps;
  params.confined = options.confined;
  params.most_bytes = options.most_mebibytes << 20U;
  params.drop_non_finite = options.drop_non_finite;
  if (const auto mode = std::find(kModeNames.begin(), kModeNames.end(), options.mode);
      mode != kModeNames.end())
    params.mode = static_cast<JobMode>(mode - kModeNames.begin());
  auto text = read_file(options.recipe, kMostRecipeBytes);
  if (!text) return wrong(options.recipe + ": " + text.error().message);
  auto request = parse_recipe_file({reinterpret_cast<const char*>(text.value().data()), text.value().size()});
  if (!request.ok()) return wrong(options.recipe + ": " + request.errors().summary());
  params.request = std::move(request).value();
  params.request.s = options.s.value_or(params.request.s);
  if (!(params.request.s >= 0.0 && params.request.s <= 1.0)) return wrong("--s lies between 0 and 1");
  if (!options.timing.empty())
    params.request.timing = options.timing == protocol::kTimingNames[1] ? protocol::Timing::kTogether
                                                                        : protocol::Timing::kSequence;
  if (!options.preview.empty()) {
    auto preview = read_local_cloud(options.preview, {}, std::numeric_limits<std::uint64_t>::max());
    if (!preview) return wrong(options.preview + ": " + preview.error().message);
    params.preview = std::make_shared<const Cloud>(std::move(preview.value().cloud));
  }
  return params;
}

void tell(std::ostream& out, const JobReport& report, double seconds) {
  out << "samples     " << report.samples << ", of which " << report.moved << " moved";
  if (report.inserted > 0) out << ", " << report.inserted << " were inserted";
  if (report.removed > 0) out << ", " << report.removed << " were removed";
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
}

void tell_as(const JobRunOptions& options, std::ostream& out, const char* name,
             const protocol::JsonDocument& document) {
  if (options.events)
    out << protocol::to_text({{name, document}}) << std::endl;
  else
    out << protocol::to_text(document) << "\n";
}

}  // namespace

CLI::App* add_job_run(CLI::App& group, JobRunOptions& options) {
  CLI::App* const command =
      group.add_subcommand("run", "make a recipe's edits on a scan at full resolution, here");
  command->add_option("--recipe", options.recipe, "a file with the edits: a session's recipe")->required();
  command->add_option("--in", options.input, "the scan: Draco, Draco tiles, PLY, LAS, PCD, OBJ or XYZ")
      ->required();
  command
      ->add_option("--out", options.output,
                   "the result: .ply, .las, .drc, .zip (Draco tiles), .xyz, .txt or .asc")
      ->required();
  command->add_option("--preview", options.preview, "the cloud that the session edited; else one is made");
  command->add_option("--preview-count", options.preview_count, "samples of a preview that is made")
      ->check(CLI::Range(std::uint64_t{100}, std::uint64_t{20'000'000}))
      ->capture_default_str();
  command
      ->add_option("--mode", options.mode,
                   "tiles: bounded memory, PLY, LAS and Draco tiles; memory: the whole scan at once; direct: "
                   "on levels "
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
      ->check(CLI::Range(std::uint64_t{2}, protocol::kMostSteps));
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
  command->add_flag("--dry-run", options.dry_run, "say what it would take, and do nothing");
  command->add_option("--most-memory", options.most_mebibytes, "MiB beyond which memory is refused; 0: none")
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1} << 30U));
  command->add_flag("--drop-non-finite", options.drop_non_finite,
                    "leave out samples that are not finite; not in tiles");
  command->add_flag("--confined", options.confined, "decode the scan in a process that may do nothing else");
  command->add_flag("--events", options.events,
                    "JSON documents, one a line: progress, and in the end the report or the problem");
  command->add_flag("--json", options.json, "the report as a JSON document");
  command->add_flag("--quiet", options.quiet, "no progress");
  return command;
}

int run_job(const JobRunOptions& options, std::ostream& out, std::ostream& err, Team* team) {
  std::ostream nowhere(nullptr);
  const bool leads = team == nullptr || team->leads();
  const Refusal refuse(leads ? out : nowhere, leads ? err : nowhere, options.events);
  bound_memory(options.most_mebibytes << 20U);
  auto params = params_of(options);
  if (!params.ok()) {
    // Said by every one: the others may have read what this one cannot.
    Refusal(out, err, options.events)(params.problem(), 1);
    if (team != nullptr) team->abandon();
    return 1;
  }
  params.value().team = team;
  if (options.dry_run) {
    if (!leads) return 0;
    const auto estimate = with_memory(
        options.threads, [&] { return estimate_full_resolution(params.value(), ExecutionContext()); });
    if (!estimate.ok()) return refuse(estimate.problem(), 1);
    if (options.events || options.json)
      tell_as(options, out, "estimate", to_json(estimate.value()));
    else
      tell(out, estimate.value());
    return 0;
  }
  const bool is_silent = options.quiet || options.json || !leads;
  PhaseTeller line(options.events ? out : err, is_silent        ? Telling::kNothing
                                               : options.events ? Telling::kEvents
                                                                : Telling::kLine);
  const auto begin = std::chrono::steady_clock::now();
  const auto outcome = with_memory(options.threads, [&] {
    return run_full_resolution(
        params.value(), ExecutionContext(),
        [&](const std::string& phase, double fraction) { line.show(phase, fraction); });
  });
  const bool is_lone = !outcome.ok() && (outcome.problem().kind == ProblemKind::kOutOfSpace ||
                                         outcome.problem().kind == ProblemKind::kInternalError);
  if (is_lone && team != nullptr) {
    Refusal(out, err, options.events)(outcome.problem(), 1);  // the others know nothing of it
    team->abandon();
  }
  if (!outcome.ok()) return refuse(outcome.problem(), 1);
  if (!leads) return 0;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (options.events || options.json)
    tell_as(options, out, "report", to_json(outcome.value(), seconds));
  else
    tell(out, outcome.value(), seconds);
  return 0;
}

}  // namespace pointwright::server
