#pragma once
// What daemon and worker say to each other: the command line, and the lines that come back.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/execution_context.h"
#include "protocol/json/jobs.h"
#include "server/config/config.h"
#include "server/ingest/child_process.h"
#include "server/queue/job_archive.h"

namespace pointwright::server {

struct WorkerFiles {
  std::string recipe;
  std::string input;
  std::string preview;  ///< empty: one is made
  std::string output;
  std::string work;
};

/// `pointwright job run …` for the job.
std::vector<std::string> worker_words(const std::string& program, const KeptJob& job,
                                      const WorkerFiles& files, const Limits& limits, std::uint32_t threads);
/// The launcher's words with the worker's in place of {worker}.
std::vector<std::string> launched_words(const Launcher& launcher, const std::vector<std::string>& worker);

/// A line of a worker, which is one of these or none of ours:
/// {"phase", "fraction"}, {"report"}, {"estimate"}, {"problem"}
struct WorkerWord {
  std::optional<Progress> progress = std::nullopt;
  std::optional<protocol::JsonDocument> report = std::nullopt;
  std::optional<protocol::JsonDocument> estimate = std::nullopt;
  std::optional<protocol::Problem> problem = std::nullopt;
};
WorkerWord parse_worker_word(const std::string& line);

/// Why a worker has ended badly: what it said itself, or else what it died of, in a sentence for a person.
protocol::Problem problem_of_worker(const ChildEnd& end, const WorkerWord& last);

}  // namespace pointwright::server
