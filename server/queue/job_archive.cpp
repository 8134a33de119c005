#include "server/queue/job_archive.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <optional>
#include <stdexcept>

#include "server/store/answers.h"
#include "server/store/archive.h"
#include "server/store/row_time.h"

namespace pointwright::server {

using protocol::JobDocument;
using protocol::Json;
using protocol::JsonDocument;
using protocol::Problem;
using protocol::TimePoint;

namespace {

std::string terms_row(const KeptJob& job) {
  return protocol::to_text(JsonDocument{{"terms", to_json(job.document.terms)},
                                        {"created", to_ms(job.document.created)},
                                        {"preview", job.has_preview},
                                        {"drop", job.drop_non_finite},
                                        {"result", job.result},
                                        {"bytes", job.bytes}});
}

std::string state_row(const JobDocument& job) {
  JsonDocument row{{"status", job_status_name(job.status)},
                   {"message", job.message},
                   {"updated", to_ms(job.updated)},
                   {"attempts", job.attempts}};
  if (job.started) row["started"] = to_ms(*job.started);
  if (job.finished) row["finished"] = to_ms(*job.finished);
  if (!job.report.is_null()) row["report"] = job.report;
  if (job.problem)
    row["problem"] = {{"slug", problem_info(job.problem->kind).slug}, {"detail", job.problem->detail}};
  JsonDocument results = JsonDocument::array();
  for (const protocol::JobResult& result : job.results)
    results.push_back({{"name", result.name},
                       {"type", result.media_type},
                       {"bytes", result.bytes},
                       {"sha256", result.sha256}});
  row["results"] = std::move(results);
  return protocol::to_text(row);
}

/// These throw what the JSON library throws, or std::runtime_error, where the text is not of ours.
void read_terms(KeptJob& job, const std::string& text) {
  const Json row = Json::parse(text);
  job.document.terms = protocol::job_terms(row.at("terms"));
  job.document.created = from_ms(row.at("created").get<std::int64_t>());
  job.has_preview = row.at("preview").get<bool>();
  job.drop_non_finite = row.at("drop").get<bool>();
  job.result = row.at("result").get<std::string>();
  job.bytes = row.at("bytes").get<std::uint64_t>();
}

void read_state(JobDocument& job, const std::string& text) {
  const Json row = Json::parse(text);
  const auto& names = protocol::kJobStatusNames;
  const auto name = std::find(names.begin(), names.end(), row.at("status").get<std::string>());
  if (name == names.end()) throw std::runtime_error("a status that is none");
  job.status = static_cast<protocol::JobStatus>(name - names.begin());
  job.message = row.at("message").get<std::string>();
  job.updated = from_ms(row.at("updated").get<std::int64_t>());
  job.attempts = row.at("attempts").get<std::uint64_t>();
  const auto time = [&](const char* key) {
    const auto found = row.find(key);
    return found == row.end() ? std::nullopt : std::optional(from_ms(found->get<std::int64_t>()));
  };
  job.started = time("started");
  job.finished = time("finished");
  if (const auto report = row.find("report"); report != row.end())
    job.report = JsonDocument::parse(report->dump());
  if (const auto problem = row.find("problem"); problem != row.end()) {
    const auto* const info = protocol::find_problem(problem->at("slug").get<std::string>());
    if (info == nullptr) throw std::runtime_error("a problem that is none");
    job.problem = Problem{.kind = info->kind, .detail = problem->at("detail").get<std::string>()};
  }
  for (const Json& result : row.at("results"))
    job.results.push_back({.name = result.at("name").get<std::string>(),
                           .media_type = result.at("type").get<std::string>(),
                           .bytes = result.at("bytes").get<std::uint64_t>(),
                           .sha256 = result.at("sha256").get<std::string>()});
}

}  // namespace

Outcome<Done> JobArchive::add(const KeptJob& job, const KeptAnswer* answer) {
  const std::string& id = job.document.id;
  const std::string terms = terms_row(job);
  const std::string state = state_row(job.document);
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("INSERT INTO jobs (id, owner, terms, terms_seal, state, state_seal) VALUES (?, ?, ?, ?, ?, ?)",
               id, job.owner, terms, row_seal({id, job.owner, terms}), state, row_seal({id, state}));
    if (answer != nullptr) Answers::put(access, *answer);
    return Done{};
  });
}

Outcome<Done> JobArchive::update(const KeptJob& job) {
  const std::string& id = job.document.id;
  const std::string state = state_row(job.document);
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("UPDATE jobs SET state = ?, state_seal = ? WHERE id = ?", state, row_seal({id, state}), id);
    return Done{};
  });
}

Outcome<Done> JobArchive::remove(const std::string& id) {
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM jobs WHERE id = ?", id);
    return Done{};
  });
}

std::vector<KeptJob> JobArchive::jobs(std::size_t& damaged) {
  return database_.read([&](Database::Access& access) {
    std::vector<KeptJob> jobs;
    Statement row =
        access.query("SELECT id, owner, terms, terms_seal, state, state_seal FROM jobs ORDER BY place");
    while (row.step()) {
      try {
        KeptJob job;
        job.document.id = row.text(0);
        job.owner = row.text(1);
        const bool is_whole = row.text(3) == row_seal({row.text(0), row.text(1), row.text(2)}) &&
                              row.text(5) == row_seal({row.text(0), row.text(4)});
        if (!is_whole) throw std::runtime_error("a row that is damaged");
        read_terms(job, row.text(2));
        read_state(job.document, row.text(4));
        jobs.push_back(std::move(job));
      } catch (const DatabaseError&) {
        throw;
      } catch (const std::exception&) {
        ++damaged;
      }
    }
    return jobs;
  });
}

}  // namespace pointwright::server
