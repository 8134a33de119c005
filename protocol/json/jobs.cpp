#include "protocol/json/jobs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/json/request_members.h"

namespace pointwright::protocol {
namespace {

constexpr std::uint64_t kMostSamples = 20'000'000;  // of a preview: more of it helps nobody
constexpr std::uint64_t kFewestSamples = 100;

std::string optional_id(ObjectReader& object, std::string_view name, const std::string& what) {
  return object.optional(name) == nullptr ? std::string() : required_id(object, name, what);
}

void read_preview(ObjectReader& object, JobTerms& terms) {
  const Json* const preview = object.optional("preview");
  if (preview == nullptr) return;
  ObjectReader members(*preview, object.pointer_to("preview"), object.errors());
  terms.preview_cloud = optional_id(members, "cloud", "a cloud");
  if (const Json* const count = members.optional("count")) {
    terms.preview_count =
        read_integer(*count, members.pointer_to("count"), object.errors(), kFewestSamples, kMostSamples)
            .value_or(kUsualPreview);
    if (!terms.preview_cloud.empty())
      object.errors().add(members.pointer_to("count"), "must not stand beside cloud: it has its samples");
  }
  members.finish();
  if (!terms.session.empty())
    object.errors().add(object.pointer_to("preview"), "must not stand beside session: its samples are it");
}

void read_output(ObjectReader& object, JobTerms& terms) {
  const Json* const output = object.optional("output");
  if (output == nullptr) return;
  std::array<std::string_view, kJobFormats.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) names.at(i) = format_name(kJobFormats.at(i));
  ObjectReader members(*output, object.pointer_to("output"), object.errors());
  if (const Json* const format = members.optional("format"))
    if (const auto choice = read_choice(*format, members.pointer_to("format"), object.errors(), names))
      terms.format = kJobFormats.at(*choice);
  if (const Json* const steps = members.optional("steps"))
    terms.steps =
        read_integer(*steps, members.pointer_to("steps"), object.errors(), 2, kMostSteps).value_or(0);
  members.finish();
}

/// Whose edits, of which scan: one of each.
void read_sources(ObjectReader& object, JobRequest& request) {
  JobTerms& terms = request.terms;
  const Json* const recipe = object.optional("recipe");
  terms.session = optional_id(object, "session", "a session");
  if ((recipe == nullptr) == terms.session.empty())
    object.errors().add(object.pointer_to("recipe"), "or session: one of the two must be there");
  terms.cloud = optional_id(object, "cloud", "a cloud");
  terms.upload = optional_id(object, "upload", "an upload");
  if (!terms.cloud.empty() && !terms.upload.empty())
    object.errors().add(object.pointer_to("upload"), "must not stand beside cloud: a job edits one scan");
  if (terms.cloud.empty() && terms.upload.empty() && terms.session.empty())
    object.errors().add(object.pointer_to("cloud"), "or upload: one of the two must be there");
  Json played = Json::object();
  for (const char* const name : {"recipe", "s", "timing"})
    if (const Json* const member = object.optional(name)) played[name] = *member;
  if (recipe == nullptr) {
    // What stands beside a recipe reads the same beside a session.
    if (const Json* const s = object.optional("s"))
      terms.s = read_number(*s, object.pointer_to("s"), object.errors(), {.min = 0.0, .max = 1.0})
                    .value_or(terms.s);
    if (const Json* const timing = object.optional("timing"))
      terms.timing = static_cast<Timing>(
          read_choice(*timing, object.pointer_to("timing"), object.errors(), kTimingNames).value_or(0));
    return;
  }
  auto parsed = parse_recipe_request(played);
  if (!parsed.ok()) {
    for (const JsonFault& fault : parsed.errors().faults) object.errors().add(fault.pointer, fault.detail);
    return;
  }
  request.recipe = std::move(parsed).value();
  request.recipe_text = played.dump();
  terms.s = request.recipe.s;
  terms.timing = request.recipe.timing;
}

std::string href(const JobDocument& job, std::string_view below = {}) {
  return std::string("/v1/jobs/").append(job.id).append(below);
}

JsonDocument link(std::string rel, std::string type, std::string target) {
  return {{"rel", std::move(rel)}, {"type", std::move(type)}, {"href", std::move(target)}};
}

JsonDocument links_of(const JobDocument& job) {
  JsonDocument links = JsonDocument::array();
  links.push_back(link("self", "application/json", href(job)));
  links.push_back(link("monitor", "text/event-stream", href(job, "/events")));
  links.push_back(link("log", "text/plain", href(job, "/log")));
  if (job.status == JobStatus::kSuccessful)
    links.push_back(
        link("http://www.opengis.net/def/rel/ogc/1.0/results", "application/json", href(job, "/results")));
  return links;
}

JsonDocument result_members(const JobDocument& job, const JobResult& result) {
  return {{"name", result.name},
          {"type", result.media_type},
          {"bytes", result.bytes},
          {"sha256", result.sha256},
          {"href", href(job, "/results/") + result.name}};
}

}  // namespace

std::string_view job_status_name(JobStatus status) {
  return kJobStatusNames.at(static_cast<std::size_t>(status));
}

