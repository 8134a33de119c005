#include "protocol/frames/frame.h"
#include "server/handlers/cloud_file.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {

Response put_preview(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto preview = parsed_body(service, request, protocol::parse_preview);
  if (!preview.ok()) return problem_response(preview.problem(), request);
  const auto expected = expected_revision(request.head);
  if (!expected.ok()) return problem_response(expected.problem(), request);
  if (auto put = session.value()->put_preview(preview.value(), expected.value()); !put.ok())
    return problem_response(put.problem(), request);
  return {.status = 204};
}

Response post_preview(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto attributes =
      query_attributes(request.head, protocol::kAllFrameAttributes, protocol::kFrameNormal);
  if (!attributes.ok()) return problem_response(attributes.problem(), request);
  const auto preview = parsed_body(service, request, protocol::parse_preview);
  if (!preview.ok()) return problem_response(preview.problem(), request);
  const auto begin = std::chrono::steady_clock::now();
  const auto bits = session.value()->available_attributes(attributes.value());
  const auto frame = session.value()->render_preview(preview.value(), bits);
  if (!frame.ok()) return problem_response(frame.problem(), request);
  auto answer = frame_answer(service, frame.value());
  if (!answer.ok()) return problem_response(answer.problem(), request);
  Response& response = answer.value();
  response.timings.emplace_back(
      "deform", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return std::move(response);
}

Response delete_preview(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  if (auto ended = session.value()->end_preview(); !ended.ok())
    return problem_response(ended.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
