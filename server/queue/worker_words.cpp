#include "server/queue/worker_words.h"

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <string_view>
#include <utility>

namespace pointwright::server {

using protocol::Json;
using protocol::JsonDocument;
using protocol::Problem;
using protocol::ProblemKind;

std::vector<std::string> worker_words(const std::string& program, const KeptJob& job,
                                      const WorkerFiles& files, const Limits& limits, std::uint32_t threads) {
  const protocol::JobTerms& terms = job.document.terms;
  std::vector<std::string> words{program,      "job",        "run",     "--events",  "--confined",
                                 "--recipe",   files.recipe, "--in",    files.input, "--out",
                                 files.output, "--work",     files.work};
  const auto add = [&](const char* option, std::string value) {
    words.emplace_back(option);
    words.push_back(std::move(value));
  };
  add("--memory", std::to_string(limits.job_tile_bytes >> 20U));
  add("--most-memory", std::to_string(limits.max_job_bytes >> 20U));
  add("--neighbors", std::to_string(terms.neighbors));
  if (files.preview.empty())
    add("--preview-count", std::to_string(terms.preview_count));
  else
    add("--preview", files.preview);
  if (!terms.mode.empty()) add("--mode", terms.mode);
  if (terms.steps > 0) add("--steps", std::to_string(terms.steps));
  if (threads > 0) add("--threads", std::to_string(threads));
  if (job.drop_non_finite) words.emplace_back("--drop-non-finite");
  return words;
}

std::vector<std::string> launched_words(const Launcher& launcher, const std::vector<std::string>& worker) {
  std::vector<std::string> words;
  for (const std::string& word : launcher.command) {
    if (word == kWorkerPlace)
      words.insert(words.end(), worker.begin(), worker.end());
    else
      words.push_back(word);
  }
  return words;
}

WorkerWord parse_worker_word(const std::string& line) {
  WorkerWord word;
  const Json document = Json::parse(line, nullptr, false);
  if (!document.is_object()) return word;
  const auto part = [&](const char* name) -> std::optional<JsonDocument> {
    const auto found = document.find(name);
    if (found == document.end() || !found->is_object()) return std::nullopt;
    return JsonDocument::parse(found->dump());
  };
  word.report = part("report");
  word.estimate = part("estimate");
  const auto phase = document.find("phase");
  const auto fraction = document.find("fraction");
  if (phase != document.end() && phase->is_string() && fraction != document.end() && fraction->is_number())
    word.progress = Progress{.phase = phase->get<std::string>(),
                             .fraction = std::clamp(fraction->get<double>(), 0.0, 1.0)};
  const auto problem = document.find("problem");
  if (problem != document.end() && problem->is_object()) {
    constexpr std::string_view kTypes = "/problems/";
    const std::string type = problem->value("type", std::string());
    const auto* const info =
        type.starts_with(kTypes) ? protocol::find_problem(type.substr(kTypes.size())) : nullptr;
    word.problem = Problem{.kind = info == nullptr ? ProblemKind::kInternalError : info->kind,
                           .detail = problem->value("detail", std::string("the worker does not say why"))};
    if (const auto errors = problem->find("errors"); errors != problem->end() && errors->is_array())
      for (const Json& fault : *errors)
        if (fault.is_object())
          word.problem->errors.push_back({.pointer = fault.value("pointer", std::string()),
                                          .detail = fault.value("detail", std::string())});
  }
  return word;
}

Problem problem_of_worker(const ChildEnd& end, const WorkerWord& last) {
  if (last.problem) return *last.problem;
  Problem problem{.kind = ProblemKind::kInternalError, .detail = {}};
  if (end.signal == SIGKILL)
    problem.detail = "the worker was killed: most likely the machine had no memory left for it";
  else if (end.signal != 0)
    problem.detail = std::string("the worker crashed (").append(::strsignal(end.signal)).append(")");
  else
    problem.detail = "the worker ended with status " + std::to_string(end.status);
  problem.detail += "; the log says how far it came";
  return problem;
}

}  // namespace pointwright::server
