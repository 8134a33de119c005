#include "server/handlers/handlers.h"

namespace pointwright::server {
namespace {

/// The region that the second capture names; the route lets only known names through.
RegionKind region_of(const Request& request) {
  return protocol::region_of_name(request.captures.at(1)).value();
}

/// Puts in what an operation's shape names by its id: an image or a cloud. `pointer`: to the operation.
/// Problem: kInvalidValue where there is no such thing, or no texture coordinates to map an image by
Outcome<Done> find_data(const Service& service, const Session& session, const std::string& pointer,
                        PaintOperation& operation) {
  const auto refused = [&](const char* member, const char* detail) {
    return Problem{.kind = ProblemKind::kInvalidValue,
                   .detail = detail,
                   .errors = {{.pointer = pointer + member, .detail = detail}}};
  };
  if (auto* shape = std::get_if<ImageShape>(&operation.shape)) {
    const SharedImage image = service.images.find(shape->source);
    if (image == nullptr) return refused("/shape/image", "there is no such image");
    shape->image = image->image;
  }
  if (auto* shape = std::get_if<ModelShape>(&operation.shape)) {
    const SharedCloud cloud = service.clouds.find(shape->source);
    if (cloud == nullptr) return refused("/shape/cloud", "there is no such cloud");
    shape->cloud = cloud->cloud;
  }
  if (needs_texcoord(operation.shape) && session.cloud().texcoord.empty())
    return refused("/shape/projection", "the session's cloud has no texture coordinates");
  return Done{};
}

}  // namespace

Response get_painting(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const SharedDocument document = session.value()->document();
  if (document->state != protocol::SessionState::kReady)
    return problem_response({.kind = ProblemKind::kWrongState, .detail = "the session is not ready"},
                            request);
  const Painting& painting = document->painting(region_of(request));
  return json_response(
             protocol::painting_document(region_of(request), painting.samples, *painting.operations))
      .with_header("ETag", revision_tag(document->revision));
}

Response replace_painting(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  auto operations = parsed_body(service, request, protocol::parse_painting);
  if (!operations.ok()) return problem_response(operations.problem(), request);
  for (std::size_t i = 0; i < operations.value().size(); ++i) {
    const auto found =
        find_data(service, *session.value(), "/operations/" + std::to_string(i), operations.value()[i]);
    if (!found.ok()) return problem_response(found.problem(), request);
  }
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto painted =
      session.value()->replace_painting(region_of(request), std::move(operations.value()), expected.value());
  if (!painted.ok()) return problem_response(painted.problem(), request);
  return session_response(*session.value(), *painted.value().document);
}

Response clear_painting(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto painted = session.value()->replace_painting(region_of(request), {}, expected.value());
  if (!painted.ok()) return problem_response(painted.problem(), request);
  return session_response(*session.value(), *painted.value().document);
}

Response paint_region(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  auto operation = parsed_body(service, request, protocol::parse_paint_operation);
  if (!operation.ok()) return problem_response(operation.problem(), request);
  if (const auto found = find_data(service, *session.value(), "", operation.value()); !found.ok())
    return problem_response(found.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto painted = session.value()->paint(region_of(request), operation.value(), expected.value());
  if (!painted.ok()) return problem_response(painted.problem(), request);
  const Document& document = *painted.value().document;
  protocol::JsonDocument body = protocol::to_json(session.value()->describe(document));
  body["changed"] = painted.value().changed;
  return json_response(body).with_header("ETag", revision_tag(document.revision));
}

}  // namespace pointwright::server