Parsed<JobRequest> parse_job_request(const Json& document) {
  JsonErrors errors;
  JobRequest request;
  JobTerms& terms = request.terms;
  ObjectReader object(document, "", errors);
  read_sources(object, request);
  read_preview(object, terms);
  read_output(object, terms);
  if (const Json* const name = object.optional("name")) {
    terms.name = read_string(*name, object.pointer_to("name"), errors).value_or("");
    if (name->is_string() && !is_valid_name(terms.name))
      errors.add(object.pointer_to("name"), "must be 1 to 120 bytes without control characters");
  }
  if (const Json* const neighbors = object.optional("neighbors")) {
    terms.neighbors = static_cast<std::uint32_t>(
        read_integer(*neighbors, object.pointer_to("neighbors"), errors, 4, 32).value_or(terms.neighbors));
    if (!terms.session.empty())
      errors.add(object.pointer_to("neighbors"), "must not stand beside session: it has them");
  }
  if (const Json* const mode = object.optional("mode"))
    if (const auto choice = read_choice(*mode, object.pointer_to("mode"), errors, kJobModeNames))
      terms.mode = kJobModeNames.at(*choice);
  if (const Json* const launcher = object.optional("launcher"))
    terms.launcher = read_string(*launcher, object.pointer_to("launcher"), errors).value_or("");
  if (const Json* const priority = object.optional("priority"))
    terms.priority = read_integer(*priority, object.pointer_to("priority"), errors, 0, kHighestPriority)
                         .value_or(kUsualPriority);
  if (const Json* const validate = object.optional("validate"))
    request.validate = read_bool(*validate, object.pointer_to("validate"), errors).value_or(false);
  object.finish();
  return value_or_errors(std::move(request), std::move(errors));
}

JsonDocument to_json(const JobTerms& terms) {
  JsonDocument document{{"neighbors", terms.neighbors},
                        {"s", checked_number(terms.s)},
                        {"timing", kTimingNames.at(static_cast<std::size_t>(terms.timing))},
                        {"launcher", terms.launcher},
                        {"priority", terms.priority}};
  const auto add = [&](const char* name, const std::string& text) {
    if (!text.empty()) document[name] = text;
  };
  add("name", terms.name);
  add("session", terms.session);
  add("cloud", terms.cloud);
  add("upload", terms.upload);
  add("mode", terms.mode);
  if (!terms.preview_cloud.empty())
    document["preview"] = {{"cloud", terms.preview_cloud}};
  else if (terms.session.empty())
    document["preview"] = {{"count", terms.preview_count}};
  if (terms.format) document["output"]["format"] = format_name(*terms.format);
  if (terms.steps > 0) document["output"]["steps"] = terms.steps;
  return document;
}

JobTerms job_terms(const Json& document) {
  JobTerms terms;
  const auto text = [&](const char* name) { return document.value(name, std::string()); };
  terms.name = text("name");
  terms.session = text("session");
  terms.cloud = text("cloud");
  terms.upload = text("upload");
  terms.mode = text("mode");
  terms.neighbors = document.at("neighbors").get<std::uint32_t>();
  terms.s = document.at("s").get<double>();
  terms.timing =
      document.at("timing").get<std::string>() == kTimingNames[1] ? Timing::kTogether : Timing::kSequence;
  terms.launcher = document.at("launcher").get<std::string>();
  terms.priority = document.at("priority").get<std::uint64_t>();
  if (const auto preview = document.find("preview"); preview != document.end()) {
    terms.preview_cloud = preview->value("cloud", std::string());
    terms.preview_count = preview->value("count", kUsualPreview);
  }
  if (const auto output = document.find("output"); output != document.end()) {
    terms.steps = output->value("steps", std::uint64_t{0});
    const std::string name = output->value("format", std::string());
    for (const CloudFormat format : kJobFormats)
      if (format_name(format) == name) terms.format = format;
  }
  return terms;
}

JsonDocument to_json(const JobDocument& job) {
  JsonDocument document{{"jobID", job.id},
                        {"type", "process"},
                        {"processID", "edit"},
                        {"status", job_status_name(job.status)},
                        {"message", job.message},
                        {"progress", static_cast<int>(std::floor(100.0 * job.progress.fraction))},
                        {"phase", job.progress.phase},
                        {"created", to_rfc3339(job.created)},
                        {"updated", to_rfc3339(job.updated)}};
  if (job.started) document["started"] = to_rfc3339(*job.started);
  if (job.finished) document["finished"] = to_rfc3339(*job.finished);
  if (job.eta_s) document["eta_s"] = checked_number(*job.eta_s);
  if (job.queue_place > 0) document["queue_place"] = job.queue_place;
  document["attempts"] = job.attempts;
  document["request"] = to_json(job.terms);
  if (!job.report.is_null()) document["report"] = job.report;
  if (job.problem) document["exception"] = to_json(*job.problem);
  document["links"] = links_of(job);
  return document;
}

JsonDocument job_list(const std::vector<JobDocument>& jobs) {
  JsonDocument list = JsonDocument::array();
  for (const JobDocument& job : jobs) list.push_back(to_json(job));
  JsonDocument links = JsonDocument::array();
  links.push_back(link("self", "application/json", "/v1/jobs"));
  return {{"jobs", std::move(list)}, {"links", std::move(links)}};
}

JsonDocument job_results(const JobDocument& job) {
  JsonDocument list = JsonDocument::array();
  for (const JobResult& result : job.results) list.push_back(result_members(job, result));
  return {{"results", std::move(list)}, {"report", job.report}};
}

JsonDocument job_event(const JobDocument& job) {
  return {{"event", "job"}, {"job", to_json(job)}};
}

}  // namespace pointwright::protocol
