#include "server/http/error_map.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace pointwright::server {

const ProblemInfo& problem_info(ProblemKind kind) {
  // One case for each kind and no default: a new kind without its row does not compile without a warning.
#define POINTWRIGHT_PROBLEM(name, status, slug, title, explanation, retryable)       \
  case ProblemKind::name: {                                                          \
    static constexpr ProblemInfo kInfo{status, slug, title, explanation, retryable}; \
    return kInfo;                                                                    \
  }
  switch (kind) {
    POINTWRIGHT_PROBLEM(
        kMalformedRequest, 400, "malformed-request", "The request is malformed",
        "The head or the query of the request is not well-formed HTTP/1.1, or says two things at once.",
        false)
    POINTWRIGHT_PROBLEM(
        kMalformedJson, 400, "malformed-json", "The body is not JSON",
        "The body is not a JSON document: a syntax error, invalid UTF-8, or nesting beyond the limit.", false)
    POINTWRIGHT_PROBLEM(
        kInvalidValue, 422, "invalid-value", "A value is not acceptable",
        "The document is well-formed, but a member is missing, unknown, repeated, of the wrong type or out "
        "of range. `errors` points at each.",
        false)
    POINTWRIGHT_PROBLEM(
        kHostNotAllowed, 403, "host-not-allowed", "Host not allowed",
        "The Host header names neither a loopback name nor one that the operator allowed. This protects "
        "local servers against DNS rebinding.",
        false)
    POINTWRIGHT_PROBLEM(
        kOriginNotAllowed, 403, "origin-not-allowed", "Origin not allowed",
        "A page of another origin asked for a change. Only the server's own pages, and programs that send "
        "no Origin, may.",
        false)
    POINTWRIGHT_PROBLEM(kNotFound, 404, "not-found", "Not found",
                        "There is nothing under this path: the id is unknown, or what it named was deleted.",
                        false)
    POINTWRIGHT_PROBLEM(kMethodNotAllowed, 405, "method-not-allowed", "Method not allowed",
                        "The resource exists but does not take this method; Allow lists those it takes.",
                        false)
    POINTWRIGHT_PROBLEM(kRequestTimeout, 408, "request-timeout", "The request came too slowly",
                        "The head or the body did not arrive within its deadline.", false)
    POINTWRIGHT_PROBLEM(kWrongState, 409, "wrong-state", "Not possible in this state",
                        "The session is not ready: it is still building, or its building failed.", false)
    POINTWRIGHT_PROBLEM(kCloudInUse, 409, "cloud-in-use", "The cloud is in use",
                        "A session still uses the cloud; delete the session first.", false)
    POINTWRIGHT_PROBLEM(kLengthRequired, 411, "length-required", "Content-Length is required",
                        "Bodies need a Content-Length; chunked bodies are not accepted.", false)
    POINTWRIGHT_PROBLEM(kStaleRevision, 412, "stale-revision", "The session has moved on",
                        "If-Match names a revision that is no longer the current one; `revision` is.", false)
    POINTWRIGHT_PROBLEM(kBodyTooLarge, 413, "body-too-large", "The body is too large",
                        "The body exceeds the limit of its route. /v1/info lists the limits.", false)
    POINTWRIGHT_PROBLEM(kPathTooLong, 414, "path-too-long", "The path is too long",
                        "The path exceeds its limit.", false)
    POINTWRIGHT_PROBLEM(kUnsupportedMediaType, 415, "unsupported-media-type", "Unsupported media type",
                        "The Content-Type is not one that the route takes, or the body is compressed.", false)
    POINTWRIGHT_PROBLEM(kRangeNotSatisfiable, 416, "range-not-satisfiable", "Range not satisfiable",
                        "More than one range was asked for.", false)
    POINTWRIGHT_PROBLEM(kExpectationFailed, 417, "expectation-failed", "Expectation failed",
                        "The Expect header asks for something else than 100-continue.", false)
    POINTWRIGHT_PROBLEM(kRevisionRequired, 428, "revision-required", "If-Match is required",
                        "Edits name the revision that they build on: If-Match: \"r<revision>\".", false)
    POINTWRIGHT_PROBLEM(
        kTooMany, 429, "too-many", "A quota is used up",
        "One more of these would exceed a quota; delete some first. /v1/info lists the limits.", true)
    POINTWRIGHT_PROBLEM(kHeadTooLarge, 431, "head-too-large", "The request head is too large",
                        "The request line and headers exceed their limits in bytes or number.", false)
    POINTWRIGHT_PROBLEM(kInternalError, 500, "internal-error", "Internal error",
                        "The server failed. The log holds the details under the request id.", false)
    POINTWRIGHT_PROBLEM(kNotImplemented, 501, "not-implemented", "Not implemented",
                        "The method or transfer coding is unknown to this server.", false)
    POINTWRIGHT_PROBLEM(
        kOverloaded, 503, "overloaded", "The server is busy",
        "Connections, streams or decoders are all in use, or the server is stopping. Retry later.", true)
    POINTWRIGHT_PROBLEM(kHttpVersion, 505, "http-version-not-supported", "HTTP version not supported",
                        "This server speaks HTTP/1.1.", false)
    POINTWRIGHT_PROBLEM(
        kOutOfSpace, 507, "out-of-space", "No room left",
        "The memory that the operator granted to clouds and sessions is used up; delete some first.", true)
    POINTWRIGHT_PROBLEM(
        kMalformedCloud, 422, "malformed-cloud", "The file is damaged",
        "The bytes are not what they claim to be: truncated, inconsistent, or not a point cloud.", false)
    POINTWRIGHT_PROBLEM(kUnsupportedFormat, 415, "unsupported-format", "The format is not supported",
                        "The bytes are in a format, version or encoding that this server does not read.",
                        false)
    POINTWRIGHT_PROBLEM(
        kNonFinite, 422, "non-finite", "A number is not finite",
        "NaN or infinity stands where a finite number is owed. Uploads take ?nonfinite=drop to leave such "
        "samples out.",
        false)
    POINTWRIGHT_PROBLEM(kOutOfRange, 422, "out-of-range", "Coordinates out of range",
                        "Coordinates beyond 1e9, or an extent too small for its distance from the origin.",
                        false)
    POINTWRIGHT_PROBLEM(kTooManySamples, 413, "limit-exceeded", "A limit is exceeded",
                        "The content exceeds a stated limit; `limit` and `actual` say by how much.", false)
    POINTWRIGHT_PROBLEM(kEmptyCloud, 422, "empty-cloud", "The cloud is empty",
                        "The file holds no sample at all.", false)
    POINTWRIGHT_PROBLEM(kEmptyRegion, 422, "empty-region", "A region is empty",
                        "An edit needs at least one sample in the zero-region and one in the one-region.",
                        false)
    POINTWRIGHT_PROBLEM(kRegionsIntersect, 422, "regions-intersect", "The regions intersect",
                        "The zero- and the one-region must not meet: a sample is in both, or two coincide.",
                        false)
    POINTWRIGHT_PROBLEM(kCancelled, 409, "cancelled", "The work was cancelled",
                        "The session was deleted, or the server is stopping.", false)
  }
#undef POINTWRIGHT_PROBLEM
  throw LogicError("an unknown kind of problem");
}

