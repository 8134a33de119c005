#include "server/handlers/cloud_file.h"

#include <algorithm>
#include <array>
#include <span>

#include "engine/io/columns.h"
#include "server/base/file_types.h"
#include "server/base/sha256.h"

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
  const auto* const type = std::find_if(kFileTypes.begin(), kFileTypes.end(), [&](const FileType& each) {
    return each.media_type == format.media_type;
  });
  return type == kFileTypes.end() ? CloudFormat::kPly : type->format;
}

Outcome<SharedFile> write_file(Service& service, const std::function<std::shared_ptr<const Cloud>()>& make,
                               std::uint64_t cloud_bytes, const CloudFile& file) {
  auto memory = service.answer_memory.hold_or_alone(kCopyAndFile * cloud_bytes);
  if (memory == nullptr) return no_room(service);
  auto cloud = make();
  if (file.options.attributes) {
    auto chosen = with_attributes(*cloud, *file.options.attributes);
    if (!chosen) {
      Problem problem = protocol::to_problem(chosen.error());
      problem.errors = {{.pointer = "?attributes", .detail = chosen.error().message}};
      return problem;
    }
    cloud = std::make_shared<const Cloud>(std::move(chosen).value());
  }
  auto written = write_cloud(*cloud, kind_of(file.format), {.ascii = file.options.ascii, .grid = file.grid});
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
  static const std::vector<Format> formats = [] {
    std::vector<Format> all;
    all.reserve(kFileTypes.size());
    for (const FileType& type : kFileTypes)
      all.push_back(
          {.name = format_name(type.format), .media_type = type.media_type, .extension = type.extension});
    return all;
  }();
  return formats;
}

bool FileOptions::names(std::string_view attribute) const {
  return attributes && std::find(attributes->begin(), attributes->end(), attribute) != attributes->end();
}

std::string FileOptions::tag() const {
  std::string text = ascii ? "ascii" : "";
  if (!attributes) return text;
  // Names may hold anything: their digest stands in the tag.
  std::string all;
  for (const std::string& name : *attributes) all.append(name).append(1, ',');
  constexpr std::size_t kEnough = 16;
  return text.append(sha256_hex(std::as_bytes(std::span(all.data(), all.size()))).substr(0, kEnough));
}

Outcome<FileOptions> query_file_options(const RequestHead& head, const Format& format) {
  constexpr std::array<std::string_view, 2> kEncodings{"binary", "ascii"};
  FileOptions options;
  const auto encoding = query_choice(head, "encoding", kEncodings);
  if (!encoding.ok()) return encoding.problem();
  options.ascii = encoding.value() == std::optional<std::size_t>(1);
  if (encoding.value() && format.name != "ply")
    return Problem{.kind = ProblemKind::kInvalidValue,
                   .detail = "only PLY files have a choice of encodings",
                   .errors = {{.pointer = "?encoding", .detail = "for format=ply only"}}};
  if (query_value(head, "attributes")) options.attributes = query_list(head, "attributes");
  return options;
}

Response cloud_file_response(Service& service, const Request& request,
                             const std::function<std::shared_ptr<const Cloud>()>& make,
                             std::uint64_t cloud_bytes, const CloudFile& file) {
  const auto begin = std::chrono::steady_clock::now();
  const auto ran = computed(service.background, [&] { return write_file(service, make, cloud_bytes, file); });
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
