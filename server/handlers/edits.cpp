#include <chrono>

#include "server/handlers/handlers.h"

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
          .sample_count = record.sample_count};
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
  const auto committed = session.value()->commit(edit.value(), revision.value());
  if (!committed.ok()) return problem_response(committed.problem(), request);
  const auto& [document, record] = committed.value();
  Response response = json_response(protocol::to_json(record_document(*record)), 201);
  response.timings.emplace_back(
      "edit", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response.with_header("ETag", revision_tag(document->revision));
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
