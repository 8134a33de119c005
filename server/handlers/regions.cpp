#include "server/handlers/handlers.h"
#include "server/handlers/shape_data.h"

namespace pointwright::server {
namespace {

/// The region that the second capture names; the route lets only good names through.
RegionId region_of(const Request& request) {
  return RegionId(request.captures.at(1));
}

/// Null where there is none of that name.
const Painting* painting_of(const Document& document, const RegionId& region) {
  if (region.kind) return &document.painting(*region.kind);
  if (document.named == nullptr) return nullptr;
  const auto found = document.named->find(region.name);
  return found == document.named->end() ? nullptr : &found->second.painting;
}

Response not_ready(const Request& request) {
  return problem_response({.kind = ProblemKind::kWrongState, .detail = "the session is not ready"}, request);
}

}  // namespace

Response list_regions(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const SharedDocument document = session.value()->document();
  if (document->state != protocol::SessionState::kReady) return not_ready(request);
  return json_response(protocol::region_list(session.value()->describe(*document)))
      .with_header("ETag", revision_tag(document->revision));
}

Response get_painting(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const SharedDocument document = session.value()->document();
  if (document->state != protocol::SessionState::kReady) return not_ready(request);
  const RegionId region = region_of(request);
  const Painting* const painting = painting_of(*document, region);
  if (painting == nullptr)
    return problem_response(
        {.kind = ProblemKind::kNotFound, .detail = "the session has no region of that name"}, request);
  return json_response(protocol::painting_document(region.name, painting->samples, *painting->operations))
      .with_header("ETag", revision_tag(document->revision));
}

Response replace_painting(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  auto operations = parsed_body(request, protocol::parse_painting, large_limits(service));
  if (!operations.ok()) return problem_response(operations.problem(), request);
  if (const auto found =
          find_data(service, request.caller, *session.value(), "/operations", operations.value());
      !found.ok())
    return problem_response(found.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto painted =
      session.value()->replace_painting(region_of(request), operations.value(), expected.value());
  if (!painted.ok()) return problem_response(painted.problem(), request);
  return session_response(*session.value(), *painted.value().document);
}

Response clear_painting(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const RegionId region = region_of(request);
  const auto painted = region.kind ? session.value()->replace_painting(region, {}, expected.value())
                                   : session.value()->remove_region(region.name, expected.value());
  if (!painted.ok()) return problem_response(painted.problem(), request);
  return session_response(*session.value(), *painted.value().document);
}

Response paint_region(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  auto operation = parsed_body(service, request, protocol::parse_paint_operation);
  if (!operation.ok()) return problem_response(operation.problem(), request);
  if (const auto found = find_data(service, request.caller, *session.value(), "", operation.value());
      !found.ok())
    return problem_response(found.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto answer = [&session](const Session::Painted& done) {
    protocol::JsonDocument body = protocol::to_json(session.value()->describe(*done.document));
    body["changed"] = done.changed;
    return json_response(body).with_header("ETag", revision_tag(done.document->revision));
  };
  const auto painted = session.value()->paint(region_of(request), operation.value(), expected.value(),
                                              sealed<Session::Painted>(request, answer));
  if (!painted.ok()) return problem_response(painted.problem(), request);
  return answer_of(request, painted.value(), answer);
}

}  // namespace pointwright::server
