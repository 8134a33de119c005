#pragma once
// Clouds as files to download, single frames and long texts.

#include "server/handlers/query.h"
#include "server/handlers/service.h"

namespace pointwright::server {

inline constexpr std::string_view kFrameMediaType = "application/vnd.pointwright.frame";

/// ply, draco, xyz.
const std::vector<Format>& cloud_file_formats();

struct CloudFile {
  Format format;
  std::string name;
  std::string etag;
};
/// The cloud that `make` gives, as a file in the caller's order. Made and written on the background pool,
/// within the memory for answers, of which the file's bytes hold their part until they are sent.
/// `cloud_bytes`: memory_of() that cloud
/// Problems: overloaded, not acceptable (the format cannot hold the cloud)
Response cloud_file_response(Service& service, const Request& request,
                             const std::function<std::shared_ptr<const Cloud>()>& make,
                             std::uint64_t cloud_bytes, const CloudFile& file);

/// A frame as an answer that holds its part of the memory for answers until it is sent.
/// Problem: overloaded
Outcome<Response> frame_answer(Service& service, const SharedFrame& frame);

/// A text as an answer that holds its part of the memory for answers until it is sent.
/// Problem: overloaded
Outcome<Response> text_answer(Service& service, std::string text, std::string content_type);

}  // namespace pointwright::server
