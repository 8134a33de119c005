#include "protocol/json/documents.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace pointwright::protocol {
namespace {

JsonDocument string_array(const std::vector<std::string>& strings) {
  JsonDocument array = JsonDocument::array();
  for (const std::string& string : strings) array.push_back(string);
  return array;
}

template <typename T>
JsonDocument document_array(const std::vector<T>& values) {
  JsonDocument array = JsonDocument::array();
  for (const T& value : values) array.push_back(to_json(value));
  return array;
}

JsonDocument checked_vector(const Vec3d& vector) {
  for (int axis = 0; axis < 3; ++axis) checked_number(vector[axis]);
  return to_json(vector);
}

JsonDocument region_summary(const RegionSummary& region) {
  return JsonDocument{{"samples", region.samples}, {"operations", region.operations}};
}

JsonDocument region_entry(std::string_view name, const RegionSummary& region) {
  return JsonDocument{{"region", name}, {"samples", region.samples}, {"operations", region.operations}};
}

JsonDocument named_regions(const SessionDocument& session) {
  JsonDocument array = JsonDocument::array();
  for (const NamedRegionSummary& each : session.named) array.push_back(region_entry(each.name, each.region));
  return array;
}

JsonDocument progress_members(const Progress& progress) {
  return JsonDocument{{"phase", progress.phase}, {"fraction", checked_number(progress.fraction)}};
}

JsonDocument level_list(const std::vector<double>& scales) {
  JsonDocument levels = JsonDocument::array();
  for (std::size_t level = 0; level < scales.size(); ++level) {
    levels.push_back(JsonDocument{{"level", level}, {"scale", checked_number(scales[level])}});
  }
  return levels;
}

}  // namespace

std::string_view session_state_name(SessionState state) {
  switch (state) {
    case SessionState::kBuilding:
      return "building";
    case SessionState::kReady:
      return "ready";
    case SessionState::kFailed:
      return "failed";
    case SessionState::kAsleep:
      return "asleep";
  }
  throw LogicError("a session state that is none");
}

JsonDocument to_json(const ModelBounds& bounds) {
  return JsonDocument{{"min", checked_vector(bounds.min)}, {"max", checked_vector(bounds.max)}};
}

namespace {

std::string_view quality_name(NormalQuality quality) {
  switch (quality) {
    case NormalQuality::kNone:
      return "none";
    case NormalQuality::kUnit:
      return "unit";
    case NormalQuality::kScaled:
      return "scaled";
  }
  throw LogicError("a quality of normals that is none");
}

/// A column of which no value is finite has no range.
JsonDocument to_json(const AttributeRange& range, std::uint64_t samples) {
  JsonDocument document{{"name", range.name}, {"type", range.type}};
  const bool has_range = range.non_finite < samples;
  document["min"] = has_range ? JsonDocument(checked_number(range.min)) : JsonDocument(nullptr);
  document["max"] = has_range ? JsonDocument(checked_number(range.max)) : JsonDocument(nullptr);
  document["non_finite"] = range.non_finite;
  return document;
}

}  // namespace

JsonDocument to_json(const ImportReport& report) {
  JsonDocument scalars = JsonDocument::array();
  for (const AttributeRange& range : report.ranges) scalars.push_back(to_json(range, report.sample_count));
  return JsonDocument{{"format", format_name(report.format)},
                      {"encoding", report.encoding},
                      {"declared_count", report.declared_count},
                      {"dropped_non_finite", report.dropped_non_finite},
                      {"duplicate_count", report.duplicate_count},
                      {"from_mesh", report.from_mesh},
                      {"position_is_double", report.position_is_double},
                      {"attributes", string_array(report.attributes)},
                      {"skipped", string_array(report.skipped)},
                      {"normals", quality_name(report.normals)},
                      {"scalars", std::move(scalars)},
                      {"spacing", checked_number(report.spacing)},
                      {"step", checked_vector(report.step)},
                      {"verdict", report.warnings.empty() ? "ok" : "warnings"},
                      {"warnings", string_array(report.warnings)}};
}

