#include "protocol/json/problem.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pointwright::protocol {
namespace {

using enum ProblemKind;

/// In the order of the enumeration: problem_info() takes the kind as the index, and a test compares them.
constexpr std::array kProblems{
    ProblemInfo{
        kMalformedRequest, 400, "malformed-request", "The request is malformed",
        "The head or the query of the request is not well-formed HTTP/1.1, or says two things at once.",
        false},
    ProblemInfo{kMalformedJson, 400, "malformed-json", "The body is not JSON",
                "The body is not a JSON document: a syntax error or invalid UTF-8.", false},
    ProblemInfo{kEmptyBody, 400, "empty-body", "The body is empty", "This route needs a body, and none came.",
                false},
    ProblemInfo{kInvalidValue, 422, "invalid-value", "A value is not acceptable",
                "The document is well-formed, but a member is missing, unknown, repeated, nested too deep, "
                "of the wrong type "
                "or out of range. \"errors\" points at each.",
                false},
    ProblemInfo{kHostNotAllowed, 403, "host-not-allowed", "Host not allowed",
                "The Host header names neither a loopback name nor one that the operator allowed. This "
                "protects local servers against DNS rebinding.",
                false},
    ProblemInfo{kOriginNotAllowed, 403, "origin-not-allowed", "Origin not allowed",
                "A page of another origin asked for a change. Only the server's own pages, and programs that "
                "send no Origin, may.",
                false},
    ProblemInfo{
        kUnauthorized, 401, "unauthorized", "A token is needed",
        "The request carries no token, or one that is unknown, expired or revoked: Authorization: Bearer "
        "<token>.",
        false},
    ProblemInfo{kForbidden, 403, "forbidden", "The token does not permit this",
                "The scope of the token (view, edit or admin) or of the share link does not reach so far.",
                false},
    ProblemInfo{kNotFound, 404, "not-found", "Not found",
                "There is nothing under this path: the id is unknown, or what it named was deleted.", false},
    ProblemInfo{kMethodNotAllowed, 405, "method-not-allowed", "Method not allowed",
                "The resource exists but does not take this method; Allow lists those it takes.", false},
    ProblemInfo{
        kNotAcceptable, 406, "not-acceptable", "Not acceptable",
        "None of the formats that the Accept header or the format parameter asks for can be given here.",
        false},
    ProblemInfo{kRequestTimeout, 408, "request-timeout", "The request came too slowly",
                "The head or the body did not arrive within its deadline.", false},
    ProblemInfo{kWrongState, 409, "wrong-state", "Not possible in this state",
                "The session is not ready: it is still building, or its building failed. An upload is not "
                "complete: bytes of it are still owed.",
                false},
    ProblemInfo{kCloudInUse, 409, "cloud-in-use", "The cloud is in use",
                "A session still uses the cloud; delete the session first.", false},
    ProblemInfo{kUploadOffset, 409, "upload-offset", "The upload stands elsewhere",
                "Upload-Offset is not the number of bytes that the server has; HEAD tells that number.",
                false},
    ProblemInfo{kLengthRequired, 411, "length-required", "Content-Length is required",
                "Bodies need a Content-Length; chunked bodies are not accepted.", false},
    ProblemInfo{kStaleRevision, 412, "stale-revision", "The session has moved on",
                "If-Match names a revision that is no longer the current one; \"revision\" is.", false},
    ProblemInfo{kTusVersion, 412, "tus-version", "Another tus version is asked for",
                "Requests to uploads carry Tus-Resumable: 1.0.0; Tus-Version lists what this server speaks.",
                false},
    ProblemInfo{kBodyTooLarge, 413, "body-too-large", "The body is too large",
                "The body exceeds the limit of its route. /v1/info lists the limits.", false},
    ProblemInfo{kPathTooLong, 414, "path-too-long", "The path is too long", "The path exceeds its limit.",
                false},
    ProblemInfo{kUnsupportedMediaType, 415, "unsupported-media-type", "Unsupported media type",
                "The Content-Type is not one that the route takes, or the body is compressed.", false},
    ProblemInfo{kRangeNotSatisfiable, 416, "range-not-satisfiable", "Range not satisfiable",
                "More than one range was asked for.", false},
    ProblemInfo{kExpectationFailed, 417, "expectation-failed", "Expectation failed",
                "The Expect header asks for something else than 100-continue.", false},
    ProblemInfo{kUploadLocked, 423, "upload-locked", "The upload is in use",
                "Another request writes to this upload, or it is being imported. Retry later.", true},
    ProblemInfo{kRevisionRequired, 428, "revision-required", "If-Match is required",
                "Edits name the revision that they build on: If-Match: \"r<revision>\".", false},
    ProblemInfo{
        kTooMany, 429, "too-many", "A quota is used up",
        "One more of these would exceed a quota. Retry-After says when there is room again; without it, "
        "delete some first. /v1/info lists the limits.",
        false},
    ProblemInfo{kHeadTooLarge, 431, "head-too-large", "The request head is too large",
                "The request line and headers exceed their limits in bytes or number.", false},
    ProblemInfo{
        kChecksumMismatch, 460, "checksum-mismatch", "The checksum does not match",
        "The bytes that came do not have the checksum that Upload-Checksum names; none of them is kept.",
        false},
    ProblemInfo{kInternalError, 500, "internal-error", "Internal error",
                "The server failed. The log holds the details under the request id.", false},
    ProblemInfo{kNotImplemented, 501, "not-implemented", "Not implemented",
                "The method or transfer coding is unknown to this server.", false},
    ProblemInfo{kOverloaded, 503, "overloaded", "The server is busy",
                "Connections, streams or decoders are all in use, or the server is stopping. Retry later.",
                true},
    ProblemInfo{kHttpVersion, 505, "http-version-not-supported", "HTTP version not supported",
                "This server speaks HTTP/1.1.", false},
    ProblemInfo{
        kOutOfSpace, 507, "out-of-space", "No room left",
        "The memory that the operator granted to clouds and sessions is used up, or the disk is full; "
        "delete some first.",
        true},
    ProblemInfo{kMalformedCloud, 422, "malformed-cloud", "The file is damaged",
                "The bytes are not what they claim to be: truncated, inconsistent, or neither a point cloud "
                "nor an image.",
                false},
    ProblemInfo{kUnsupportedFormat, 415, "unsupported-format", "The format is not supported",
                "The bytes are in a format, version or encoding that this server does not read.", false},
    ProblemInfo{kNonFinite, 422, "non-finite", "A number is not finite",
                "NaN or infinity stands where a finite number is owed. Uploads take ?nonfinite=drop to leave "
                "such samples out.",
                false},
    ProblemInfo{kOutOfRange, 422, "out-of-range", "Coordinates out of range",
                "Coordinates beyond 1e9, or an extent too small for its distance from the origin.", false},
    ProblemInfo{kTooManySamples, 413, "limit-exceeded", "A limit is exceeded",
                "The content exceeds a stated limit; \"limit\" and \"actual\" say by how much.", false},
    ProblemInfo{kEmptyCloud, 422, "empty-cloud", "The cloud is empty", "The file holds no sample at all.",
                false},
    ProblemInfo{kEmptyRegion, 422, "empty-region", "A region is empty",
                "An edit needs at least one sample in the zero-region and one in the one-region.", false},
    ProblemInfo{kRegionsIntersect, 422, "regions-intersect", "The regions intersect",
                "The zero- and the one-region must not meet: a sample is in both, or two coincide.", false},
    ProblemInfo{
        kOutOfDisk, 507, "out-of-disk", "The disk is full",
        "Nothing was changed, and nothing that was acknowledged is lost. Reading goes on; changes are "
        "possible again once the operator has made room.",
        true},
    ProblemInfo{
        kStorageFailed, 503, "storage-failed", "The disk has failed",
        "The disk did not take what was written to it. Nothing more is acknowledged until the operator "
        "has looked into it and started the server again; reading goes on.",
        true},
    ProblemInfo{kDamaged, 409, "damaged", "What is stored is damaged",
                "What was read from the disk is not what was written, or does not lead to the surface that "
                "was acknowledged. It was put aside and is not served; everything else is unharmed.",
                false},
    ProblemInfo{kKeyInUse, 409, "key-in-use", "The first request is still under way",
                "A request with the same Idempotency-Key is being answered. Ask again for its answer.", true},
    ProblemInfo{
        kKeyReused, 422, "key-reused", "The key belongs to another request",
        "The Idempotency-Key came with another method, path or body before. A new request needs a key "
        "of its own.",
        false},
    ProblemInfo{kCancelled, 409, "cancelled", "The work was cancelled",
                "The session was deleted, or the server is stopping.", false},
};

/// JSON has one kind of number; whole ones are printed as such.
JsonDocument number_document(double value) {
  constexpr double kExact = 9007199254740992.0;  // 2^53
  if (std::abs(value) < kExact && value == std::floor(value)) return static_cast<std::int64_t>(value);
  return value;
}

}  // namespace

