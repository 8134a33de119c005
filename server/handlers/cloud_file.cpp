#include "server/handlers/cloud_file.h"

#include "engine/io/cloud_io.h"

namespace pointwright::server {
namespace {

// An edited copy of the cloud, and its file: text takes up to three times the memory of the columns.
constexpr std::uint64_t kCopyAndFile = 4;

struct WrittenFile {
  std::vector<std::byte> bytes;
  std::shared_ptr<Budget::Hold> memory;
};
using SharedFile = std::shared_ptr<const WrittenFile>;

Problem no_room(const Service& service) {
  return {.kind = ProblemKind::kOverloaded,
          .detail = "the memory for answers is taken by downloads that are under way",
          .limit = static_cast<double>(service.answer_memory.total())};
}

CloudFormat kind_of(const Format& format) {
  if (format.name == "draco") return CloudFormat::kDraco;
  return format.name == "xyz" ? CloudFormat::kXyz : CloudFormat::kPly;
}

Outcome<SharedFile> write_file(Service& service, const std::function<std::shared_ptr<const Cloud>()>& make,
                               std::uint64_t cloud_bytes, const Format& format) {
  auto memory = service.answer_memory.hold_or_alone(kCopyAndFile * cloud_bytes);
  if (memory == nullptr) return no_room(service);
  auto written = write_cloud(*make(), kind_of(format), {});
  if (!written) {
    Problem problem = protocol::to_problem(written.error());
    // The request is fine; it is the answer that cannot be given in this format.
    if (problem.kind == ProblemKind::kUnsupportedFormat) problem.kind = ProblemKind::kNotAcceptable;
    return problem;
  }
  memory->shrink_to(written.value().size());
  return SharedFile(std::make_shared<const WrittenFile>(
      WrittenFile{.bytes = std::move(written).value(), .memory = std::move(memory)}));
}

}  // namespace

const std::vector<Format>& cloud_file_formats() {
  static const std::vector<Format> formats = {{"ply", "application/x-ply", ".ply"},
                                              {"draco", "model/x-draco", ".drc"},
                                              {"xyz", "text/plain; charset=utf-8", ".xyz"}};
  return formats;
}

Response cloud_file_response(Service& service, const Request& request,
                             const std::function<std::shared_ptr<const Cloud>()>& make,
                             std::uint64_t cloud_bytes, const CloudFile& file) {
  const auto begin = std::chrono::steady_clock::now();
  const auto ran =
      computed(service.background, [&] { return write_file(service, make, cloud_bytes, file.format); });
  if (!ran.ok()) return problem_response(ran.problem(), request);
  if (!ran.value().ok()) return problem_response(ran.value().problem(), request);
  const SharedFile& written = ran.value().value();
  Response response{.content_type = std::string(file.format.media_type),
                    .body = SharedBytes{.owner = written, .bytes = written->bytes}};
  response.timings.emplace_back(
      "encode", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response.with_header("ETag", file.etag)
      .with_header("Cache-Control", "no-cache")
      .with_header("Vary", "Accept")
      .with_header("Content-Disposition", download_name(file.name, file.format.extension));
}

Outcome<Response> frame_answer(Service& service, const SharedFrame& frame) {
  auto memory = service.answer_memory.hold_or_alone(frame->size());
  if (memory == nullptr) return no_room(service);
  const auto owner =
      std::make_shared<const std::pair<SharedFrame, std::shared_ptr<Budget::Hold>>>(frame, std::move(memory));
  return Response{.content_type = std::string(kFrameMediaType),
                  .body = SharedBytes{.owner = owner, .bytes = *frame}};
}

Outcome<Response> text_answer(Service& service, std::string text, std::string content_type) {
  auto memory = service.answer_memory.hold_or_alone(text.size());
  if (memory == nullptr) return no_room(service);
  const auto owner = std::make_shared<const std::pair<std::string, std::shared_ptr<Budget::Hold>>>(
      std::move(text), std::move(memory));
  return Response{.content_type = std::move(content_type),
                  .body = SharedBytes{.owner = owner, .bytes = std::as_bytes(std::span(owner->first))}};
}

}  // namespace pointwright::server
