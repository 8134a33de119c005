#pragma once
// Jobs: edits at full resolution, as clients ask for them and as the server tells of them. Names and states
// are those of OGC API - Processes.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/io/cloud_io.h"
#include "protocol/json/documents.h"
#include "protocol/json/parse.h"
#include "protocol/json/problem.h"
#include "protocol/json/recipe.h"

namespace pointwright::protocol {

enum class JobStatus { kAccepted, kRunning, kSuccessful, kFailed, kDismissed };
/// In the order of the enumeration.
inline constexpr std::array<std::string_view, 5> kJobStatusNames = {"accepted", "running", "successful",
                                                                    "failed", "dismissed"};
/// tiles: bounded memory; memory: the whole scan at once; direct: on levels of its own.
inline constexpr std::array<std::string_view, 3> kJobModeNames = {"tiles", "memory", "direct"};
inline constexpr std::array kJobFormats = {CloudFormat::kPly, CloudFormat::kLas, CloudFormat::kDraco,
                                           CloudFormat::kXyz, CloudFormat::kDracoTiles};
inline constexpr std::uint64_t kHighestPriority = 9;
inline constexpr std::uint64_t kUsualPriority = 5;
inline constexpr std::uint64_t kMostSteps = 1000;        ///< of an animation
inline constexpr std::uint64_t kUsualPreview = 100'000;  ///< samples of a preview that a job makes itself
inline constexpr std::string_view kLocalLauncher = "local";

/// What a job does, apart from the recipe itself.
struct JobTerms {
  std::string name = {};
  std::string session = {};  ///< whose edits; empty: a recipe's
  std::string cloud = {};    ///< the scan; empty: an upload
  std::string upload = {};   ///< the scan: a resumable upload that is complete, as it came
  /// What the recipe is played on: that cloud; or, where there is neither it nor a session, so many of the
  /// scan's samples.
  std::string preview_cloud = {};
  std::uint64_t preview_count = kUsualPreview;
  std::uint32_t neighbors = 10;
  double s = 1.0;
  Timing timing = Timing::kSequence;
  std::optional<CloudFormat> format = std::nullopt;  ///< of the result; none: the scan's, or PLY
  std::uint64_t steps = 0;                           ///< clouds of an animation from s = 0 on; 0: one cloud
  std::string mode = {};                             ///< of kJobModeNames; empty: tiles where that can be
  std::string launcher = std::string(kLocalLauncher);
  std::uint64_t priority = kUsualPriority;
};

/// POST /v1/jobs
struct JobRequest {
  JobTerms terms;
  RecipeRequest recipe;     ///< where no session has the edits
  std::string recipe_text;  ///< the same as it came: {"recipe": …, "s": …, "timing": …}
  bool validate = false;    ///< say what it would take, and do nothing
};

/// A file that a job made.
struct JobResult {
  std::string name;
  std::string media_type;
  std::uint64_t bytes = 0;
  std::string sha256;
};

/// A job, as it is told of.
struct JobDocument {
  std::string id;
  JobTerms terms;
  JobStatus status = JobStatus::kAccepted;
  std::string message;
  Progress progress;
  std::optional<double> eta_s = std::nullopt;
  std::uint64_t queue_place = 0;  ///< 1: the next; 0: it does not wait
  std::uint64_t attempts = 0;     ///< how often a worker was started for it
  TimePoint created;
  TimePoint updated;
  std::optional<TimePoint> started = std::nullopt;
  std::optional<TimePoint> finished = std::nullopt;
  JsonDocument report = nullptr;  ///< the worker's, once it was successful
  std::optional<Problem> problem = std::nullopt;
  std::vector<JobResult> results = {};

  [[nodiscard]] bool has_ended() const {
    return status != JobStatus::kAccepted && status != JobStatus::kRunning;
  }
};

std::string_view job_status_name(JobStatus status);

Parsed<JobRequest> parse_job_request(const Json& document);
/// The terms as they are kept, and back. Throws what the JSON library throws where the document is not of
/// ours.
JsonDocument to_json(const JobTerms& terms);
JobTerms job_terms(const Json& document);

/// statusInfo, with more.
JsonDocument to_json(const JobDocument& job);
/// {"jobs", "links"}
JsonDocument job_list(const std::vector<JobDocument>& jobs);
/// {"results", "report"}
JsonDocument job_results(const JobDocument& job);
/// An event of a job: its document.
JsonDocument job_event(const JobDocument& job);

}  // namespace pointwright::protocol