JsonDocument to_json(const CloudDocument& cloud) {
  const ModelBounds bounds{.min = cloud.report.bounds_min, .max = cloud.report.bounds_max};
  return JsonDocument{{"id", cloud.id},
                      {"name", cloud.name},
                      {"sha256", cloud.sha256},
                      {"bytes", cloud.bytes},
                      {"created", to_rfc3339(cloud.created)},
                      {"sample_count", cloud.report.sample_count},
                      {"bounds", to_json(bounds)},
                      {"origin", checked_vector(cloud.origin)},
                      {"diagonal", checked_number((bounds.max - bounds.min).norm())},
                      {"report", to_json(cloud.report)}};
}

JsonDocument to_json(const ImageDocument& image) {
  return JsonDocument{{"id", image.id},         {"width", image.width},
                      {"height", image.height}, {"channels", string_array(image.channels)},
                      {"bytes", image.bytes},   {"created", to_rfc3339(image.created)}};
}

JsonDocument to_json(const UploadDocument& upload) {
  return JsonDocument{{"id", upload.id},
                      {"name", upload.name},
                      {"media_type", upload.media_type},
                      {"length", upload.length},
                      {"offset", upload.offset},
                      {"created", to_rfc3339(upload.created)},
                      {"expires", to_rfc3339(upload.expires)}};
}

JsonDocument to_json(const ImportDocument& import) {
  constexpr std::array<std::string_view, 4> kStates{"accepted", "running", "successful", "failed"};
  JsonDocument document{{"id", import.id},
                        {"name", import.name},
                        {"bytes", import.bytes},
                        {"created", to_rfc3339(import.created)},
                        {"state", kStates.at(static_cast<std::size_t>(import.state))},
                        {"progress", progress_members(import.progress)}};
  if (import.problem) document["problem"] = to_json(*import.problem);
  if (import.cloud) document["cloud"] = to_json(*import.cloud);
  return document;
}

JsonDocument to_json(const DecompositionReport& report) {
  return JsonDocument{{"scale", checked_number(report.scale)},
                      {"base_samples", report.base_samples},
                      {"at_limit", report.at_limit},
                      {"fallback", report.fallback},
                      {"flipped", report.flipped},
                      {"mean_iterations", checked_number(report.mean_iterations)},
                      {"max_detail", checked_number(report.max_detail)},
                      {"rms_detail", checked_number(report.rms_detail)}};
}

JsonDocument to_json(const SessionSummary& session) {
  JsonDocument document{{"id", session.id},
                        {"name", session.name},
                        {"cloud", session.cloud},
                        {"state", session_state_name(session.state)},
                        {"revision", session.revision},
                        {"created", to_rfc3339(session.created)},
                        {"sample_count", session.sample_count}};
  if (session.preview) document["preview"] = {{"count", session.preview->count}, {"of", session.preview->of}};
  return document;
}

JsonDocument to_json(const SessionDocument& session) {
  JsonDocument document = to_json(session.summary);
  document["progress"] = progress_members(session.progress);
  if (session.error) document["error"] = to_json(*session.error);
  document["origin"] = checked_vector(session.origin);
  document["bounds"] = to_json(session.bounds);
  document["diagonal"] = checked_number((session.bounds.max - session.bounds.min).norm());
  document["spacing"] = checked_number(session.spacing);
  document["levels"] = level_list(session.level_scales);
  document["decomposition"] = document_array(session.decomposition);
  document["regions"] = JsonDocument{{"zero", region_summary(session.zero)},
                                     {"one", region_summary(session.one)},
                                     {"named", named_regions(session)}};
  document["history"] = JsonDocument{{"head", session.head}, {"edits", session.edits}};
  JsonDocument timings = JsonDocument::object();
  for (const auto& [name, milliseconds] : session.timings_ms) timings[name] = checked_number(milliseconds);
  document["timings_ms"] = std::move(timings);
  return document;
}

JsonDocument to_json(const EditRecord& record) {
  return JsonDocument{{"index", record.index},
                      {"edit", to_json(record.edit)},
                      {"created", to_rfc3339(record.created)},
                      {"moved_samples", record.moved_samples},
                      {"zero_samples", record.zero_samples},
                      {"one_samples", record.one_samples},
                      {"inserted", record.inserted},
                      {"removed", record.removed},
                      {"sample_count", record.sample_count},
                      {"surface_hash", record.surface_hash}};
}