Response problem_response(const Problem& problem, std::string_view instance, std::string_view request_id) {
  const ProblemInfo& info = problem_info(problem.kind);
  nlohmann::ordered_json document = {{"type", "/problems/" + std::string(info.slug)},
                                     {"title", info.title},
                                     {"status", info.status},
                                     {"detail", problem.detail},
                                     {"instance", instance},
                                     {"request_id", request_id}};
  if (!problem.errors.empty()) {
    auto& errors = document["errors"] = nlohmann::ordered_json::array();
    for (const auto& [pointer, detail] : problem.errors)
      errors.push_back({{"pointer", pointer}, {"detail", detail}});
  }
  const auto whole_or_real = [](double value) -> nlohmann::ordered_json {
    if (value == std::floor(value) && std::abs(value) < 9e15) return static_cast<std::int64_t>(value);
    return value;
  };
  if (problem.limit && std::isfinite(*problem.limit)) document["limit"] = whole_or_real(*problem.limit);
  if (problem.actual && std::isfinite(*problem.actual)) document["actual"] = whole_or_real(*problem.actual);
  if (problem.revision) document["revision"] = *problem.revision;
  Response response{
      .status = info.status, .content_type = "application/problem+json", .headers = problem.headers};
  if (info.retryable) response.with_header("Retry-After", "2");
  response.body = document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  return response;
}

}  // namespace pointwright::server
