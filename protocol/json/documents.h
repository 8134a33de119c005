#pragma once
// What the server sends: plain structs, and their JSON.

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/io/cloud_io.h"
#include "engine/multires/hierarchy.h"
#include "protocol/json/problem.h"
#include "protocol/json/requests.h"

namespace pointwright::protocol {

using TimePoint = std::chrono::system_clock::time_point;

/// An axis-aligned box in model space.
struct ModelBounds {
  Vec3d min = Vec3d::Zero();
  Vec3d max = Vec3d::Zero();
};

struct CloudDocument {
  std::string id;
  std::string name;
  std::string sha256;       ///< of the uploaded bytes, 64 hexadecimal digits
  std::uint64_t bytes = 0;  ///< of the upload
  TimePoint created;
  Vec3d origin = Vec3d::Zero();
  ImportReport report;  ///< sample count and bounds are taken from it
};

/// A resumable upload.
struct UploadDocument {
  std::string id;
  std::string name;        ///< of the file, as the client calls it; may be empty
  std::string media_type;  ///< as the client calls it; may be empty
  std::uint64_t length = 0;
  std::uint64_t offset = 0;
  TimePoint created;
  TimePoint expires;
};

/// As OGC API - Processes calls them.
enum class ImportState { kAccepted, kRunning, kSuccessful, kFailed };

/// A cloud on its way in, while its client goes on.
struct ImportDocument {
  std::string id;
  std::string name;         ///< of the cloud
  std::uint64_t bytes = 0;  ///< of the file
  TimePoint created;
  ImportState state = ImportState::kAccepted;
  Progress progress;
  std::optional<Problem> problem = std::nullopt;      ///< kFailed: why
  std::optional<CloudDocument> cloud = std::nullopt;  ///< kSuccessful
};

enum class SessionState { kBuilding, kReady, kFailed, kAsleep };

struct ImageDocument {
  std::string id;
  std::uint64_t width = 0;   ///< pixels
  std::uint64_t height = 0;  ///< pixels
  std::vector<std::string> channels;
  std::uint64_t bytes = 0;  ///< of the upload
  TimePoint created;
};

struct RegionSummary {
  std::uint64_t samples = 0;
  std::uint64_t operations = 0;
};
/// A region besides zero and one.
struct NamedRegionSummary {
  std::string name;
  RegionSummary region;
};

/// A session on some of its cloud's samples.
struct PreviewSize {
  std::uint64_t count = 0;
  std::uint64_t of = 0;  ///< samples of the cloud
};

/// A session in a list.
struct SessionSummary {
  std::string id;
  std::string name;
  std::string cloud;
  SessionState state = SessionState::kBuilding;
  std::uint64_t revision = 0;
  TimePoint created;
  std::uint64_t sample_count = 0;  ///< of the surface as edited; while building, what it begins with
  std::optional<PreviewSize> preview = std::nullopt;  ///< none: it has all samples of its cloud
};

struct SessionDocument {
  SessionSummary summary;
  Progress progress;
  std::optional<Problem> error = std::nullopt;  ///< kFailed: why
  Vec3d origin = Vec3d::Zero();
  ModelBounds bounds;
  double spacing = 0.0;              ///< median, model units; 0 until the session is ready
  std::vector<double> level_scales;  ///< of levels 0, 1, …, in model units; the finest has 0
  std::vector<DecompositionReport> decomposition;
  RegionSummary zero;
  RegionSummary one;
  std::vector<NamedRegionSummary> named;  ///< by name
  std::uint32_t head = 0;                 ///< edits that are applied
  std::uint32_t edits = 0;                ///< edits in the history, those undone included
  std::vector<std::pair<std::string, double>> timings_ms;
};

struct EditRecord {
  std::uint32_t index = 0;  ///< 1 for the first edit: the head that shows it
  EditParams edit;
  TimePoint created;
  std::uint64_t moved_samples = 0;
  std::uint64_t zero_samples = 0;
  std::uint64_t one_samples = 0;
  std::uint64_t inserted = 0;      ///< samples, by resampling
  std::uint64_t removed = 0;       ///< samples, by garbage collection
  std::uint64_t sample_count = 0;  ///< after the edit
  std::string surface_hash;        ///< after the edit, 64 hexadecimal digits
};

/// Someone who looks at a session.
struct Viewer {
  std::string name;  ///< as they gave it; may be empty
  TimePoint since;
};

struct InfoDocument {
  std::string version;
  std::vector<std::pair<std::string, std::uint64_t>> limits;  ///< every limit, by name
  std::vector<std::string> formats;
  std::vector<std::string> features;
  std::vector<std::string> launchers;  ///< of jobs, by name
  JsonDocument caller = {};            ///< to_json(CallerDocument)
};

std::string_view session_state_name(SessionState state);

JsonDocument to_json(const ModelBounds& bounds);
JsonDocument to_json(const ImportReport& report);
JsonDocument to_json(const CloudDocument& cloud);
JsonDocument to_json(const ImageDocument& image);
JsonDocument to_json(const UploadDocument& upload);
JsonDocument to_json(const ImportDocument& import);
JsonDocument to_json(const DecompositionReport& report);
JsonDocument to_json(const SessionSummary& session);
JsonDocument to_json(const SessionDocument& session);
JsonDocument to_json(const EditRecord& record);
JsonDocument to_json(const InfoDocument& info);
JsonDocument cloud_list(const std::vector<CloudDocument>& clouds);
JsonDocument import_list(const std::vector<ImportDocument>& imports);
JsonDocument upload_list(const std::vector<UploadDocument>& uploads);
JsonDocument image_list(const std::vector<ImageDocument>& images);
JsonDocument session_list(const std::vector<SessionSummary>& sessions);
/// {"regions"}: zero, one, and the named ones.
JsonDocument region_list(const SessionDocument& session);
/// {"region", "samples", "operations"}
JsonDocument painting_document(std::string_view region, std::uint64_t samples,
                               const std::vector<std::shared_ptr<const PaintOperation>>& operations);
/// {"head", "edits"}
JsonDocument edit_list(std::uint32_t head, const std::vector<EditRecord>& edits);

/// Events of a stream (FRAMES.md).
JsonDocument session_event(const SessionDocument& session);
JsonDocument progress_event(const Progress& progress);
JsonDocument presence_event(const std::vector<Viewer>& viewers);
JsonDocument heartbeat_event();
JsonDocument end_event(std::string_view reason);

/// The text of a document: UTF-8 without line breaks; bytes that are not UTF-8 are replaced, never thrown at.
std::string to_text(const JsonDocument& document);

/// RFC 3339 in UTC with milliseconds: "2026-01-31T12:00:00.000Z".
std::string to_rfc3339(TimePoint time);

/// A number for a document. JSON has no NaN: a LogicError unless it is finite.
double checked_number(double value);
/// A float by its shortest decimal: 0.02F is 0.02, not 0.019999999552965164.
double checked_number(float value);

}  // namespace pointwright::protocol