JsonDocument to_json(const InfoDocument& info) {
  JsonDocument limits = JsonDocument::object();
  for (const auto& [name, value] : info.limits) limits[name] = value;
  return JsonDocument{{"version", info.version},
                      {"limits", std::move(limits)},
                      {"formats", string_array(info.formats)},
                      {"features", string_array(info.features)},
                      {"launchers", string_array(info.launchers)},
                      {"caller", info.caller}};
}

JsonDocument cloud_list(const std::vector<CloudDocument>& clouds) {
  return JsonDocument{{"clouds", document_array(clouds)}};
}

JsonDocument import_list(const std::vector<ImportDocument>& imports) {
  return JsonDocument{{"imports", document_array(imports)}};
}

JsonDocument upload_list(const std::vector<UploadDocument>& uploads) {
  return JsonDocument{{"uploads", document_array(uploads)}};
}

JsonDocument image_list(const std::vector<ImageDocument>& images) {
  return JsonDocument{{"images", document_array(images)}};
}

JsonDocument session_list(const std::vector<SessionSummary>& sessions) {
  return JsonDocument{{"sessions", document_array(sessions)}};
}

JsonDocument region_list(const SessionDocument& session) {
  JsonDocument regions = named_regions(session);
  regions.insert(regions.begin(), region_entry("one", session.one));
  regions.insert(regions.begin(), region_entry("zero", session.zero));
  return JsonDocument{{"regions", std::move(regions)}};
}

JsonDocument painting_document(std::string_view region, std::uint64_t samples,
                               const std::vector<std::shared_ptr<const PaintOperation>>& operations) {
  JsonDocument list = JsonDocument::array();
  for (const auto& operation : operations) list.push_back(to_json(*operation));
  return JsonDocument{{"region", region}, {"samples", samples}, {"operations", std::move(list)}};
}

JsonDocument edit_list(std::uint32_t head, const std::vector<EditRecord>& edits) {
  return JsonDocument{{"head", head}, {"edits", document_array(edits)}};
}

JsonDocument session_event(const SessionDocument& session) {
  JsonDocument event{{"event", "session"}};
  event.update(to_json(session));
  return event;
}

JsonDocument progress_event(const Progress& progress) {
  JsonDocument event{{"event", "progress"}};
  event.update(progress_members(progress));
  return event;
}

JsonDocument presence_event(const std::vector<Viewer>& viewers) {
  JsonDocument list = JsonDocument::array();
  for (const Viewer& viewer : viewers)
    list.push_back({{"name", viewer.name}, {"since", to_rfc3339(viewer.since)}});
  return JsonDocument{{"event", "presence"}, {"viewers", std::move(list)}};
}

JsonDocument heartbeat_event() {
  return JsonDocument{{"event", "heartbeat"}};
}

JsonDocument end_event(std::string_view reason) {
  return JsonDocument{{"event", "end"}, {"reason", reason}};
}

std::string to_text(const JsonDocument& document) {
  return document.dump(-1, ' ', false, JsonDocument::error_handler_t::replace);
}

std::string to_rfc3339(TimePoint time) {
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(std::chrono::floor<std::chrono::milliseconds>(time - day));
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%04d-%02u-%02uT%02d:%02d:%02d.%03dZ",
                static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
                static_cast<unsigned>(date.day()), static_cast<int>(clock.hours().count()),
                static_cast<int>(clock.minutes().count()), static_cast<int>(clock.seconds().count()),
                static_cast<int>(clock.subseconds().count()));
  return text.data();
}

double checked_number(double value) {
  POINTWRIGHT_CHECK(std::isfinite(value), "a number of a document is not finite");
  return value;
}

double checked_number(float value) {
  POINTWRIGHT_CHECK(std::isfinite(value), "a number of a document is not finite");
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  double shortest = 0.0;
  std::from_chars(text.data(), end, shortest);
  return shortest;
}

}  // namespace pointwright::protocol