const ProblemInfo& problem_info(ProblemKind kind) {
  return kProblems.at(static_cast<std::size_t>(kind));
}

std::span<const ProblemInfo> all_problems() {
  return kProblems;
}

const ProblemInfo* find_problem(std::string_view slug) {
  const auto* const row = std::find_if(kProblems.begin(), kProblems.end(),
                                       [&](const ProblemInfo& problem) { return problem.slug == slug; });
  return row == kProblems.end() ? nullptr : row;
}

ProblemKind problem_of(ErrorCode code) {
  switch (code) {  // no default: a new code must be given its problem here
    case ErrorCode::kInvalidArgument:
      return kInvalidValue;
    case ErrorCode::kMalformedData:
      return kMalformedCloud;
    case ErrorCode::kUnsupportedFormat:
      return kUnsupportedFormat;
    case ErrorCode::kNonFinite:
      return kNonFinite;
    case ErrorCode::kOutOfRange:
      return kOutOfRange;
    case ErrorCode::kTooLarge:
      return kTooManySamples;
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
  Problem problem{.kind = problem_of(error.code), .detail = error.message};
  problem.limit = error.limit;
  problem.actual = error.actual;
  if (!error.field.empty()) {
    problem.errors.push_back({.pointer = pointer_of_field(error.field), .detail = error.message});
  }
  return problem;
}

Problem to_problem(const JsonErrors& errors) {
  Problem problem{.kind = kInvalidValue, .detail = errors.summary()};
  switch (errors.kind) {
    case JsonErrorKind::kMalformed:
      problem.kind = kMalformedJson;
      break;
    case JsonErrorKind::kTooLarge:
      problem.kind = kBodyTooLarge;
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
  const ProblemInfo& info = problem_info(problem.kind);
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
  if (problem.limit && std::isfinite(*problem.limit)) document["limit"] = number_document(*problem.limit);
  if (problem.actual && std::isfinite(*problem.actual)) document["actual"] = number_document(*problem.actual);
  if (problem.revision) document["revision"] = *problem.revision;
  return document;
}

}  // namespace pointwright::protocol
