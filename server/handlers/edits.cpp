#include <chrono>

#include "server/handlers/handlers.h"
#include "server/sessions/amend.h"

namespace pointwright::server {
namespace {

protocol::EditRecord record_document(const RecordedEdit& record) {
  return {.index = static_cast<std::uint32_t>(record.index),
          .edit = record.params,
          .created = record.created,
          .moved_samples = record.moved_samples,
          .zero_samples = record.zero_samples,
          .one_samples = record.one_samples,
          .inserted = record.change.inserted,
          .removed = record.change.removed,
          .sample_count = record.sample_count,
          .surface_hash = record.surface_hash};
}

/// The number of an edit that the second capture is; the route lets only digits through.
std::size_t edit_of(const Request& request) {
  return static_cast<std::size_t>(std::stoul(request.captures.at(1)));
}

Response amended(Service& service, const Request& request, const std::optional<EditParams>& params) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto revision = required_revision(request.head);
  if (!revision.ok()) return problem_response(revision.problem(), request);
  const auto begin = std::chrono::steady_clock::now();
  const auto answer = [&session](const SharedDocument& document) {
    return session_response(*session.value(), *document);
  };
  const auto seal = sealed<SharedDocument>(request, answer);
  const auto done = computed(service.background, [&] {
    return amend(*session.value(), edit_of(request), params, revision.value(), seal);
  });
  if (!done.ok()) return problem_response(done.problem(), request);
  if (!done.value().ok()) return problem_response(done.value().problem(), request);
  Response response = answer_of(request, done.value().value(), answer);
  response.timings.emplace_back(
      "replay", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response;
}

}  // namespace

Response list_edits(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const SharedDocument document = session.value()->document();
  std::vector<protocol::EditRecord> records;
  if (document->edits != nullptr)
    for (const auto& record : *document->edits) records.push_back(record_document(*record));
  return json_response(protocol::edit_list(static_cast<std::uint32_t>(document->head), records))
      .with_header("ETag", revision_tag(document->revision));
}

Response post_edit(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto revision = required_revision(request.head);
  if (!revision.ok()) return problem_response(revision.problem(), request);
  const auto edit = parsed_body(service, request, protocol::parse_edit);
  if (!edit.ok()) return problem_response(edit.problem(), request);
  const auto begin = std::chrono::steady_clock::now();
  const auto answer = [](const Session::Committed& made) {
    return json_response(protocol::to_json(record_document(*made.record)), 201)
        .with_header("ETag", revision_tag(made.document->revision));
  };
  const auto committed =
      session.value()->commit(edit.value(), revision.value(), sealed<Session::Committed>(request, answer));
  if (!committed.ok()) return problem_response(committed.problem(), request);
  Response response = answer_of(request, committed.value(), answer);
  response.timings.emplace_back(
      "edit", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response;
}

Response get_edit(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const SharedDocument document = session.value()->document();
  const std::size_t edit = edit_of(request);
  if (document->edits == nullptr || edit == 0 || edit > document->edits->size())
    return problem_response({.kind = ProblemKind::kNotFound, .detail = "the history has no such edit"},
                            request);
  return json_response(protocol::to_json(record_document(*(*document->edits)[edit - 1])))
      .with_header("ETag", revision_tag(document->revision));
}

Response put_edit(Service& service, const Request& request) {
  const auto edit = parsed_body(service, request, protocol::parse_edit);
  if (!edit.ok()) return problem_response(edit.problem(), request);
  return amended(service, request, edit.value());
}

Response delete_edit(Service& service, const Request& request) {
  return amended(service, request, std::nullopt);
}

Response put_head(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto head = parsed_body(service, request, protocol::parse_head);
  if (!head.ok()) return problem_response(head.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  const auto moved = session.value()->move_head(head.value().edit, expected.value());
  if (!moved.ok()) return problem_response(moved.problem(), request);
  return session_response(*session.value(), *moved.value());
}

}  // namespace pointwright::server
