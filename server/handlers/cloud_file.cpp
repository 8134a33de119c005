#include "server/handlers/cloud_file.h"

#include "engine/io/cloud_io.h"

namespace pointwright::server {

const std::vector<Format>& cloud_file_formats() {
  static const std::vector<Format> formats = {{"ply", "application/x-ply", ".ply"},
                                              {"draco", "model/x-draco", ".drc"},
                                              {"xyz", "text/plain; charset=utf-8", ".xyz"}};
  return formats;
}

Response cloud_file_response(Service& service, const Request& request, std::shared_ptr<const Cloud> cloud,
                             const Format& format, const std::string& name, const std::string& etag) {
  if (is_unchanged(request.head, etag)) return not_modified(etag);
  const CloudFormat kind = format.name == "draco" ? CloudFormat::kDraco
                           : format.name == "xyz" ? CloudFormat::kXyz
                                                  : CloudFormat::kPly;
  const auto begin = std::chrono::steady_clock::now();
  auto written = computed(service.background,
                          [cloud = std::move(cloud), kind] { return write_cloud(*cloud, kind, {}); });
  if (!written.ok()) return problem_response(written.problem(), request);
  if (!written.value()) {
    Problem problem = protocol::to_problem(written.value().error());
    // The request is fine; it is the answer that cannot be given in this format.
    if (problem.kind == ProblemKind::kUnsupportedFormat) problem.kind = ProblemKind::kNotAcceptable;
    return problem_response(std::move(problem), request);
  }
  const auto bytes = std::make_shared<const std::vector<std::byte>>(std::move(written.value()).value());
  Response response{.content_type = std::string(format.media_type),
                    .body = SharedBytes{.owner = bytes, .bytes = *bytes}};
  response.timings.emplace_back(
      "encode", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response.with_header("ETag", etag)
      .with_header("Cache-Control", "no-cache")
      .with_header("Vary", "Accept")
      .with_header("Content-Disposition", download_name(name, format.extension));
}

}  // namespace pointwright::server
