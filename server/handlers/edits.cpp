#include <algorithm>
#include <charconv>

#include "server/handlers/handlers.h"

namespace pointwright::server {
namespace {

protocol::EditRecord record_document(const RecordedEdit& record) {
  return {.index = static_cast<std::uint32_t>(record.index),
          .edit = record.params,
          .created = record.created,
          .moved_samples = record.moved_samples,
          .zero_samples = record.zero_samples,
          .one_samples = record.one_samples};
}

/// The revision of If-Match: "r<number>".
Outcome<std::uint64_t> expected_revision(const RequestHead& head) {
  const auto header = head.header("if-match");
  if (!header)
    return Problem{.kind = ProblemKind::kRevisionRequired,
                   .detail = "name the revision to build on: If-Match: \"r<n>\""};
  std::uint64_t revision = 0;
  const bool quoted =
      header->size() > 3 && header->size() < 22 && header->substr(0, 2) == "\"r" && header->back() == '"';
  const char* const end = header->data() + header->size() - 1;
  if (quoted) {
    const auto [stop, error] = std::from_chars(header->data() + 2, end, revision);
    if (error == std::errc{} && stop == end) return revision;
  }
  return Problem{.kind = ProblemKind::kMalformedRequest,
                 .detail = "If-Match must be one strong tag \"r<n>\""};
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
  const auto revision = expected_revision(request.head);
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
  return response.with_header("ETag", revision_tag(document->revision))
      .with_header("Location", "/v1/sessions/" + session.value()->id() + "/edits");
}

Response put_head(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto head = parsed_body(service, request, protocol::parse_head);
  if (!head.ok()) return problem_response(head.problem(), request);
  const auto moved = session.value()->move_head(head.value().edit);
  if (!moved.ok()) return problem_response(moved.problem(), request);
  return session_response(*session.value(), *moved.value());
}

}  // namespace pointwright::server
