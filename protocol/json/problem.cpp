#include "protocol/json/problem.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/json/documents.h"

namespace pointwright::protocol {
namespace {

using enum ProblemType;

/// In the order of the enumeration: problem_info() takes the type as the index, and a test compares them.
constexpr std::array kProblems{
    ProblemInfo{kMalformedRequest, 400, "malformed-request", "Malformed request",
                "The request line, a header, the query or the path is not what HTTP or this route takes.",
                false},
    ProblemInfo{kMalformedJson, 400, "malformed-json", "Malformed JSON",
                "The body is not JSON in UTF-8 (RFC 8259).", false},
    ProblemInfo{kEmptyBody, 400, "empty-body", "Empty body", "This route needs a body, and none came.",
                false},
    ProblemInfo{
        kForbiddenHost, 403, "forbidden-host", "Forbidden host",
        "The Host header names another server than this one. Open the address that the daemon prints.",
        false},
    ProblemInfo{kForbiddenOrigin, 403, "forbidden-origin", "Forbidden origin",
                "A page of another site tried to change something here. Only the viewer's own pages may.",
                false},
    ProblemInfo{kUnknownRoute, 404, "unknown-route", "Unknown path",
                "Nothing is at this path. /openapi.yaml lists everything that is.", false},
    ProblemInfo{kUnknownCloud, 404, "unknown-cloud", "Unknown cloud", "No cloud has this id.", false},
    ProblemInfo{kUnknownSession, 404, "unknown-session", "Unknown session", "No session has this id.", false},
    ProblemInfo{kUnknownEdit, 422, "unknown-edit", "Unknown edit",
                "The session's history has no edit of this number.", false},
    ProblemInfo{kMethodNotAllowed, 405, "method-not-allowed", "Method not allowed",
                "This path exists, but not for this method. The Allow header lists those that it takes.",
                false},
    ProblemInfo{
        kNotAcceptable, 406, "not-acceptable", "Not acceptable",
        "None of the formats that the Accept header or the format parameter asks for can be given here.",
        false},
    ProblemInfo{kRequestTimeout, 408, "request-timeout", "Request timeout",
                "The request did not arrive in full within the time that it may take.", true},
    ProblemInfo{kCloudInUse, 409, "cloud-in-use", "Cloud in use",
                "A session still works on this cloud. Delete the session first.", false},
    ProblemInfo{kSessionNotReady, 409, "session-not-ready", "Session not ready",
                "The session is still being built. Wait until its state is \"ready\".", true},
    ProblemInfo{kSessionFailed, 409, "session-failed", "Session failed",
                "The session could not be built; its document says why.", false},
    ProblemInfo{kLengthRequired, 411, "length-required", "Length required",
                "A request with a body must say its length in Content-Length.", false},
    ProblemInfo{kStaleRevision, 412, "stale-revision", "Stale revision",
                "The session has changed since the revision in If-Match; \"revision\" is the current one.",
                false},
    ProblemInfo{kBodyTooLarge, 413, "body-too-large", "Body too large",
                "The body has more bytes than this route takes; \"limit\" says how many those are.", false},
    ProblemInfo{kUriTooLong, 414, "uri-too-long", "URI too long",
                "The request's path and query are too long.", false},
    ProblemInfo{kUnsupportedMediaType, 415, "unsupported-media-type", "Unsupported media type",
                "This route does not take bodies of this Content-Type.", false},
    ProblemInfo{kUnsupportedFormat, 415, "unsupported-format", "Unsupported format",
                "The bytes are of a format, a version or a feature of one that is not read here.", false},
    ProblemInfo{
        kInvalidRequest, 422, "invalid-request", "Invalid request",
        "The JSON is well-formed but not what this route takes; \"errors\" points at every member at fault.",
        false},
    ProblemInfo{kInvalidValue, 422, "invalid-value", "Invalid value",
                "A value is outside the range that it may have.", false},
    ProblemInfo{kMalformedData, 422, "malformed-data", "Malformed data",
                "The bytes of the cloud are damaged, cut off, or not what they claim to be.", false},
    ProblemInfo{kNonFinite, 422, "non-finite", "Value that is not finite",
                "NaN or infinity stands where a finite number must. Uploads take nonfinite=drop to leave "
                "such samples "
                "out.",
                false},
    ProblemInfo{kOutOfRange, 422, "out-of-range", "Coordinates out of range",
                "Coordinates lie beyond 1e9, or so far from zero that their differences are lost.", false},
    ProblemInfo{kTooLarge, 422, "too-large", "Too large",
                "The data holds, or claims to hold, more than a limit of this server allows.", false},
    ProblemInfo{kEmptyCloud, 422, "empty-cloud", "Empty cloud", "The cloud has no sample.", false},
    ProblemInfo{
        kEmptyRegion, 422, "empty-region", "Empty region",
        "An edit needs at least one sample in the zero-region and one in the one-region. Paint them first.",
        false},
    ProblemInfo{
        kRegionsIntersect, 422, "regions-intersect", "Regions intersect",
        "The zero-region and the one-region share samples. Remove them from one of the two, or paint with "
        "\"steal\".",
        false},
    ProblemInfo{
        kDecoderLimit, 422, "decoder-limit", "Decoder limit",
        "The confined decoder ran out of the time or memory that one file may take, or was stopped while "
        "reading it.",
        false},
    ProblemInfo{kPreconditionRequired, 428, "precondition-required", "Precondition required",
                "An edit names the revision that it was made for: If-Match: \"r<revision>\".", false},
    ProblemInfo{kTooManyRequests, 429, "too-many-requests", "Too many requests",
                "More is going on than one client may have at a time.", true},
    ProblemInfo{kHeadersTooLarge, 431, "headers-too-large", "Headers too large",
                "The request's headers are longer than this server takes.", false},
    ProblemInfo{
        kInternalError, 500, "internal-error", "Internal error",
        "Something is wrong with the server, not with the request. Its log has the details under the request "
        "id.",
        false},
    ProblemInfo{kNotImplemented, 501, "not-implemented", "Not implemented",
                "HTTP knows this method, this server does not.", false},
    ProblemInfo{kOverloaded, 503, "overloaded", "Overloaded",
                "The server is at one of its limits. Try again after the seconds in Retry-After.", true},
    ProblemInfo{kCancelled, 503, "cancelled", "Cancelled",
                "The work was cancelled before it was done; nothing changed.", true},
    ProblemInfo{kShuttingDown, 503, "shutting-down", "Shutting down",
                "The server is stopping, or not yet ready. Try again after the seconds in Retry-After.",
                true},
};

/// JSON has one kind of number; whole ones are printed as such.
JsonDocument number_document(double value) {
  constexpr double kExact = 9007199254740992.0;  // 2^53
  if (std::abs(value) < kExact && value == std::floor(value)) return static_cast<std::int64_t>(value);
  return checked_number(value);
}

}  // namespace

const ProblemInfo& problem_info(ProblemType type) {
  return kProblems.at(static_cast<std::size_t>(type));
}

std::span<const ProblemInfo> all_problems() {
  return kProblems;
}

const ProblemInfo* find_problem(std::string_view slug) {
  const auto* const row = std::find_if(kProblems.begin(), kProblems.end(),
                                       [&](const ProblemInfo& problem) { return problem.slug == slug; });
  return row == kProblems.end() ? nullptr : row;
}

ProblemType problem_of(ErrorCode code) {
  switch (code) {  // no default: a new code must be given its problem here
    case ErrorCode::kInvalidArgument:
      return kInvalidValue;
    case ErrorCode::kMalformedData:
      return kMalformedData;
    case ErrorCode::kUnsupportedFormat:
      return kUnsupportedFormat;
    case ErrorCode::kNonFinite:
      return kNonFinite;
    case ErrorCode::kOutOfRange:
      return kOutOfRange;
    case ErrorCode::kTooLarge:
      return kTooLarge;
    case ErrorCode::kEmptyCloud:
      return kEmptyCloud;
    case ErrorCode::kEmptyRegion:
      return kEmptyRegion;
    case ErrorCode::kRegionsIntersect:
      return kRegionsIntersect;
    case ErrorCode::kCancelled:
      return kCancelled;
  }
  throw LogicError("an error code that is none");
}

Problem to_problem(const Error& error) {
  Problem problem{.type = problem_of(error.code), .detail = error.message};
  problem.limit = error.limit;
  problem.actual = error.actual;
  if (!error.field.empty()) {
    problem.errors.push_back({.pointer = pointer_of_field(error.field), .detail = error.message});
  }
  return problem;
}

Problem to_problem(const JsonErrors& errors) {
  Problem problem{.type = kInvalidRequest, .detail = errors.summary()};
  switch (errors.kind) {
    case JsonErrorKind::kMalformed:
      problem.type = kMalformedJson;
      break;
    case JsonErrorKind::kTooLarge:
      problem.type = kBodyTooLarge;
      break;
    case JsonErrorKind::kInvalid:
      problem.errors = errors.faults;
      break;
  }
  problem.limit = errors.limit;
  problem.actual = errors.actual;
  return problem;
}

JsonDocument to_json(const Problem& problem) {
  const ProblemInfo& info = problem_info(problem.type);
  JsonDocument document{{"type", "/problems/" + std::string(info.slug)},
                        {"title", info.title},
                        {"status", info.status},
                        {"detail", problem.detail},
                        {"instance", problem.instance},
                        {"request_id", problem.request_id}};
  if (!problem.errors.empty()) {
    JsonDocument errors = JsonDocument::array();
    for (const JsonFault& fault : problem.errors) {
      errors.push_back(JsonDocument{{"pointer", fault.pointer}, {"detail", fault.detail}});
    }
    document["errors"] = std::move(errors);
  }
  if (problem.limit) document["limit"] = number_document(*problem.limit);
  if (problem.actual) document["actual"] = number_document(*problem.actual);
  if (problem.revision) document["revision"] = *problem.revision;
  return document;
}

}  // namespace pointwright::protocol
