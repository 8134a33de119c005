#include <chrono>

#include "protocol/json/access.h"
#include "protocol/json/documents.h"
#include "protocol/json/jobs.h"
#include "protocol/json/recipe.h"
#include "tests/protocol/golden.h"

namespace pointwright::protocol::golden {
namespace {

constexpr const char* kCloudId = "Jq3cT9rVwXyZ0a1b2c3d4e";
constexpr const char* kSessionId = "s5f6g7h8i9j0k-l_m1n2o3";

TimePoint created() {
  using namespace std::chrono;
  return sys_days(year(2026) / January / 31) + hours(12) + minutes(34) + seconds(56) + milliseconds(789);
}

ImportReport report() {
  return {.format = CloudFormat::kPly,
          .encoding = "binary_little_endian",
          .declared_count = 437647,
          .sample_count = 437645,
          .dropped_non_finite = 2,
          .duplicate_count = 1,
          .from_mesh = true,
          .position_is_double = false,
          .attributes = {"normal", "color", "quality"},
          .skipped = {"face"},
          .normals = NormalQuality::kScaled,
          .ranges = {{.name = "quality", .type = "float32", .min = 0.25, .max = 1.0, .non_finite = 3}},
          .spacing = 0.0009765625,
          .step = Vec3d(0x1.0p-26, 0x1.0p-26, 0x1.0p-25),
          .warnings = {"2 samples are dropped: not finite", "left out: face"},
          .bounds_min = Vec3d(-0.125, -0.0625, 0.0),
          .bounds_max = Vec3d(0.125, 0.125, 0.25)};
}

CloudDocument cloud() {
  return {.id = kCloudId,
          .name = "Dragon, 2nd scan",
          .sha256 = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
          .bytes = 8'752'000,
          .created = created(),
          .origin = Vec3d(0.0, 0.03125, 0.125),
          .report = report()};
}

UploadDocument upload() {
  return {.id = "u7k8l9m0n1o2p-q_r3s4t5",
          .name = "scan of the yard.las",
          .media_type = "application/vnd.las",
          .length = 8'752'000'227,
          .offset = 33'554'432,
          .created = created(),
          .expires = created() + std::chrono::hours(24)};
}

ImportDocument import() {
  return {.id = "p7k8l9m0n1o2p-q_r3s4t5",
          .name = "The yard",
          .bytes = upload().length,
          .created = created(),
          .state = ImportState::kRunning,
          .progress = {.phase = "ordering", .fraction = 0.6}};
}

JobDocument job() {
  JobDocument document{.id = "j7k8l9m0n1o2p-q_r3s4t5", .terms = {.name = "The yard, bent"}};
  document.terms.session = kSessionId;
  document.terms.upload = upload().id;
  document.terms.format = CloudFormat::kLas;
  document.terms.priority = 7;
  document.status = JobStatus::kRunning;
  document.message = "is at work";
  document.progress = {.phase = "tiles", .fraction = 0.625};
  document.eta_s = 90.5;
  document.attempts = 1;
  document.created = created();
  document.started = created() + std::chrono::seconds(1);
  document.updated = created() + std::chrono::seconds(150);
  return document;
}

JobDocument failed_job() {
  JobDocument document = job();
  document.status = JobStatus::kFailed;
  document.message = "the worker was killed: most likely the machine had no memory left for it";
  document.problem = Problem{.kind = ProblemKind::kInternalError, .detail = document.message};
  document.eta_s = std::nullopt;
  document.finished = document.updated;
  return document;
}

JobDocument waiting_job() {
  JobDocument document{.id = "k7k8l9m0n1o2p-q_r3s4t5", .terms = {.cloud = kCloudId}};
  document.message = "waits for its turn";
  document.progress = {.phase = "waiting", .fraction = 0.0};
  document.queue_place = 1;
  document.created = document.updated = created();
  return document;
}

JobDocument done_job() {
  JobDocument document = job();
  document.status = JobStatus::kSuccessful;
  document.report = {{"mode", "tiles"},
                     {"sample_count", 257'413'000},
                     {"moved", 31'000'000},
                     {"inserted", 0},
                     {"removed", 0},
                     {"tiles", 412},
                     {"tiles_kept", 0},
                     {"preview",
                      {{"sample_count", 100'000},
                       {"matched", 99'871},
                       {"rms_difference", 0.000125},
                       {"max_difference", 0.00175}}},
                     {"spacing", 0.00625},
                     {"seconds", 437.5}};
  document.results = {{.name = "result.las",
                       .media_type = "application/vnd.las",
                       .bytes = upload().length,
                       .sha256 = cloud().sha256}};
  return document;
}

ImageDocument image() {
  return {.id = "i7k8l9m0n1o2p-q_r3s4t5",
          .width = 1024,
          .height = 768,
          .channels = {"red", "green", "blue", "alpha"},
          .bytes = 48'213,
          .created = created()};
}

SessionDocument building() {
  SessionDocument session;
  session.summary = {.id = kSessionId,
                     .name = "Wings up",
                     .cloud = kCloudId,
                     .state = SessionState::kBuilding,
                     .revision = 0,
                     .created = created(),
                     .sample_count = 437645};
  session.progress = {.phase = "normals", .fraction = 0.25};
  session.origin = cloud().origin;
  session.bounds = {.min = report().bounds_min, .max = report().bounds_max};
  return session;
}

SessionDocument ready() {
  SessionDocument session = building();
  session.summary.state = SessionState::kReady;
  session.summary.revision = 5;
  session.progress = {.phase = "ready", .fraction = 1.0};
  session.spacing = 0.000375;
  session.level_scales = {0.00796875, 0.0};
  session.decomposition = {{.scale = 0.00796875F,
                            .base_samples = 21300,
                            .at_limit = 12,
                            .fallback = 3,
                            .flipped = 2,
                            .mean_iterations = 2.5,
                            .max_detail = 0.00625F,
                            .rms_detail = 0.00075F}};
  session.zero = {.samples = 120000, .operations = 2};
  session.one = {.samples = 9500, .operations = 1};
  session.named = {{.name = "left wing", .region = {.samples = 31000, .operations = 3}}};
  session.head = 1;
  session.edits = 2;
  session.timings_ms = {{"normals", 61.5}, {"smoothing", 340.0}, {"decomposition", 205.25}};
  return session;
}

SessionDocument preview() {
  SessionDocument session = building();
  session.summary.sample_count = 100'000;
  session.summary.preview = PreviewSize{.count = 100'000, .of = 437'645};
  return session;
}

SessionDocument failed() {
  SessionDocument session = building();
  session.summary.state = SessionState::kFailed;
  session.error = Problem{.kind = ProblemKind::kCancelled,
                          .detail = "the work was cancelled",
                          .instance = std::string("/v1/sessions/") + kSessionId,
                          .request_id = "3b1d9a52c7e84f60"};
  return session;
}

std::vector<PaintOperation> operations() {
  return {{.mode = PaintMode::kSet,
           .shape = HalfSpace{.point = Vec3d(0.0, 0.05, 0.0), .normal = Vec3d(0.0, -1.0, 0.0)}},
          {.mode = PaintMode::kAdd,
           .shape = Stroke{.vertices = {Vec3d(0.1, 0.1, 0.05), Vec3d(0.11, 0.1, 0.05)}, .radius = 0.004},
           .steal = true}};
}

std::vector<std::shared_ptr<const PaintOperation>> shared_operations() {
  std::vector<std::shared_ptr<const PaintOperation>> shared;
  for (const PaintOperation& each : operations())
    shared.push_back(std::make_shared<const PaintOperation>(each));
  return shared;
}

std::vector<EditRecord> edits() {
  return {{.index = 1,
           .edit = {.level = 0, .deformation = Translation{.vector = Vec3d(0.0, 0.02, 0.0)}},
           .created = created(),
           .moved_samples = 317000,
           .zero_samples = 120000,
           .one_samples = 9500,
           .sample_count = 437645,
           .surface_hash = "3f0b7a1e5c9d2468ace013579bdf02468ace13579bdf02468ace013579bdf024"},
          {.index = 2,
           .edit = {.level = 0,
                    .deformation = Rotation{.point = Vec3d(0.0, 0.05, 0.0),
                                            .axis = Vec3d(0.0, 1.0, 0.0),
                                            .angle_rad = to_radians(37.5)},
                    .resampling = ResamplingParams{.max_samples = 500'000}},
           .created = created(),
           .moved_samples = 317000,
           .zero_samples = 120000,
           .one_samples = 9500,
           .inserted = 21480,
           .sample_count = 459125,
           .surface_hash = "9c1d5e3f7a2b4c6d8e0f1a3b5c7d9e0f2a4b6c8d0e1f3a5b7c9d1e3f5a7b9c0d"}};
}

/// Edits of the further kinds; edit-translation and edit-rotation are written by hand.
JsonDocument edit_of(const Deformation& deformation, Blend blend = Blend::kQuartic,
                     std::vector<float> gains = {}) {
  return to_json(
      EditParams{.level = 0, .blend = blend, .deformation = deformation, .gains = std::move(gains)});
}

Vec3d axis_point() {
  return {0.0, 0.05, 0.0};
}

EditParams resampling_edit() {
  return {.level = 1,
          .deformation = Translation{.vector = Vec3d(0.0, 0.0, 0.5)},
          .resampling = ResamplingParams{
              .bound = 2.0, .min_spacing = 0.0005, .shear_aware = true, .sweeps = 4, .collect = 0.7}};
}

Twist twist() {
  return {.point = axis_point(), .axis = Vec3d::UnitY(), .angle_rad = to_radians(90.0), .length = 0.25};
}

Deformation sequence() {
  return Deformation(
      {Translation{.vector = Vec3d(0.0, 0.02, 0.0)},
       Rotation{.point = axis_point(), .axis = Vec3d::UnitY(), .angle_rad = to_radians(37.5)}});
}

JsonDocument recipe() {
  const PaintOperation foot{
      .shape = PointSet{.points = {Vec3d(0.0, 0.01, 0.0), Vec3d(0.01, 0.02, 0.0)}, .radii = {0.02, 0.0125}}};
  const PaintOperation tip{.shape = PointSet{.points = {Vec3d(0.0, 0.125, 0.05)}, .radii = {0.03}}};
  const RecipeEdit painted{.paints = true, .zero = {foot}, .one = {tip}, .edit = edits()[0].edit};
  const RecipeEdit after{.edit = edits()[1].edit};
  std::string text = recipe_head(ready().level_scales) + to_text(to_json(painted)) + ",\n";
  return JsonDocument::parse(text + to_text(to_json(after)) + std::string(recipe_tail()));
}

Problem invalid() {
  return {.kind = ProblemKind::kInvalidValue,
          .detail = "/shape/radius: must be a number, but is null (and 1 more fault)",
          .instance = std::string("/v1/sessions/") + kSessionId + "/regions/one/operations",
          .request_id = "3b1d9a52c7e84f60",
          .errors = {{"/shape/radius", "must be a number, but is null"},
                     {"/colour", "this member is unknown here"}}};
}

Problem stale() {
  return {.kind = ProblemKind::kStaleRevision,
          .detail = "the edit was made for revision 4, the session is at revision 5",
          .instance = std::string("/v1/sessions/") + kSessionId + "/edits",
          .request_id = "3b1d9a52c7e84f61",
          .revision = 5};
}

Problem too_large() {
  return {.kind = ProblemKind::kTooManySamples,
          .detail = "the file claims 60000000 samples, beyond the limit of 50000000",
          .instance = "/v1/clouds",
          .request_id = "3b1d9a52c7e84f62",
          .limit = 50'000'000,
          .actual = 60'000'000};
}

TimePoint expiry() {
  using namespace std::chrono;
  return sys_days(year(2026) / February / 28);
}

TokenDocument token() {
  return {.id = "Y2FsbGVyLXRva2VuLWlkMA",
          .created = created(),
          .terms = {.name = "Ann", .scope = Scope::kEdit, .expires = expiry(), .quotas = {.sessions = 4}}};
}

ShareDocument share() {
  return {.id = "U2hhcmUtYS12aWV3LWxpbg",
          .created = created(),
          .terms = {.scope = Scope::kView, .expires = expiry()}};
}

InfoDocument info() {
  return {.version = "0.1.0",
          .limits = {{"max_samples", 50'000'000}, {"max_upload_bytes", 2'147'483'648}, {"max_sessions", 16}},
          .formats = {"draco", "ply", "xyz"},
          .features = {"preview", "stream"},
          .launchers = {"local", "cluster"},
          .caller = to_json(CallerDocument{.token = "Y2FsbGVyLXRva2VuLWlkMA",
                                           .name = "Ann",
                                           .scope = Scope::kEdit,
                                           .session = std::nullopt,
                                           .quotas = {{"sessions", 16, 3}, {"streams", 64, 1}}})};
}

}  // namespace

std::vector<File> document_files() {
  const std::vector<std::pair<std::string, JsonDocument>> documents{
      {"cloud", to_json(cloud())},
      {"cloud-list", cloud_list({cloud()})},
      {"upload", to_json(upload())},
      {"upload-list", upload_list({upload()})},
      {"import", to_json(import())},
      {"import-list", import_list({import()})},
      {"import-cloud",
       JsonDocument{{"upload", upload().id}, {"name", "The yard"}, {"nonfinite", "drop"}, {"format", "las"}}},
      {"job", to_json(job())},
      {"job-failed", to_json(failed_job())},
      {"job-list", job_list({waiting_job(), job()})},
      {"job-results", job_results(done_job())},
      {"job-event", job_event(job())},
      {"job-request", JsonDocument{{"recipe", recipe()},
                                   {"s", 0.5},
                                   {"cloud", kCloudId},
                                   {"preview", JsonDocument{{"count", 50'000}}},
                                   {"output", JsonDocument{{"format", "ply"}}},
                                   {"mode", "tiles"},
                                   {"priority", 7},
                                   {"name", "The yard, bent"}}},
      {"job-of-session",
       JsonDocument{
           {"session", kSessionId}, {"upload", upload().id}, {"launcher", "local"}, {"validate", true}}},
      {"job-estimate", JsonDocument{{"estimate", JsonDocument{{"mode", "tiles"},
                                                              {"sample_count", 257'413'000},
                                                              {"memory_bytes", 1'073'741'824},
                                                              {"disk_bytes", 25'226'432'227},
                                                              {"free_disk_bytes", 812'345'678'848},
                                                              {"seconds", 440.5}}}}},
      {"image", to_json(image())},
      {"image-list", image_list({image()})},
      {"session-building", to_json(preview())},
      {"session", to_json(ready())},
      {"session-failed", to_json(failed())},
      {"session-list", session_list({building().summary, ready().summary})},
      {"region-list", region_list(ready())},
      {"painting", painting_document("zero", 120000, shared_operations())},
      {"edit-list", edit_list(1, edits())},
      {"edit-along-normal", edit_of(NormalOffset{.distance = -0.004}, Blend::kCubic, {1.5F})},
      {"edit-resampling", to_json(resampling_edit())},
      {"edit-scale", edit_of(Scaling{.center = axis_point(), .factors = Vec3d(1.5, 1.0, 1.5)})},
      {"edit-sequence", edit_of(sequence(), Blend::kCosine)},
      {"edit-toward-point",
       edit_of(TowardPoint{.target = Vec3d(0.0, 0.125, 0.0), .amount = 0.25}, Blend::kQuintic)},
      {"edit-twist", edit_of(twist())},
      {"recipe", recipe()},
      {"recipe-request", JsonDocument{{"recipe", recipe()}, {"s", 0.5}, {"timing", "together"}}},
      {"problem-invalid", to_json(invalid())},
      {"problem-stale", to_json(stale())},
      {"problem-limit", to_json(too_large())},
      {"info", to_json(info())},
      {"token-list", token_list({token()})},
      {"token-request", JsonDocument{{"name", "Ann"},
                                     {"scope", "edit"},
                                     {"expires", "2026-02-28T00:00:00.000Z"},
                                     {"quotas", JsonDocument{{"sessions", 4}}}}},
      {"share-list", share_list({share()})},
      {"share-request", JsonDocument{{"scope", "view"}, {"expires", "2026-02-28T00:00:00.000Z"}}},
      {"event-session", session_event(ready())},
      {"event-progress", progress_event({.phase = "normals", .fraction = 0.25})},
      {"event-presence",
       presence_event({{.name = "Ada", .since = created()}, {.name = "", .since = created()}})},
      {"event-heartbeat", heartbeat_event()},
      {"event-end", end_event("the session was deleted")}};
  std::vector<File> files;
  files.reserve(documents.size());
  for (const auto& [name, document] : documents) {
    files.push_back({.path = "examples/" + name + ".json", .content = document.dump(2) + "\n"});
  }
  return files;
}

}  // namespace pointwright::protocol::golden
