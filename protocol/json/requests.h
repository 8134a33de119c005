#pragma once
// What clients send: JSON documents to engine values, checked in full, and back.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/editing/edit.h"
#include "engine/editing/painting.h"
#include "engine/editing/shape.h"
#include "engine/io/cloud_io.h"
#include "engine/multires/hierarchy.h"
#include "protocol/json/parse.h"

namespace pointwright::protocol {

/// A document that we send: members stay in the order in which they were put in.
using JsonDocument = nlohmann::ordered_json;

/// POST /v1/sessions
struct CreateSessionRequest {
  std::string cloud;  ///< an id
  std::string name;   ///< empty where none was given
  HierarchyParams params;
  std::optional<std::uint64_t> preview = std::nullopt;  ///< of so many of the cloud's samples; none: all
};

/// POST /v1/clouds with a document
struct ImportCloudRequest {
  std::string upload;               ///< an id
  std::optional<std::string> name;  ///< none: the file's
  bool drop_non_finite = false;
  std::optional<CloudFormat> format;  ///< none: found by looking
};

/// PUT and POST …/preview
struct PreviewRequest {
  EditParams edit;
  std::uint64_t sequence = 0;  ///< the sender's own number, 1 to 2^53 - 1
};

/// PUT …/head
struct HeadRequest {
  std::uint32_t edit = 0;  ///< how many edits stay applied; 0: none
};

/// PATCH of a session
struct SessionChange {
  std::string name;
};

/// Operations that one painting may have.
inline constexpr std::size_t kMaxPaintOperations = 10'000;

/// Document to value. Errors list every fault with its pointer. The engine's own validate() has passed on
/// what comes back, except for what needs a session to know (whether the level, the cloud, the edit exist).
Parsed<PaintOperation> parse_paint_operation(const Json& document);
Parsed<std::vector<PaintOperation>> parse_painting(const Json& document);  ///< {"operations": [...]}
Parsed<EditParams> parse_edit(const Json& document);
Parsed<PreviewRequest> parse_preview(const Json& document);
Parsed<CreateSessionRequest> parse_create_session(const Json& document);
Parsed<ImportCloudRequest> parse_import_cloud(const Json& document);
Parsed<HeadRequest> parse_head(const Json& document);
Parsed<SessionChange> parse_session_change(const Json& document);

/// Text to value in one step: parse_body(body, limits, parse_edit).
template <typename T>
Parsed<T> parse_body(std::string_view body, const ParseLimits& limits, Parsed<T> (*parse)(const Json&)) {
  auto document = parse_json(body, limits);
  if (!document) return document.errors();
  return parse(document.value());
}

/// Value to document: what the parsers above read back, to the bit.
JsonDocument to_json(const Vec3d& vector);
JsonDocument to_json(const Shape& shape);
JsonDocument to_json(const PaintOperation& operation);
JsonDocument to_json(const Deformation& deformation);
JsonDocument to_json(const ResamplingParams& resampling);
JsonDocument to_json(const EditParams& edit);

std::string_view blend_name(Blend blend);         ///< "quartic"
std::string_view region_name(RegionKind region);  ///< "zero", "one"
std::optional<RegionKind> region_of_name(std::string_view name);
/// Names of regions besides zero and one: 1 to 64 of A-Z, a-z, 0-9, _, space, dot and dash; not "zero",
/// "one", "t", "." and "..".
bool is_valid_region_name(std::string_view name);

/// Where in a request document the field of an engine error stands: "deformation.axis" of an edit is
/// "/deformation/axis/direction".
std::string pointer_of_field(std::string_view field);

/// Names of clouds and sessions: 1 to 120 bytes of UTF-8 without control characters.
bool is_valid_name(std::string_view name);
/// Characters of an id.
inline constexpr std::size_t kIdLength = 22;
/// Ids of clouds and sessions: [A-Za-z0-9_-]{22}.
bool is_valid_id(std::string_view id);

/// Angles are degrees on the wire. to_degrees(to_radians(d)) leads back to the same radians, to the bit.
double to_radians(double degrees);
double to_degrees(double radians);

}  // namespace pointwright::protocol
