#include "protocol/frames/frame.h"
#include "server/handlers/cloud_file.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

const std::vector<Format>& sample_formats() {
  static const std::vector<Format> formats = [] {
    std::vector<Format> all = cloud_file_formats();
    all.push_back({"frame", kFrameMediaType, ".pwfr"});
    return all;
  }();
  return formats;
}

std::string revision_name(std::uint64_t revision) {
  return std::string(1, 'r').append(std::to_string(revision));
}

std::string frame_tag(std::uint64_t revision, std::uint32_t level, std::uint16_t attributes) {
  return etag_of({revision_name(revision), "frame", std::to_string(level), std::to_string(attributes)});
}

Response frame_response(Service& service, const Request& request, Session& session, std::uint32_t level,
                        std::uint16_t attributes) {
  if (const std::string etag = frame_tag(session.document()->revision, level, attributes);
      is_unchanged(request.head, etag))
    return not_modified(etag);
  const auto picture = session.committed_picture(level, (attributes & protocol::kFrameT) != 0);
  if (!picture.ok()) return problem_response(picture.problem(), request);
  const auto frame = computed(service.interactive, [&] {
    return encode_picture(session.display().layout(), picture.value(), session.cloud(), level, attributes);
  });
  if (!frame.ok()) return problem_response(frame.problem(), request);
  auto answer = frame_answer(service, frame.value());
  if (!answer.ok()) return problem_response(answer.problem(), request);
  return answer.value()
      .with_header("ETag", frame_tag(picture.value().revision, level, attributes))
      .with_header("Cache-Control", "no-cache")
      .with_header("Vary", "Accept");
}

std::string file_tag(std::uint64_t revision, const Format& format, std::uint32_t level) {
  return etag_of({revision_name(revision), format.name, std::to_string(level)});
}

Response file_response(Service& service, const Request& request, Session& session, std::uint32_t level,
                       const Format& format) {
  if (const std::string etag = file_tag(session.document()->revision, format, level);
      is_unchanged(request.head, etag))
    return not_modified(etag);
  const auto picture = session.committed_picture(level, false);
  if (!picture.ok()) return problem_response(picture.problem(), request);
  return cloud_file_response(
      service, request, [&] { return session.edited_cloud(picture.value(), level); },
      memory_of(session.cloud()),
      {.format = format, .name = session.name(), .etag = file_tag(picture.value().revision, format, level)});
}

}  // namespace

Response get_samples(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  if (auto known = check_query(request.head, {"format", "level", "attributes"}); !known.ok())
    return problem_response(known.problem(), request);
  const auto format = negotiated_format(request.head, sample_formats());
  if (!format.ok()) return problem_response(format.problem(), request);
  const auto asked_level = query_number(request.head, "level");
  if (!asked_level.ok()) return problem_response(asked_level.problem(), request);
  const SharedDocument document = session.value()->document();
  if (document->state != protocol::SessionState::kReady)
    return problem_response({.kind = ProblemKind::kWrongState, .detail = "the session is not ready"},
                            request);
  const auto finest = static_cast<std::uint32_t>(document->surface.surface->band_count());
  const std::uint32_t level = asked_level.value().value_or(finest);
  if (level > finest)
    return problem_response({.kind = ProblemKind::kInvalidValue,
                             .detail = "the session has no such level",
                             .errors = {{.pointer = "?level", .detail = "beyond the finest level"}},
                             .limit = finest,
                             .actual = level},
                            request);
  if (format.value().name == "frame") {
    const auto attributes =
        query_attributes(request.head, protocol::kAllFrameAttributes, protocol::kFrameNormal);
    if (!attributes.ok()) return problem_response(attributes.problem(), request);
    return frame_response(service, request, *session.value(), level,
                          session.value()->available_attributes(attributes.value()));
  }
  if (query_value(request.head, "attributes"))
    return problem_response({.kind = ProblemKind::kInvalidValue,
                             .detail = "attributes can be chosen for frames only; files hold all of them",
                             .errors = {{.pointer = "?attributes", .detail = "for format=frame only"}}},
                            request);
  return file_response(service, request, *session.value(), level, format.value());
}

}  // namespace pointwright::server
